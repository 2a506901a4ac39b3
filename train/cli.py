"""`tagtrack train`: parse, make or reopen the run's folder, train, and compare the policy with the paper's controller."""

from __future__ import annotations

import dataclasses
import sys
from typing import TYPE_CHECKING

import tyro

from tagtrack.command import tagtrack_here
from tagtrack.train.config import TrainConfig, changed_fields, flatten, from_json, merge_texts

if TYPE_CHECKING:
    from tagtrack.envs.task import Task
    from tagtrack.train.settings import Settings

WITH_RESUME = ("resume", "steps", "threads", "device", "trust")  # flags that a resumed run heeds; the rest is in its config.json


def main(arguments: list[str] | None = None) -> int:
    """Exit status: 0 when trained, 130 after Ctrl-C (what was saved stays), 2 for a mistake on the command line or in a file."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        return run(parse(arguments))
    except KeyboardInterrupt:
        print("\nbroken off; what was saved stays", file=sys.stderr)
        return 130
    except MemoryError:
        print("error: there is not enough memory; lower --num-envs or --particles", file=sys.stderr)
        return 2
    except (ValueError, OSError, ImportError) as error:
        print(f"error: {' '.join(str(error).split()) or type(error).__name__}", file=sys.stderr)
        return 2


def parse(arguments: list[str]) -> TrainConfig:
    """The command line over the defaults, or over the file that --config names."""
    config: TrainConfig = tyro.cli(TrainConfig, args=arguments, prog=f"{tagtrack_here()} train")
    if config.config is None or config.resume is not None:
        return config
    file = from_json(config.config)
    default = dataclasses.replace(file, config=config.config, out=None, resume=None, set=(), hyper=())
    config = tyro.cli(TrainConfig, args=arguments, default=default, prog=f"{tagtrack_here()} train")
    return dataclasses.replace(config, set=merge_texts(file.set, config.set), hyper=merge_texts(file.hyper, config.hyper))


def run(config: TrainConfig) -> int:
    """One training run, new or resumed."""
    return begin(config) if config.resume is None else go_on(config)


def begin(config: TrainConfig) -> int:
    """A new run. What cannot be run is refused before a folder is made."""
    from tagtrack.envs.task import full_id
    from tagtrack.train.run_folder import RunFolder
    from tagtrack.train.session import train
    from tagtrack.train.settings import with_own_start

    if config.trust:
        raise ValueError("--trust goes with --resume: a new run loads no checkpoint")
    config = with_own_start(config)
    task, settings = check(config)
    name = f"{full_id(config.env).rpartition('/')[2]}-{config.algo}-seed{config.seed}"
    with RunFolder.create(config.out, name) as folder:
        return train(config, settings, task, folder, checkpoint=None)


def go_on(config: TrainConfig) -> int:
    """A run from its last checkpoint, or from its beginning; of a finished one only the table, if it is missing."""
    from tagtrack.train.checkpoint import has_checkpoint, load_checkpoint
    from tagtrack.train.run_folder import CONFIG_FILE, TABLE_FILE, RunFolder
    from tagtrack.train.session import finish, train

    assert config.resume is not None
    with RunFolder.open(config.resume) as folder:
        config = resumed_config(config, from_json(folder.path / CONFIG_FILE))
        checkpoint = load_checkpoint(folder.path) if has_checkpoint(folder.path) else None
        if names_modules(config) and not config.trust:
            if checkpoint is None:
                raise ValueError(f"{folder.path} imports modules of its own before it begins; if you know them, add --trust")
            checkpoint.require_trust()
        task, settings = check(config)
        if checkpoint is None:  # cut off before its first one
            return train(config, settings, task, folder, checkpoint=None)
        steps = checkpoint.progress.steps
        if steps < settings.steps:
            if not config.trust:
                checkpoint.require_trust()
            return train(config, settings, task, folder, checkpoint)
        print(f"{folder.path} is finished: {steps:,} of {settings.steps:,} steps; --steps with a larger number trains it on")
        if (folder.path / TABLE_FILE).is_file():
            print(f"its table: {folder.path / TABLE_FILE}")
        else:
            finish(config, task, folder)
        return 0


def resumed_config(given: TrainConfig, saved: TrainConfig) -> TrainConfig:
    """The run's own config with the few flags that may change. Raises ValueError for any other flag."""
    if changed := changed_fields(given, WITH_RESUME):
        flag = "--" + changed[0].replace("_", "-")
        raise ValueError(f"{flag} cannot change in a resumed run; drop it, or train anew")
    steps = saved.steps if given.steps is None else given.steps
    return dataclasses.replace(
        saved, steps=steps, threads=given.threads, device=given.device, resume=given.resume, trust=given.trust
    )


def names_modules(config: TrainConfig) -> bool:
    """Whether a run imports modules by their names, as MODULE:CLASS."""
    return any(":" in text for text in (config.env, config.motion or "", config.modem or "", *flatten(config.set)))


def check(config: TrainConfig) -> tuple[Task, Settings]:
    """Task and hyper-parameters of a run that can be run. Raises ValueError or OSError with one line on what cannot."""
    from tagtrack.envs.task import build_task, parse_overrides
    from tagtrack.eval.rollout import SeedBlock, run_seed
    from tagtrack.train.memory import require_size
    from tagtrack.train.settings import find_settings, fit_to_steps

    find_settings(config)  # what is wrong with them is said before anything is read
    task = build_task(
        config.env,
        preset=config.preset,
        particles=config.particles,
        tracks=config.tracks,
        time_scale=config.time_scale,
        overrides=parse_overrides(flatten(config.set), config.motion),
        vehicles=config.vehicles,
        tags=config.tags,
        modem=config.modem,
    )
    settings = fit_to_steps(find_settings(config, task.scenario), keep_worlds=config.num_envs is not None)
    require_size(task.scenario, settings)
    if config.threads < 1:
        raise ValueError(f"--threads must be at least 1, got {config.threads}")
    run_seed(SeedBlock.TRAINING, config.seed)
    check_device(config.device)
    return task, settings


def check_device(device: str) -> None:
    """Raise ValueError where torch has no such device."""
    import torch

    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ValueError(f"--device {device} cannot be used here ({reason}); cpu always can") from None
