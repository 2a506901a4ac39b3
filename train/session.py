"""What happens in a run's folder from its beginning, or its last checkpoint, to the table at the end."""

from __future__ import annotations

import dataclasses
import os
import shlex
import time
from collections.abc import Mapping
from typing import Any

import torch

from tagtrack.command import tagtrack_here
from tagtrack.envs.overrides import describe_scenario
from tagtrack.envs.task import Task
from tagtrack.eval.comparison import compare
from tagtrack.eval.contestants import PolicySpec
from tagtrack.eval.plots import plot_learning_curve, save_figure
from tagtrack.eval.report import console_table, markdown_table, show, write_text
from tagtrack.eval.rivals import rivals_of
from tagtrack.eval.rollout import SeedBlock, run_seed
from tagtrack.eval.versions import collect_versions
from tagtrack.train.checkpoint import Checkpoint, remove_others
from tagtrack.train.config import TrainConfig, flatten, to_json
from tagtrack.train.course import restore_course
from tagtrack.train.learning import build_model, load_model
from tagtrack.train.run_folder import CONFIG_FILE, TABLE_FILE, UNTRAINED, RunFolder
from tagtrack.train.settings import PPOSettings, Settings
from tagtrack.train.starting import start_as
from tagtrack.train.training import Tell, Training, learn, make_logger
from tagtrack.train.vec_env import TagTrackVecEnv

WATCHED = 4  # rollouts of a policy that began as another, in which only its critic learns
TABLE_EPISODES, TABLE_SEED = 256, 1_000_000  # of the benchmarks' block


def train(
    config: TrainConfig,
    settings: Settings,
    task: Task,
    folder: RunFolder,
    checkpoint: Checkpoint | None,
    tell: Tell | None = None,
) -> int:
    """Train in a folder, from the checkpoint if there is one; table, curve and path at the end. Returns the exit status."""
    torch.set_num_threads(1)  # a second thread costs more than it gives on networks this small
    env = make_env(config, settings, task)
    training_seed = run_seed(SeedBlock.TRAINING, config.seed)
    if checkpoint is None:
        model = build_model(settings, env, config.seed, config.device)
        if config.start is not None:
            start_as(model, config.start, task, hold=env.hold, seed=config.seed)
    else:
        model = load_model(settings, checkpoint, env, config.device)
        training_seed += 2**31 + model.num_timesteps  # of new episodes, where the worlds are other ones than before
        remove_others(checkpoint.folder.parent, checkpoint.folder.name)
        (folder.path / TABLE_FILE).unlink(missing_ok=True)  # it will tell of another policy
    write_config(config, settings, task, folder)  # first of all files: it makes the folder a run
    if checkpoint is None:
        folder.write_json("versions.json", collect_versions())
    if checkpoint is None or not restore_course(checkpoint.course, model):
        env.seed(training_seed)  # after the model, which seeds its environment with its own seed
    model.set_logger(make_logger(folder))
    training = Training(
        folder,
        task,
        task.env_id,
        total=settings.steps,
        seed=config.seed,
        episodes=settings.validation_episodes,
        resumed=None if checkpoint is None else checkpoint.progress,
        hold=settings.hold if isinstance(settings, PPOSettings) else 1,
        watched=rollouts_to_watch(config, settings, model.num_timesteps),
        tell=tell,
    )
    if isinstance(settings, PPOSettings):
        print(describe_updates(settings, model.num_timesteps), flush=True)
    started, done = time.perf_counter(), model.num_timesteps
    finished = learn(model, training)
    env.close()
    if not finished:
        draw_curve(folder)
        command = f"{tagtrack_here()} train --resume {shlex.quote(os.path.relpath(folder.path))}"
        print(f"stopped at {model.num_timesteps:,} of {settings.steps:,} steps; go on with\n    {command}")
        return 130
    before = f" after {done:,} earlier ones" if done else ""
    print(f"trained {model.num_timesteps - done:,} steps{before} in {time.perf_counter() - started:.0f} s")
    finish(config, task, folder)
    return 0


def rollouts_to_watch(config: TrainConfig, settings: Settings, done: int) -> int:
    """How many more rollouts only the critic learns from, of a policy that began as another, ``done`` steps ago."""
    if config.start is None or not isinstance(settings, PPOSettings):
        return 0
    return max(WATCHED - done // settings.rollout, 0)


def make_env(config: TrainConfig, settings: Settings, task: Task) -> TagTrackVecEnv:
    """The worlds to train in."""
    vehicles = task.scenario.vehicles
    rows = max(1, settings.num_envs // vehicles) * vehicles
    hold = settings.hold if isinstance(settings, PPOSettings) else 1
    return TagTrackVecEnv(task, rows, threads=config.threads, stagger=True, hold=hold)


def write_config(config: TrainConfig, settings: Settings, task: Task, folder: RunFolder) -> None:
    """config.json: what was asked for, and what it came to. A resumed run's may have more steps."""
    asked = to_json(dataclasses.replace(config, out=folder.path, resume=None))
    told: dict[str, Any] = {
        "settings": dataclasses.asdict(settings),
        "scenario": describe_scenario(task.scenario),
        "replayed": task.describe_tracks(),
    }
    folder.write_json(CONFIG_FILE, asked | told)


def describe_updates(settings: PPOSettings, done: int) -> str:
    """How often PPO will learn, from how many steps: rollouts are whole."""
    updates = -(-(settings.steps - done) // settings.rollout)
    total = done + updates * settings.rollout
    return (
        f"{count(updates, 'update')}, each from {settings.rollout:,} steps in {count(settings.num_envs, 'world')}, "
        f"up to step {total:,}"
    )


def count(number: int, noun: str) -> str:
    """A number of things."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def finish(config: TrainConfig, task: Task, folder: RunFolder) -> None:
    """What a trained run ends with: its curve, and its table on the terminal and in table.md."""
    draw_curve(folder)
    write_comparison(config, folder, task, task.env_id)
    print(f"run: {folder.path}\nmore: {benchmark_command(config, task, str(folder.path))}")


def benchmark_command(config: TrainConfig, task: Task, policy: str) -> str:
    """The command that compares a policy of this task with more."""
    return f"{tagtrack_here()} eval benchmark {describe_task(config, task)} --policies three_step {shlex.quote(policy)}"


def describe_task(config: TrainConfig, task: Task) -> str:
    """The options of `tagtrack eval` that name the task of a run."""
    given = {name: getattr(config, name) for name in ("preset", "tracks", "time_scale", "motion", "vehicles", "tags", "modem")}
    env_id = config.env if ":" in config.env else task.env_id  # its module must be imported again
    options = [f"--env {shlex.quote(env_id)}"]
    options += [f"--{name.replace('_', '-')} {shlex.quote(str(value))}" for name, value in given.items() if value is not None]
    return " ".join([*options, *(["--set", *map(shlex.quote, flatten(config.set))] if config.set else [])])


def draw_curve(folder: RunFolder, rivals: Mapping[str, float] | None = None) -> None:
    """learning_curve.png from progress.csv, with lines at the mean errors [m] of ``rivals``."""
    rows = folder.read_progress()
    if rows:
        steps = [float(row["steps"]) for row in rows]
        errors = [float(row["validation_error_m"]) for row in rows]
        save_figure(folder.path / "learning_curve.png", plot_learning_curve({folder.path.name: (steps, errors)}, rivals or {}))


def write_comparison(config: TrainConfig, folder: RunFolder, task: Task, env_id: str) -> None:
    """A small table: the policy kept beside the best heuristics and what it began as, on episodes it was not chosen on.

    It is the last file that a run writes: who has one is finished.
    """
    name, rivals = folder.path.resolve().name, rivals_of(task)
    began = UNTRAINED if config.start is None else "as it began"
    own = f"{name}/" if name in (*rivals, began) else name  # a folder may be called pursuit
    policies: dict[str, PolicySpec] = {rival: rival for rival in rivals}
    if (folder.path / UNTRAINED).is_dir():
        policies[began] = folder.path / UNTRAINED
    policies[own] = folder.path
    comparison = compare(task, policies, episodes=TABLE_EPISODES, seed=TABLE_SEED, env_id=env_id)
    document = comparison.document(collect_versions())
    show(console_table(document))  # before it is written: a full disk must not cost the result
    draw_curve(folder, {rival: comparison.summaries[rival]["mean_error_m"].value for rival in rivals})
    write_text(folder.path / TABLE_FILE, markdown_table(document))
