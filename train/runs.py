"""A training run, new or gone on with: what cannot be run is refused before a folder is made or changed."""

from __future__ import annotations

import dataclasses

import torch

from tagtrack.envs.task import Task, build_task, full_id, parse_overrides
from tagtrack.eval.rollout import SeedBlock, run_seed
from tagtrack.train.checkpoint import has_checkpoint, load_checkpoint
from tagtrack.train.config import TrainConfig, changed_fields, flatten, from_json
from tagtrack.train.memory import require_size
from tagtrack.train.run_folder import CONFIG_FILE, TABLE_FILE, RunFolder
from tagtrack.train.session import finish, train
from tagtrack.train.settings import Settings, find_settings, fit_to_steps, with_own_start
from tagtrack.train.training import Tell

WITH_RESUME = ("resume", "steps", "threads", "device", "trust")  # flags that a resumed run heeds; the rest is in its config.json


def run(config: TrainConfig, tell: Tell | None = None) -> int:
    """One run; ``tell`` hears of its steps instead of a progress bar. Returns the exit status."""
    return begin(config, tell) if config.resume is None else go_on(config, tell)


def begin(config: TrainConfig, tell: Tell | None = None) -> int:
    """A new run. What cannot be run is refused before a folder is made."""
    if config.trust:
        raise ValueError("--trust goes with --resume: a new run loads no checkpoint")
    config = with_own_start(config)
    task, settings = check(config)
    name = f"{full_id(config.env).rpartition('/')[2]}-{config.algo}-seed{config.seed}"
    with RunFolder.create(config.out, name) as folder:
        return train(config, settings, task, folder, checkpoint=None, tell=tell)


def go_on(config: TrainConfig, tell: Tell | None = None) -> int:
    """A run from its last checkpoint, or from its beginning; of a finished one only the table, if it is missing."""
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
            return train(config, settings, task, folder, checkpoint=None, tell=tell)
        steps = checkpoint.progress.steps
        if steps < settings.steps:
            if not config.trust:
                checkpoint.require_trust()
            return train(config, settings, task, folder, checkpoint, tell)
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
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ValueError(f"--device {device} cannot be used here ({reason}); cpu always can") from None
