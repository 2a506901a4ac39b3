"""The benchmark's files: the JSON layout others read, and a table in which every name stays a name."""

import io
import json
import math

import pytest

from tagtrack.eval.episode_record import EpisodeRecord
from tagtrack.eval.metrics import compare_runs, summarize
from tagtrack.eval.report import benchmark_document, caption, console_table, markdown_table, table_rows, write_benchmark
from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.estimate import Interval


def document(*, perimeter=math.nan, names=("three_step", "circle:40"), tracks=None):
    errors = {name: [[6.0 / (i + 1)] * 4, [8.0 / (i + 1)] * 4] for i, name in enumerate(names)}
    records = {name: EpisodeRecord(error=error, range=[[10.0] * 4, [30.0] * 4]) for name, error in errors.items()}
    first = names[0]
    comparisons = {
        f"{first}/{name}": compare_runs([records[first]], [records[name]], Bootstrap()) | {"p_holm": 0.01} for name in names[1:]
    }
    return benchmark_document(
        env="TagTrack/LeopardShark-v0",
        episodes=2,
        seed=0,
        particles=4000,
        tracks=tracks,
        versions={"tagtrack": "0.1.0"},
        policies={name: summarize(record, perimeter=perimeter, lost_error=5.0) for name, record in records.items()},
        comparisons=comparisons,
    )


def test_document_has_the_layout_of_benchmark_json():
    made = document()
    assert list(made) == [
        "env", "episodes", "seed", "from_step", "groups", "particles", "tracks", "notes", "versions", "policies", "ratios",
    ]  # fmt: skip
    assert list(made["policies"]) == ["three_step", "circle:40"]
    assert made["policies"]["three_step"]["mean_error_m"] == {"value": 7.0, "low": 6.0, "high": 8.0}
    assert made["policies"]["three_step"]["inside_perimeter"] == {"value": None, "low": None, "high": None}
    ratio = made["ratios"]["three_step/circle:40"]
    assert (ratio["value"], ratio["low"], ratio["high"]) == (2.0, 2.0, 2.0)
    assert ratio["better"]["value"] == 1.0 and ratio["median"]["value"] == 2.0


def test_rows_read_as_the_figures_say():
    header, rows = table_rows(document(perimeter=20.0))
    assert header == [
        "policy", "mean error [m]", "median [m]", "95 % [m]", "trimmed mean [m]", "lost [%]", "error if not lost [m]",
        "mean range [m]", "inside perimeter [%]", "three_step / policy", "median of ratios", "better in [%]",
    ]  # fmt: skip
    first, second = (dict(zip(header, row, strict=True)) for row in rows)
    assert first["mean error [m]"] == "7.00 [6.00, 8.00]" and first["three_step / policy"] == "1"
    assert first["error if not lost [m]"] == "-"  # all steps are beyond 5 m
    assert second["mean error [m]"] == "3.50 [3.00, 4.00]" and second["three_step / policy"] == "2.00 [2.00, 2.00]"
    assert second["lost [%]"] == "0 [0, 84.2]"  # none of two: 1 - 0.025^(1/2)
    assert second["better in [%]"] == "100 [100, 100]"


def test_terminals_get_fewer_columns():
    header, rows = table_rows(document(perimeter=20.0), brief=True)
    assert "trimmed mean [m]" not in header and "median of ratios" not in header
    assert rows[1][header.index("median [m]")] == "3.50" and rows[1][1] == "3.50 [3.00, 4.00]"


def test_names_of_policies_have_room_in_80_columns_beside_the_columns_of_fleets():
    from rich.console import Console

    made = document(names=("information:34", "circle:radius=34,centroid=1", "c"))
    made["fleet"] = {"vehicles": 2, "tags": 4, "modem": "perfect"}
    known = {"value": 12.4, "low": 12.0, "high": 13.0}
    for figures in made["policies"].values():
        figures |= dict.fromkeys(
            ("tag_lost_fraction", "worst_tag_error_m", "encroachments_per_hour", "messages_per_hour", "tag_0_error_m"), known
        )
    screen = io.StringIO()
    Console(file=screen, width=80).print(console_table(made))
    assert "information" in screen.getvalue() and "circle:rad" in screen.getvalue() and "…" not in screen.getvalue()


def test_a_star_needs_several_comparisons():
    _, rows = table_rows(document(names=("three_step", "a", "b")))
    assert [row[-3] for row in rows] == ["1", "2.00 [2.00, 2.00] *", "3.00 [3.00, 3.00] *"]


def test_a_figure_that_nobody_has_gets_no_column():
    assert "inside perimeter [%]" not in table_rows(document())[0]
    assert table_rows(document(names=("alone",)))[0][-1] == "mean range [m]"


def test_markdown_is_one_table_with_as_many_cells_in_every_row():
    lines = markdown_table(document(names=("three_step", "a|b"))).splitlines()
    assert lines[1].startswith("| :-- | --: |")
    assert r"a\|b" in lines[3]
    cells = [line.replace(r"\|", "").count("|") for line in lines[:4]]
    assert len(set(cells)) == 1
    assert "2 paired episodes of TagTrack/LeopardShark-v0, seed 0, 4000 particles" in lines[5]


def test_caption_speaks_of_intervals_and_stars_only_where_there_are_some():
    told = caption(document(names=("three_step", "a", "b")))
    assert "in brackets 95 % intervals" in told and "A star" in told
    one = document(names=("three_step", "a", "b")) | {"episodes": 1}
    for figure in [*(f for found in one["policies"].values() for f in found.values()), *one["ratios"].values()]:
        figure |= {"low": None, "high": None, "p_holm": None}
    assert caption(one).startswith("1 paired episode of") and "too few for intervals." in caption(one)
    assert "bracket" not in caption(one) and "star" not in caption(one)


def test_caption_tells_which_animals_were_replayed():
    tracks = {"file": "training.csv", "animals": 12, "stretches": 310, "hours": 1234.5, "time_scale": 20.0, "longest_gap": 900.0}
    told = "recorded tracks of training.csv at 20 times their speed: animals 12, unbroken stretches 310, 1234.5 h in all."
    assert markdown_table(document(tracks=tracks)).rstrip().endswith(told)
    assert "recorded tracks at 20 times their speed" in markdown_table(document(tracks={**tracks, "file": None}))
    old = document()
    del old["tracks"]  # as files of earlier versions
    assert "tracks" not in markdown_table(old)


def test_console_shows_a_name_with_brackets_as_it_is():
    from rich.console import Console

    screen = io.StringIO()
    Console(file=screen, width=200).print(console_table(document(names=("three_step", "[red]run"))))
    assert "[red]run" in screen.getvalue()
    assert "[3.00, 4.00]" in screen.getvalue()


def test_console_breaks_no_name_and_no_interval_in_80_columns():
    from rich.console import Console

    screen = io.StringIO()
    Console(file=screen, width=80).print(console_table(document(perimeter=20.0)))
    for whole in ("three_step ", "circle:40 ", "[3.00, 4.00]", "[2.00, 2.00]", "perimeter", "median"):
        assert whole in screen.getvalue()


def test_files_are_written_and_an_old_table_can_be_made_from_the_json(tmp_path):
    made = document(perimeter=20.0)
    json_path, table_path = write_benchmark(tmp_path, made)
    assert (json_path.name, table_path.name) == ("benchmark.json", "table.md")
    read = json.loads(json_path.read_text(encoding="utf-8"))
    assert read == made
    assert table_path.read_text(encoding="utf-8") == markdown_table(read)
    assert {path.name for path in tmp_path.iterdir()} == {"benchmark.json", "table.md"}


def test_a_document_that_is_not_json_leaves_the_old_files_alone(tmp_path):
    write_benchmark(tmp_path, document())
    before = (tmp_path / "benchmark.json").read_bytes()
    broken = document()
    broken["versions"] = {"tagtrack": math.nan}
    with pytest.raises(ValueError, match="JSON"):
        write_benchmark(tmp_path, broken)
    assert (tmp_path / "benchmark.json").read_bytes() == before


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.0, "0"), (0.0413, "0.041"), (5.618, "5.62"), (41.73, "41.7"), (123.4, "123"), (1234.5, "1234")],
)
def test_three_digits_are_shown(value, shown):
    figures = {
        **document()["policies"]["three_step"],
        "mean_error_m": Interval(value=value, low=value, high=value).to_json(),
    }
    _, rows = table_rows({"policies": {"only": figures}, "ratios": {}})
    assert rows[0][1].split()[0] == shown


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_terminals_of_any_width_show_every_figure_of_every_row(width):
    from rich.console import Console

    from tagtrack.eval.console import FittedTable

    made = document(perimeter=20.0, names=("three_step", "circle:radius=34,centroid=1", "a policy with a long name of its own"))
    header, rows = table_rows(made)
    screen = io.StringIO()
    Console(file=screen, width=width).print(FittedTable(header, rows, "A note that goes on. " * 5))
    lines = screen.getvalue().splitlines()
    assert max(map(len, lines)) <= width and "…" not in screen.getvalue()
    shown = "".join(screen.getvalue().split())
    for cell in {part for row in rows for text in row[1:] for part in text.replace("[", " [").split(" [")}:
        assert cell.replace(" ", "") in shown
    assert " ".join(screen.getvalue().split()).count("that goes on") == 5
