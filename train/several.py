"""Runs of one training that differ in their seed: each is a cell of an engine, and one table tells of all.

A run is trained in its folder and goes on from its checkpoints; on a cluster it travels (``travelling.py``).
"""

from __future__ import annotations

import contextlib
import dataclasses
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from tagtrack.envs.task import Task, full_id
from tagtrack.envs.workers import cores
from tagtrack.eval.benchmark_pictures import draw_learning
from tagtrack.eval.cells.cell import Cell, Done
from tagtrack.eval.cells.engine import Engine
from tagtrack.eval.comparison import compare
from tagtrack.eval.folder_claim import claim, release
from tagtrack.eval.plots import save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import console_table, markdown_table, show, write_text
from tagtrack.eval.results_folder import require_room
from tagtrack.eval.rivals import rivals_of
from tagtrack.eval.rollout import SeedBlock, run_seed
from tagtrack.eval.versions import collect_versions
from tagtrack.train.checkpoint import has_checkpoint
from tagtrack.train.cli import guarded
from tagtrack.train.config import TrainConfig, from_json, to_json
from tagtrack.train.run_folder import CONFIG_FILE, TABLE_FILE
from tagtrack.train.runs import check, run
from tagtrack.train.session import TABLE_EPISODES, TABLE_SEED, benchmark_command
from tagtrack.train.settings import with_own_start
from tagtrack.train.training import Tell
from tagtrack.train.travelling import Outcome, remove_halves, take_in, train_there

GROUP = "learned"  # the row of all runs together
CURVES_FILE = "learning_curves.png"
MAY_DIFFER = ("out", "threads", "device", "config", "resume")  # of a run that is gone on with


def train_several(config: TrainConfig) -> int:
    """Train what is not finished, then print and write the table. Returns the exit status."""
    config.engine.check()
    if config.seed != TrainConfig().seed or config.resume is not None:
        raise ValueError("--seeds goes without --seed and --resume; the same command again goes on with what is not finished")
    if len(set(config.seeds)) < len(config.seeds):
        raise ValueError(f"--seeds must be different ones, got {' '.join(map(str, config.seeds))}")
    for seed in config.seeds:
        run_seed(SeedBlock.TRAINING, seed)
    config = with_own_start(config)
    task, settings = check(config)
    place = config.out or Path("runs") / f"{full_id(config.env).rpartition('/')[2]}-{config.algo}"
    plain = dataclasses.replace(config, seeds=(), engine=TrainConfig().engine)
    runs = {place / f"seed{seed}": dataclasses.replace(plain, seed=seed, out=place / f"seed{seed}") for seed in config.seeds}
    if place.exists() and not place.is_dir():
        raise ValueError(f"--out {place} is a file; choose a folder")
    if (place / CONFIG_FILE).is_file():
        raise ValueError(f"--out {place} holds a run; several go into folders of their own below it, so choose another folder")
    require_room(place, f"--out {place}")
    claim(place)
    try:
        travels = config.engine.engine == "ray"
        found = {folder: what_is_left(folder, one, travels=travels) for folder, one in runs.items()}
        left = {folder: one for folder, one in found.items() if one is not None}
        if len(left) < len(runs):
            print(f"trained before: {', '.join(folder.name for folder in runs if folder not in left)}")
        place.mkdir(parents=True, exist_ok=True)
        remove_halves(place)
        status = train_all(left, config, steps=settings.steps)
        if status == 0:
            conclude(config, task, place, list(runs))
        return status
    except KeyboardInterrupt:
        print("\nbroken off; the same command again goes on with what was saved", file=sys.stderr)
        return 130
    finally:
        release(place)


def what_is_left(folder: Path, config: TrainConfig, *, travels: bool) -> TrainConfig | None:
    """What trains a run to its end: anew, or from its checkpoint; None where it is finished.

    Raises:
        ValueError: where its folder holds another run, or what cannot travel.
    """
    if not (folder / CONFIG_FILE).is_file():
        if travels and folder.is_dir() and any(folder.iterdir()):
            raise ValueError(f"{folder} holds files and no run; choose another --out")
        return dataclasses.replace(config, trust=False)
    told, asked = to_json(from_json(folder / CONFIG_FILE)), to_json(config)
    for name, value in asked.items():
        if name not in MAY_DIFFER and told[name] != value:
            raise ValueError(f"{folder} was trained with {name}={told[name]!r}, not {value!r}; choose another --out")
    if (folder / TABLE_FILE).is_file() and has_checkpoint(folder):
        return None
    if travels:
        raise ValueError(f"{folder} was begun on this machine; finish it with --engine local, or choose another --out")
    return dataclasses.replace(TrainConfig(), resume=folder, threads=config.threads, device=config.device, trust=config.trust)


def train_all(runs: Mapping[Path, TrainConfig], config: TrainConfig, *, steps: int) -> int:
    """Train all, several at a time, and tell of those that failed. Returns the largest exit status."""
    options = config.engine
    travels = options.engine == "ray"
    engine = Engine(
        kind=options.engine, processes=options.processes or (None if travels else cores()), address=options.address, patient=True
    )
    function = train_there if travels else train_here
    cells = [Cell(name=folder.name, function=function, arguments=(one, folder), units=steps) for folder, one in runs.items()]
    folders = list(runs)

    def take(number: int, done: Done) -> None:
        outcome: Outcome = done.value
        if outcome.files is not None:
            take_in(folders[number], outcome)
        if outcome.status == 0:
            print(f"{folders[number].name}: trained in {done.seconds:.0f} s")
        else:
            print(f"{folders[number].name}: {outcome.last_line}; all that it said is in {folders[number]}.log")

    with progress_bar(steps * len(cells)) as advance:
        outcomes = [done.value for done in engine.run(cells, advance, take)]
    return max((outcome.status for outcome in outcomes), default=0)


def train_here(config: TrainConfig, folder: Path, *, tell: Tell) -> Outcome:
    """Train a run in its folder; what it says goes into a file beside it.

    Where a process was killed that had begun it, it goes on from there.
    """
    if config.resume is None:
        left = what_is_left(folder, config, travels=False)
        if left is None:
            return Outcome(0, "", None)
        config = left
    log = folder.with_name(f"{folder.name}.log")
    with log.open("a", buffering=1, encoding="utf-8") as file, contextlib.redirect_stdout(file), contextlib.redirect_stderr(file):
        status = guarded(lambda: run(config, tell))
    if status == 130:  # what was saved stays; the others are not begun
        raise KeyboardInterrupt
    return Outcome(status, log.read_text(encoding="utf-8"), None)


def conclude(config: TrainConfig, task: Task, place: Path, folders: Sequence[Path]) -> None:
    """Print and write the table of all runs together, beside the best heuristics, and draw their learning curves."""
    group = {folder.name: str(folder) for folder in folders}
    specs: dict[str, str | dict[str, str]] = {**{rival: rival for rival in rivals_of(task)}, GROUP: group}
    comparison = compare(task, specs, episodes=TABLE_EPISODES, seed=TABLE_SEED, env_id=task.env_id)
    document = comparison.document(collect_versions())
    show(console_table(document))
    write_text(place / TABLE_FILE, markdown_table(document))
    if curves := draw_learning(comparison, specs):
        save_figure(place / CURVES_FILE, curves)
    print(f"runs: {place}\nmore: {benchmark_command(config, task, f'{GROUP}=' + ','.join(map(str, folders)))}")
