"""`python -m train`: parse, make or reopen the run's folder, train, and compare the policy with the paper's controller."""

from __future__ import annotations

import dataclasses
import os
import sys
import time
from pathlib import Path
from typing import Any

import tyro

from tagtrack.train.config import TrainConfig, find_settings, from_json, qualified_id, to_json

WITH_RESUME = ("resume", "steps", "threads", "device")  # flags that a resumed run heeds; the rest is in its config.json


def main(arguments: list[str] | None = None) -> int:
    """Exit status: 0 when trained, 130 after Ctrl-C (all is saved), 2 for a mistake on the command line or in a file."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        return run(parse(arguments))
    except (ValueError, OSError, ImportError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def parse(arguments: list[str]) -> TrainConfig:
    """The command line over the defaults, or over the file that --config names."""
    config: TrainConfig = tyro.cli(TrainConfig, args=arguments, prog="python -m train")
    if config.config is None:
        return config
    default = dataclasses.replace(from_json(config.config), config=config.config, out=None, resume=None)
    return tyro.cli(TrainConfig, args=arguments, default=default, prog="python -m train")


def run(config: TrainConfig) -> int:
    """One training run, new or resumed."""
    from tagtrack.eval.rollout import SeedBlock, block_seed
    from tagtrack.train.run_folder import RunFolder

    if config.resume is not None:
        folder = RunFolder.open(config.resume)
        config = resumed_config(config, from_json(folder.path / "config.json"))
        return train(config, folder, resume=True)
    env_id = qualified_id(config.env)
    find_settings(config)
    build_task_of(config)  # refuse what cannot be run before a folder is made
    check_device(config.device)
    block_seed(SeedBlock.TRAINING, config.seed)  # refuse a seed out of range
    folder = RunFolder.create(config.out, f"{env_id.split('/')[1]}-{config.algo}-seed{config.seed}")
    return train(config, folder, resume=False)


def resumed_config(given: TrainConfig, saved: TrainConfig) -> TrainConfig:
    """The run's own config with the few flags that may change. Raises ValueError for any other flag."""
    plain = TrainConfig()
    for field in dataclasses.fields(TrainConfig):
        if field.name not in WITH_RESUME and getattr(given, field.name) != getattr(plain, field.name):
            flag = "--" + field.name.replace("_", "-")
            raise ValueError(f"{flag} cannot change in a resumed run; drop it, or train anew")
    steps = saved.steps if given.steps is None else given.steps
    return dataclasses.replace(saved, steps=steps, threads=given.threads, device=given.device, resume=given.resume)


def build_task_of(config: TrainConfig) -> Any:
    from tagtrack.envs.task import build_task, parse_overrides

    return build_task(
        qualified_id(config.env),
        preset=config.preset,
        particles=config.particles,
        tracks=config.tracks,
        time_scale=config.time_scale,
        overrides=parse_overrides(config.set, config.motion),
    )


def check_device(device: str) -> None:
    """Raise ValueError where torch has no such device."""
    import torch

    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ValueError(f"--device {device} cannot be used here ({reason}); cpu always can") from None


def train(config: TrainConfig, folder: Any, *, resume: bool) -> int:
    """Train in a folder, with table, curve and path at the end."""
    import torch

    from tagtrack.envs.overrides import describe_scenario
    from tagtrack.envs.task import parse_overrides
    from tagtrack.eval.rollout import SeedBlock, block_seed
    from tagtrack.eval.versions import collect_versions
    from tagtrack.train.learning import Training, build_model, learn, load_model, make_logger
    from tagtrack.train.vec_env import TagTrackVecEnv

    torch.set_num_threads(1)  # a second thread costs more than it gives on networks this small
    env_id, settings, task = qualified_id(config.env), find_settings(config), build_task_of(config)
    training_seed = block_seed(SeedBlock.TRAINING, config.seed * 4096 % 2**31)
    path, state = folder.load_state() if resume else (None, {})
    env = TagTrackVecEnv(
        env_id,
        settings.num_envs,
        threads=config.threads,
        stagger=True,
        preset=config.preset,
        particles=config.particles,
        tracks=config.tracks,
        time_scale=config.time_scale,
        overrides=parse_overrides(config.set, config.motion),
    )
    if resume:
        model = load_model(settings, path, env, config.device)
        training_seed += 2**31 + model.num_timesteps  # new episodes: those of the first part are spent
    else:
        model = build_model(settings, env, config.seed, config.device)
        folder.write_json(
            "config.json",
            {
                **to_json(dataclasses.replace(config, out=folder.path)),
                "settings": dataclasses.asdict(settings),
                "scenario": describe_scenario(task.scenario),
                "replayed": task.describe_tracks(),
            },
        )
        folder.write_json("versions.json", collect_versions())
    env.seed(training_seed)  # after the model, which seeds its environment with its own seed
    model.set_logger(make_logger(folder))
    training = Training(
        folder, task, env_id, total=settings.steps, seed=config.seed, episodes=settings.validation_episodes, state=state
    )
    started = time.perf_counter()
    finished = learn(model, training)
    env.close()
    draw_curve(folder)
    if not finished:
        print(f"stopped at {model.num_timesteps:,} of {settings.steps:,} steps; go on with\n    {_command(folder.path)}")
        return 130
    print(f"trained {model.num_timesteps:,} steps in {time.perf_counter() - started:.0f} s")
    print_comparison(folder, task, env_id)
    print(f"run: {folder.path}\nmore: python -m eval benchmark {_task_options(config)} --policies three_step {folder.path}")
    return 0


def _task_options(config: TrainConfig) -> str:
    """The options of `python -m eval` that name the task of a run."""
    given = {name: getattr(config, name) for name in ("preset", "tracks", "time_scale", "motion")}
    options = [f"--env {qualified_id(config.env)}"]
    options += [f"--{name.replace('_', '-')} {value}" for name, value in given.items() if value is not None]
    return " ".join([*options, *(["--set", *config.set] if config.set else [])])


def _command(path: Path) -> str:
    return f"python -m train --resume {os.path.relpath(path)}"


def draw_curve(folder: Any) -> None:
    """learning_curve.png from progress.csv."""
    from tagtrack.eval.plots import plot_learning_curve, save_figure

    rows = folder.read_progress()
    if rows:
        steps = [float(row["steps"]) for row in rows]
        errors = [float(row["validation_error_m"]) for row in rows]
        save_figure(folder.path / "learning_curve.png", plot_learning_curve({folder.path.name: (steps, errors)}, {}))


def print_comparison(folder: Any, task: Any, env_id: str) -> None:
    """A small table: the policy that was kept beside the paper's controller and pursuit, on episodes it was not chosen on."""
    from rich.console import Console

    from tagtrack.eval import collect_versions, compare
    from tagtrack.eval.report import console_table

    policies = ["three_step", "pursuit", str(folder.path)]
    comparison = compare(task, policies, episodes=256, seed=1_000_000, env_id=env_id)
    Console().print(console_table(comparison.document(collect_versions())))
