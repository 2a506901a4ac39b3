"""The first episodes of a benchmark as logs of missions, for ``tagtrack live replay``."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.contestants import each_run
from tagtrack.eval.rollout import Contestant, Localizer, PolicyMaker, SeedBlock, block_seed
from tagtrack.live.recording import MISSION_FILE, Recorder

Makers = Mapping[str, Contestant | dict[str, Contestant]]


def write_logs(out: Path, makers: Makers, task: Task, *, episodes: int, seed: int, asked: Mapping[str, Any]) -> None:
    """The first episodes of each policy, a folder each, in one that lies beside ``out``.

    Args:
        asked: options of the task (``TaskOptions.make_options``), of which the log tells preset and overrides.
    """
    logs = logs_of(out)
    shutil.rmtree(logs, ignore_errors=True)
    for name, maker in each_run(makers).items():
        if isinstance(maker, Localizer):
            continue
        for episode in range(episodes):
            folder, first = logs / f"{log_name(name)}-{episode}", block_seed(SeedBlock.BENCHMARK, seed)
            record_episode(
                folder, task, maker, seed=first + episode, preset=asked["preset"], overrides=asked["overrides"] or {}
            )


def logs_of(out: Path) -> Path:
    """Where the logs of a benchmark lie: beside its folder."""
    return out.with_name(f"{out.name}-logs")


def log_name(policy: str) -> str:
    """A policy's name as that of a folder."""
    return policy.replace(":", "-").replace("/", "-")


def require_logs(out: Path, makers: Makers) -> None:
    """Refuse, before any work is done, logs that cannot be written, or that somebody else wrote."""
    logs = logs_of(out)
    names = [log_name(name) for name, maker in each_run(makers).items() if not isinstance(maker, Localizer)]
    if not names:
        raise ValueError("--record writes missions of vehicles, and none of --policies steers one; leave it out")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"--record would write two policies to {logs / twice}-0; rename a folder")
    if logs.exists() and not (logs.is_dir() and all((entry / MISSION_FILE).is_file() for entry in logs.iterdir())):
        raise ValueError(f"{logs} holds something else than logs of missions; choose another --out")


def record_episode(folder: Path, task: Task, maker: PolicyMaker, *, seed: int, preset: str | None, overrides: Any) -> None:
    """Write one episode of a policy as the log of a mission."""
    simulation = Simulation(task.scenario, tracks=task.tracks)
    policy, memory = maker(simulation), None
    observation = simulation.reset(seed)
    recorder = Recorder(simulation)
    recorder.note()
    for step in range(task.scenario.episode_steps):
        action, memory = policy.predict(observation[:, 0], memory, np.array([step == 0]), deterministic=True)
        simulation.step(action[:, None])
        recorder.note()
    recorder.write(folder, env_id=task.env_id, seed=seed, preset=preset, overrides=overrides)
