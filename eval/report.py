"""A benchmark on paper: `benchmark.json` for programs, `table.md` for people, and the same table for the terminal.

Both tables are made from the JSON document alone, so that an old result can be printed again without running it.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tagtrack.command import print_no_more
from tagtrack.eval.statistics.clusters import FEWEST, Clusters
from tagtrack.eval.statistics.estimate import Interval
from tagtrack.policies.files import replace_file

if TYPE_CHECKING:
    from rich.table import Table

Document = dict[str, Any]  # the layout of benchmark.json
SIGNIFICANT = 0.05  # p-value, corrected for the number of comparisons, below which a ratio gets a star


def benchmark_document(
    *,
    env: str,
    episodes: int,
    seed: int,
    from_step: int = 0,
    groups: Mapping[str, Mapping[str, Mapping[str, float]]] | None = None,
    particles: int,
    tracks: Mapping[str, Any] | None = None,
    clusters: Clusters | None = None,
    fleet: Mapping[str, Any] | None = None,
    notes: Sequence[str] = (),
    versions: Mapping[str, str],
    policies: Mapping[str, Mapping[str, Interval]],
    comparisons: Mapping[str, Mapping[str, Any]],
) -> Document:
    """What `benchmark.json` holds; figures are `{"value", "low", "high"}`, null where undefined.

    Args:
        groups: of each training, its runs with their own `mean_error_m` and `ratio`.
        tracks: which recorded animals the fish were (`Task.describe_tracks`).
        clusters: of episodes that swim the same stretch of a track.
        fleet: how many vehicles and tags (`comparison.describe_fleet`); left out of the document where there is one of each.
        notes: sentences for the caption.
        policies: figures by policy, in the order of the table (`metrics.summarize`).
        comparisons: keyed `FIRST/NAME` (`metrics.compare_runs`).
    """
    told = None if clusters is None else {"windows": round(clusters.windows, 1), "sufficient": clusters.suffices}
    return {
        "env": env,
        "episodes": episodes,
        "seed": seed,
        "from_step": from_step,
        "groups": {name: {run: dict(figures) for run, figures in runs.items()} for name, runs in (groups or {}).items()},
        "particles": particles,
        "tracks": None if tracks is None else {**tracks, **(told or {})},
        **({} if fleet is None else {"fleet": dict(fleet)}),
        "notes": list(notes),
        "versions": dict(versions),
        "policies": {
            policy: {figure: interval.to_json() for figure, interval in figures.items()}
            for policy, figures in policies.items()
        },
        "ratios": {pair: _ratio_to_json(found) for pair, found in comparisons.items()},
    }


def _ratio_to_json(found: Mapping[str, Any]) -> dict[str, Any]:
    """The ratio's three numbers, and beside them what else the comparison found."""
    numbers = {name: found[name] if math.isfinite(found[name]) else None for name in ("freedom", "p", "p_holm")}
    return {**found["ratio"].to_json(), "median": found["median_ratio"].to_json(), "better": found["better"].to_json(), **numbers}


COLUMNS = (
    ("mean error [m]", "mean_error_m", 1),
    ("median [m]", "median_error_m", 1),
    ("95 % [m]", "p95_error_m", 1),
    ("trimmed mean [m]", "trimmed_mean_error_m", 1),
    ("lost [%]", "lost_fraction", 100),
    ("error if not lost [m]", "error_if_not_lost_m", 1),
    ("mean range [m]", "mean_range_m", 1),
    ("inside perimeter [%]", "inside_perimeter", 100),
)
# Left out of terminals, which are narrow: in 80 columns a policy's name must have room, too.
BRIEF = ("trimmed_mean_error_m", "mean_range_m", "encroachments_per_hour", "messages_per_hour")


def table_rows(document: Document, *, brief: bool = False) -> tuple[list[str], list[list[str]]]:
    """Header and one row per policy, as text; what no policy has (a perimeter, a second policy) gets no column.

    Args:
        brief: for terminals: fewer columns, and intervals of the mean error and the ratio alone.
    """
    policies = document["policies"]
    first = next(iter(policies))
    columns: list[tuple[str, str, float]] = list(COLUMNS)
    if fleet := document.get("fleet"):
        columns = [column for column in columns if "lost" not in column[1]] + fleet_columns(fleet)
    usual = {name for _, name, _ in (*COLUMNS, *columns)} | {"rmse_m"}
    known = [name for name, figure in policies[first].items() if name not in usual and not fleet_figure(name)]
    columns += [(name, name, 1) for name in known]  # metrics of the user's own
    having = {name for figures in policies.values() for name, figure in figures.items() if figure["value"] is not None}
    columns = [column for column in columns if column[1] in having and not (brief and column[1] in BRIEF)]
    header = ["policy", *(title for title, _, _ in columns)]
    rows = []
    for policy, figures in policies.items():
        row = [policy]
        for _, figure, scale in columns:
            shown = value_cell if brief and figure != "mean_error_m" else interval_cell
            row.append(shown(figures[figure], scale))
        rows.append(row)
    if len(policies) > 1:
        header += [f"{first} / policy", *([] if brief else ["median of ratios"]), "better in [%]"]
        for row in rows:
            row += _comparison_cells(document, f"{first}/{row[0]}", brief)
    return header, rows


def _comparison_cells(document: Document, pair: str, brief: bool) -> list[str]:
    """The cells that tell how a policy stands to the first one."""
    found = document["ratios"].get(pair)
    if found is None:
        return ["1", *([] if brief else ["1"]), "-"]
    several = len(document["ratios"]) > 1
    star = " *" if several and found["p_holm"] is not None and found["p_holm"] < SIGNIFICANT else ""
    median = [] if brief else [interval_cell(found["median"])]
    better = (value_cell if brief else interval_cell)(found["better"], 100)
    return [interval_cell(found) + star, *median, better]


def fleet_figure(name: str) -> bool:
    """Whether a figure is one of `fleet_metrics`."""
    return name.startswith("tag_") or name in ("worst_tag_error_m", "encroachments_per_hour", "messages_per_hour")


def fleet_columns(fleet: Mapping[str, Any]) -> list[tuple[str, str, float]]:
    """Title, figure and scale of the further columns of a fleet: what it cannot have gets none."""
    columns: list[tuple[str, str, float]] = [("lost [%]", "tag_lost_fraction", 100)]
    if fleet["tags"] > 1:
        columns.append(("worst tag [m]", "worst_tag_error_m", 1))
    if fleet["vehicles"] > 1:
        columns += [("too near [1/h]", "encroachments_per_hour", 1), ("messages [1/h]", "messages_per_hour", 1)]
    return columns


def fleet_note(fleet: Mapping[str, Any]) -> str:
    """A few words on who took part, and how their columns are read."""
    vehicles, tags = (f"{fleet[what]} {what[:-1] if fleet[what] == 1 else what}" for what in ("vehicles", "tags"))
    text = f" {vehicles}, {tags}, modem {fleet['modem']}: errors are means over tags and over the vehicles' beliefs,"
    if fleet["tags"] > 1:
        text += " lost is the share of time, mean over tags, worst the tag known worst in each episode;"
    if fleet["vehicles"] > 1:
        text += " how often vehicles came too near one another and what they sent are sums over all;"
    return f"{text} the range is the nearest vehicle's to the nearest fish."


def caption(document: Document) -> str:
    """A few sentences that say what the table was made from and how it is read."""
    later = f"from step {first_step} on, " if (first_step := document.get("from_step")) else ""
    count = document["episodes"]
    figures = [*(figure for found in document["policies"].values() for figure in found.values()), *document["ratios"].values()]
    told = any(figure["low"] is not None for figure in figures)
    text = (
        f"{count} paired episode{'s' * (count != 1)} of {document['env']}, seed {document['seed']}, {later}"
        f"{document['particles']} particles; {'in brackets 95 % intervals over episodes' if told else 'too few for intervals'}."
    )
    if fleet := document.get("fleet"):
        text += fleet_note(fleet)
    if document["ratios"]:
        first = next(iter(document["policies"]))
        text += (
            f" The ratio is the mean error of {first} over that of the row's policy: above 1, the row is better. It is better in "
            "so many of the episodes, a tie counting half."
        )
    if len(document["ratios"]) > 1 and any(found["p_holm"] is not None for found in document["ratios"].values()):
        text += f" A star: another ratio than 1 even for {len(document['ratios'])} comparisons at once (Holm, 5 %)."
    for name, runs in document.get("groups", {}).items():
        ratios = ", ".join(_number(run["ratio"]) for run in runs.values())
        if len(runs) == 1:
            text += f" {name} is one training run: its intervals say nothing of other runs."
        else:
            text += f" {name} is {len(runs)} training runs, ratios {ratios}: its intervals hold for other runs as well."
    text += "".join(f" {note}" for note in document.get("notes", ()))
    if tracks := document.get("tracks"):
        text += _track_note(tracks)
    return text


def _track_note(tracks: Mapping[str, Any]) -> str:
    """A few words on recorded tracks, and how many episodes of them tell something new."""
    source = f" of {tracks['file']}" if tracks["file"] else ""  # none for tracks that a program made
    text = (
        f" The fish swim recorded tracks{source} at {tracks['time_scale']:g} times their speed: animals "
        f"{tracks['animals']}, unbroken stretches {tracks['stretches']}, {tracks['hours']:g} h in all"
    )
    if "windows" not in tracks:
        return f"{text}."
    text += f", {tracks['windows']:g} episodes that share nothing; "
    if tracks["sufficient"]:
        return f"{text}these, of these animals, are what intervals draw from."
    return f"{text}fewer than {FEWEST}, so that there are no intervals."


def markdown_table(document: Document) -> str:
    """The table in GitHub's markdown, policies left, figures right, the caption below it."""
    return as_markdown(*table_rows(document), caption(document))


def as_markdown(header: Sequence[str], rows: Sequence[Sequence[str]], note: str) -> str:
    """A table in GitHub's markdown, the first column left, figures right, a note below it."""
    escaped = [[_plain(cell) for cell in row] for row in (header, *rows)]
    rule = [":--", *["--:"] * (len(header) - 1)]
    lines = ["| " + " | ".join(row) + " |" for row in (escaped[0], rule, *escaped[1:])]
    return "\n".join(lines) + f"\n\n{_plain(note)}\n"


def _plain(text: str) -> str:
    """Text as markdown shows it letter by letter: no name becomes a tag, a column, a link or a picture."""
    return " ".join(text.split()).replace("<", "&lt;").replace("|", r"\|").replace("](", r"]\(")


def console_table(document: Document) -> Table:
    """The table for the terminal: `show(console_table(document))`."""
    return as_console_table(*table_rows(document, brief=True), caption(document))


def as_console_table(header: Sequence[str], rows: Sequence[Sequence[str]], note: str) -> Table:
    """A table for the terminal, the first column left, figures right, a note below it; it fits any width."""
    from tagtrack.eval.console import FittedTable

    return FittedTable(header, rows, note)


def show(table: Table) -> None:
    """Print a table. Whoever reads it may stop reading: what comes after it, files above all, is done all the same."""
    import rich

    try:
        rich.print(table)
    except (BrokenPipeError, SystemExit):  # the second is how rich ends a program whose reader has left
        print_no_more()


def write_benchmark(folder: str | os.PathLike[str], document: Document) -> tuple[Path, Path]:
    """Write `benchmark.json` and `table.md` into a folder that exists; each is either whole or untouched.

    Returns:
        The two paths.
    """
    paths = Path(folder) / "benchmark.json", Path(folder) / "table.md"
    write_json(paths[0], document)
    write_text(paths[1], markdown_table(document))
    return paths


def write_json(path: str | os.PathLike[str], document: Mapping[str, Any]) -> None:
    """Write a JSON file, whole or not at all. Raises ValueError for NaN, which JSON does not have."""
    write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file, whole or not at all."""
    with replace_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def value_cell(figure: Mapping[str, float | None], scale: float = 1) -> str:
    """A figure `{"value", "low", "high"}` as a cell of a table, without its interval."""
    value = figure["value"]
    return "-" if value is None else _number(value * scale)


def signed_cell(figure: Mapping[str, float | None]) -> str:
    """A score, which may be negative, with two digits and its interval, if it has one."""
    if figure["value"] is None:
        return "-"
    value = f"{figure['value']:.2f}"
    return value if figure["low"] == figure["high"] else f"{value} [{figure['low']:.2f}, {figure['high']:.2f}]"


def interval_cell(figure: Mapping[str, float | None], scale: float = 1) -> str:
    """A figure as a cell of a table, "5.62 [5.41, 5.83]"."""
    low, high = figure["low"], figure["high"]
    if low is None or high is None:
        return value_cell(figure, scale)
    return f"{value_cell(figure, scale)} [{_number(low * scale)}, {_number(high * scale)}]"


def _number(value: float) -> str:
    """Three digits, but whole numbers in full and never an exponent: 0.041, 5.62, 41.7, 1234."""
    if value == 0:
        return "0"
    before_the_point = len(f"{int(abs(value))}") if abs(value) >= 1 else 0
    return f"{value:.{max(3 - before_the_point, 0)}f}"
