"""What `tagtrack eval suite` does: the protocol's tasks, who plays which, and the score."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.envs.task import Task, build_task
from tagtrack.envs.validation import unknown
from tagtrack.eval.cells.cell import Cell
from tagtrack.eval.cells.engine import Engine
from tagtrack.eval.command_line import command_line
from tagtrack.eval.contestants import GROUP, make_groups, name_groups
from tagtrack.eval.episode_record import EpisodeRecord
from tagtrack.eval.metrics import Runs, ratio_estimate
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, interval_cell, show, signed_cell, write_json
from tagtrack.eval.results_folder import default_folder, require_writable_file
from tagtrack.eval.rivals import best_of, rivals_of
from tagtrack.eval.rollout import SeedBlock, block_seed, cells_of, join_parts
from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.comparisons import geometric_mean
from tagtrack.eval.statistics.estimate import Estimate, Interval
from tagtrack.eval.suite import Suite
from tagtrack.eval.versions import collect_versions
from tagtrack.policies.box import LEARNED, boxed_policy

EPISODES, QUICK, SEED = 256, 16, 5_000_000  # of the benchmarks' block: far from those of a benchmark and of a training's table
PAPER, HEURISTIC = "paper", "heuristic"
NOTE = (
    "Each cell is the cost (minus the mean reward) of the paper's controller over that of the policy: above 1 the policy is "
    "better. The score is the logarithm of the geometric mean over tasks, on a scale where the paper's controller has 0 and the "
    "policy that comes with the package, learned, 1; that scale is taken as it came out. A task that a policy does not play (-) "
    "counts like the paper's controller. In brackets 95 % intervals."
)


@dataclass(frozen=True, kw_only=True)
class SuiteTask:
    """One task of the protocol."""

    name: str
    env: str
    vehicles: int | None = None
    tags: int | None = None

    def build(self) -> Task:
        return build_task(self.env, vehicles=self.vehicles, tags=self.tags)


TASKS = (
    *(
        SuiteTask(name=name, env=name)
        for name in (
            "LeopardShark-v0", "LeopardSharkStandoff-v0", "Glider-v0", "GliderPair-v0", "TimeOfFlight-v0", "RangeOnly-v0",
            "RangeOnlyGlider-v0", "AreaOnly-v0", "AreaOnlyUnknownRange-v0",
        )
    ),
    SuiteTask(name="LeopardShark-3x1", env="LeopardShark-v0", vehicles=3),
    SuiteTask(name="LeopardShark-2x4", env="LeopardShark-v0", vehicles=2, tags=4),
)  # fmt: skip


def run_suite(asked: Suite) -> None:
    """Run, print the table, write the file."""
    tasks = choose_tasks(asked.tasks)
    require_writable_file(asked.out)
    asked.engine.check()
    if asked.threads < 1:
        raise ValueError(f"--threads must be at least 1, got {asked.threads}")
    names = name_policies(asked.policies)
    built = {task: task.build() for task in tasks}
    makers = {task: players(task, built[task], names, trust=asked.trust) for task in tasks}
    for name in names:
        if not any(name in found for found in makers.values()):
            raise ValueError(f"{name} plays none of the tasks: {_reason(name, names, tasks[0], built[tasks[0]], asked.trust)}")
    for task, found in makers.items():
        for name in set(names) - set(found):
            print(f"note: {name} does not play {task.name}: {_reason(name, names, task, built[task], asked.trust)}")
    episodes = QUICK if asked.quick else EPISODES
    cells = {
        (task, name, run): cells_of(
            f"{task.name}: {run or name}", built[task], maker, episodes=episodes, seed=block_seed(SeedBlock.BENCHMARK, SEED),
            threads=asked.threads,
        )
        for task, found in makers.items()
        for name, each in found.items()
        for run, maker in (each if isinstance(each, dict) else {"": each}).items()
    }  # fmt: skip
    with asked.engine.open() as engine:
        ratios, seconds = play(cells, engine)
        document = suite_document(tasks, built, ratios, episodes=episodes, command=command_line("suite", asked))
        print_suite(document)
        path = asked.out or (folder := default_folder("suite", "")).with_name(f"{folder.name.replace('--', '-')}.json")
        path.parent.mkdir(parents=True, exist_ok=True)
        write_json(path, document | {"core_seconds": seconds, "versions": collect_versions()})
    print(f"written: {path}")


def play(
    cells: Mapping[tuple[SuiteTask, str, str], Sequence[Cell]], engine: Engine
) -> tuple[dict[str, dict[str, Estimate]], dict[str, list[float]]]:
    """By policy and task, the cost of the paper's controller over its own; and the seconds that the parts of each task took."""
    parts = [(task, cell) for (task, _, _), each in cells.items() for cell in each]
    with progress_bar(sum(cell.units for _, cell in parts)) as advance:
        done = engine.run([cell for _, cell in parts], advance)
    seconds: dict[str, list[float]] = {}
    for (task, _), one in zip(parts, done, strict=True):
        seconds.setdefault(task.name, []).append(round(one.seconds, 2))
    costs: dict[SuiteTask, dict[str, list[EpisodeRecord]]] = {}
    for (task, name, _), record in join_parts(cells, done).items():
        costs.setdefault(task, {}).setdefault(name, []).append(cost_of(record))
    ratios: dict[str, dict[str, Estimate]] = {}
    for task, runs in costs.items():
        for name, ratio in cost_ratios(runs).items():
            ratios.setdefault(name, {})[task.name] = ratio
    return ratios, seconds


def choose_tasks(names: Sequence[str]) -> list[SuiteTask]:
    """All, or those named. Raises ValueError that lists them."""
    known = {task.name: task for task in TASKS}
    for name in names:
        if name not in known:
            raise unknown("task", name, known, of="the suite")
    return [known[name] for name in dict.fromkeys(names or known)]


def name_policies(specs: Sequence[str]) -> dict[str, str]:
    """Specifications by the names of their rows. Raises ValueError for two of one name."""
    named: dict[str, str] = {}
    for spec in specs:
        group = GROUP.fullmatch(spec)
        name = group[1] if group else Path(spec).name if "{task}" in spec else spec
        if name in named:
            raise ValueError(f"two policies go by the name {name!r}; call one NAME={spec}")
        if name not in (PAPER, LEARNED):
            named[name] = spec
    return named


def players(task: SuiteTask, built: Task, names: Mapping[str, str], *, trust: bool) -> dict[str, Any]:
    """Makers of all that play a task: the paper's controller first, then those named that can, then learned."""
    rivals = rivals_of(built)
    found = {PAPER: make_groups({PAPER: rivals[0]}, built, built.env_id)[PAPER]}
    for name, spec in names.items():
        try:
            found[name] = _maker(name, spec, task, built, trust)
        except (ValueError, FileNotFoundError):
            continue
    try:
        box = boxed_policy(built.env_id, vehicles=built.scenario.vehicles, tags=built.scenario.targets)
    except ValueError:  # none comes with the package yet
        return found
    found[LEARNED] = make_groups({LEARNED: str(box)}, built, built.env_id)[LEARNED]
    return found


def _maker(name: str, spec: str, task: SuiteTask, built: Task, trust: bool) -> Any:
    spec = best_of(built) if spec == HEURISTIC else spec.replace("{task}", task.name)
    (made,) = make_groups(name_groups([spec]), built, built.env_id, trust=trust).values()
    return made


def _reason(name: str, names: Mapping[str, str], task: SuiteTask, built: Task, trust: bool) -> str:
    try:
        _maker(name, names[name], task, built, trust)
    except (ValueError, FileNotFoundError) as error:
        return str(error)
    return "it could be made"


def cost_ratios(costs: Mapping[str, Runs]) -> dict[str, Estimate]:
    """The cost of the first policy over that of each, with what is known of its uncertainty."""
    first, *others = costs
    exact = Estimate(value=1.0, below=0.0, above=0.0, relative=True)
    return {first: exact} | {name: _ratio(costs[first], costs[name]) for name in others}


def _ratio(first: Runs, other: Runs) -> Estimate:
    ratio = ratio_estimate(first, other, Bootstrap())
    assert ratio is not None
    return ratio


def cost_of(record: EpisodeRecord) -> EpisodeRecord:
    """A record whose error is the cost of each step: minus its reward."""
    assert record.reward is not None
    return EpisodeRecord(error=np.maximum(-record.reward, 0.0))


def suite_document(
    tasks: Sequence[SuiteTask],
    built: Mapping[SuiteTask, Task],
    ratios: Mapping[str, Mapping[str, Estimate]],
    *,
    episodes: int,
    command: str,
) -> dict[str, Any]:
    """What the JSON file holds, but for versions."""
    means = {name: overall([found.get(task.name) for task in tasks]) for name, found in ratios.items()}
    unit = math.log(means[LEARNED].value)
    unit = unit if unit > 0 else math.nan  # of a few tasks, or of few episodes, there may be no scale
    return {
        "tasks": [{"name": task.name, "paper": rivals_of(built[task])[0]} for task in tasks],
        "episodes": episodes,
        "seed": SEED,
        "command": command,
        "note": NOTE,
        "policies": {
            name: {
                "score": score(means[name], unit).to_json(),
                "tasks": {task: ratio.interval().to_json() for task, ratio in found.items()},
            }
            for name, found in ratios.items()
        },
    }


def overall(ratios: Sequence[Estimate | None]) -> Estimate:
    """The geometric mean over tasks; one that is not played counts 1."""
    return geometric_mean([ratio or Estimate(value=1.0, below=0.0, above=0.0, relative=True) for ratio in ratios])


def score(mean: Estimate, unit: float) -> Interval:
    """The logarithm of a geometric mean in units of that of the best known policy."""
    found = mean.interval()
    value, low, high = (math.log(each) / unit for each in (found.value, found.low, found.high))
    return Interval(value=value, low=low, high=high)


def best_first(document: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The policies by their scores; where there is no scale as they were named."""
    return sorted(document["policies"].items(), key=lambda item: -(item[1]["score"]["value"] or 0.0))


def print_suite(document: Mapping[str, Any]) -> None:
    """A row for each policy, the best first."""
    names = [task["name"] for task in document["tasks"]]
    empty = {"value": None, "low": None, "high": None}
    ordered = best_first(document)
    rows = [
        [name, signed_cell(found["score"]), *(interval_cell(found["tasks"].get(task, empty)) for task in names)]
        for name, found in ordered
    ]
    note = f"{document['episodes']} episodes of each task, seed {document['seed']}. {document['note']}"
    show(as_console_table(["policy", "score", *names], rows, note))
