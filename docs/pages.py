"""Pages that are made and not written: one for each environment, from its docstring, and the leaderboard, from a JSON file."""

from __future__ import annotations

import inspect
import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

from films import panels

import tagtrack
from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.task import build_task
from tagtrack.eval.report import signed_cell
from tagtrack.eval.rivals import rivals_of
from tagtrack.eval.suite_run import best_first
from tagtrack.policies.box import boxed_policy

ARGS = re.compile(r"^Args:\n((?:    .*\n?)+)", re.MULTILINE)
FLEETS = "fleets-of-vehicles"
NOT_YET = "No run of this version yet: `tagtrack eval suite --policies heuristic pursuit --out docs/leaderboard.json` does it.\n"
FIRST, LAST = ("commands", "api"), ("design", "contributing", "release", "changelog")


def write_pages(docs: Path) -> None:
    """``environments/NAME.md`` for each id and one for fleets, and what other pages include."""
    folder = docs / "environments"
    folder.mkdir(exist_ok=True)
    for env_id, entry_point in tagtrack._TASKS.items():
        _write(folder / f"{page_name(env_id)}.md", environment_page(env_id, entry_point))
    fleets = docstring_as_markdown(import_module("tagtrack.envs.parallel").TagTrackParallelEnv.__doc__)
    ids = ", ".join(f"`{name}`" for name in tagtrack._FLEETS)
    _write(folder / f"{FLEETS}.md", f"# Fleets in PettingZoo\n\n{ids}\n\n{fleets}")
    board = docs / "leaderboard.json"
    _write(folder / "leaderboard_table.txt", leaderboard(json.loads(board.read_text())) if board.is_file() else NOT_YET)
    _write(folder / "reference.txt", reference(docs))


def reference(docs: Path) -> str:
    """The last list of the index: the usual pages, and between them whatever else lies in docs/ and is in no list."""
    listed = {*(docs / "index.md").read_text(encoding="utf-8").split(), *FIRST, *LAST, "index"}
    others = sorted(path.stem for path in docs.glob("*.md") if path.stem not in listed)
    return "\n".join(["```{toctree}", ":caption: Reference", ":maxdepth: 1", "", *FIRST, *others, *LAST, "```", ""])


def page_name(env_id: str) -> str:
    return env_id.rpartition("/")[2]


def environment_page(env_id: str, entry_point: str) -> str:
    """Film, how to make it, facts, table, contract."""
    module, _, name = entry_point.partition(":")
    text = docstring_as_markdown(getattr(import_module(module), name).__doc__)
    summary, _, contract = text.partition("\n\n")
    return "\n\n".join(
        [f"# {page_name(env_id)}", summary, _film(env_id), _make(env_id), _facts(env_id), _table(env_id), "## The task", contract]
    )


def _film(env_id: str) -> str:
    name, (left, right) = page_name(env_id), panels(env_id)
    if not (Path(__file__).parent / "films" / f"{name}.gif").is_file():
        return ""
    alt = f"Moving picture of one episode of {name}: {left} on the left, {right} on the right"
    caption = f"Episode 0: `{left}` and `{right}` on the same fish."
    caption += " Yellow is the vehicle, red the fish, blue the belief."
    return f"![{alt}](../films/{name}.gif)\n\n{caption}"


def _make(env_id: str) -> str:
    learned = f"tagtrack eval benchmark --env {page_name(env_id)}"
    return f'```python\nimport gymnasium as gym\n\nenv = gym.make("tagtrack:{env_id}")\n```\n\n```sh\n{learned}\n```'


def _facts(env_id: str) -> str:
    scenario = SCENARIOS[env_id]
    minutes = scenario.episode_steps * scenario.time_step / 60
    length = f"{minutes / 60:g} h" if minutes >= 120 else f"{minutes:g} min"
    rows = {
        "step, episode": f"{scenario.time_step:g} s, {scenario.episode_steps} steps ({length})",
        "vehicles, tags": f"{scenario.vehicles}, {scenario.targets}",
        "observation of a tag": f"{len(feature_names(scenario))} numbers" if scenario.targets == 1 else "a row for each",
        "action": ", ".join(action_names(scenario)),
        "vehicle, up to": f"{scenario.vehicle.max_speed:g} m/s",
        "particles": f"{scenario.belief.particles}",
        "heuristics to beat": ", ".join(f"`{name}`" for name in rivals_of(build_task(env_id))),
    }
    return "| | |\n| :-- | :-- |\n" + "\n".join(f"| {name} | {value} |" for name, value in rows.items())


def _table(env_id: str) -> str:
    """What the learned policy of the package came to when it was trained, from the record beside it."""
    scenario = SCENARIOS[env_id]
    try:
        folder = boxed_policy(env_id, vehicles=scenario.vehicles, tags=scenario.targets)
    except ValueError:
        return ""
    record = json.loads((folder / "run.json").read_text())
    return "\n".join(["## The learned policy of the package", "", f"`{record['command']}`", "", *record["table"]])


def docstring_as_markdown(text: str | None) -> str:
    """A docstring of this house: nearly markdown already; ``Args:`` becomes a list."""
    return ARGS.sub(lambda found: _as_list(found[1]), inspect.cleandoc(text or "") + "\n")


def _as_list(block: str) -> str:
    items: list[str] = []
    for line in block.splitlines():
        stripped = line[4:]
        if stripped.startswith(" ") and items:
            items[-1] += f" {stripped.strip()}"
        elif stripped.strip():
            names, _, rest = stripped.partition(": ")
            items.append(f"* `{names}`: {rest}")
    return "\n".join(items) + "\n"


def markdown_of_docstring(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Of an environment the API reference shows the summary: its docstring is a page of its own, in markdown."""
    if any(line.startswith("## ") for line in lines):
        lines[:] = [lines[0], "", "Its page is among the environments.", ""]


def leaderboard(document: dict[str, Any]) -> str:
    """The table of ``tagtrack eval suite``, best first."""
    tasks = document["tasks"]
    names = [task["name"] for task in tasks]
    header = ["policy", "score", *names]
    rows = [
        [policy, _cell(found["score"]), *(_cell(found["tasks"].get(name)) for name in names)]
        for policy, found in best_first(document)
    ]
    lines = ["| " + " | ".join(row) + " |" for row in (header, [":--", *["--:"] * (len(header) - 1)], *rows)]
    seen = f"{document['episodes']} episodes of each task, seed {document['seed']}."
    return "\n".join(lines) + f"\n\n{seen} {document['note']}\n\n`{document['command']}`\n"


def _cell(figure: dict[str, float] | None) -> str:
    return "-" if figure is None else signed_cell(figure)


def _write(path: Path, text: str) -> None:
    """Only if it changed: what did not is not read anew by Sphinx."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
