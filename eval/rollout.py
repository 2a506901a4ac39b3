"""Roll-outs: policies over the same episodes. Episode e of seed s is the first episode of world s + e: the same fish for all.

The blocks of seeds of training, validation, tuning and benchmarks never meet: each use adds its own multiple of 2^32.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.metrics import EpisodeRecord
from tagtrack.policies.protocol import Policy

PolicyMaker = Callable[[Simulation], Policy]


class SeedBlock(enum.IntEnum):
    """What episodes are for; ``block_seed`` keeps them apart."""

    BENCHMARK = 0
    TUNING = 1
    VALIDATION = 2
    TRAINING = 3


def block_seed(block: SeedBlock, seed: int) -> int:
    """Seed of the first episode of a use. Raises ValueError unless 0 <= seed < 2^31."""
    if not 0 <= seed < 2**31:
        raise ValueError(f"seed must be from 0 to {2**31 - 1}, got {seed}")
    return int(block) * 2**32 + seed


@dataclass(frozen=True, kw_only=True)
class Trace:
    """What a roll-out keeps of E episodes of K steps, beside the record of errors."""

    record: EpisodeRecord
    estimate: np.ndarray  # (E, K, 2) what the filter reports [m]
    fish: np.ndarray  # (E, K, 2) true positions [m]
    vehicle: np.ndarray  # (E, K, 2) true positions [m]
    mean: np.ndarray  # (E, K, 2) mean of the particles [m]
    covariance: np.ndarray  # (E, K, 2, 2) of the particles [m^2]


def roll_out(
    task: Task,
    make_policy: PolicyMaker,
    *,
    episodes: int,
    seed: int,
    threads: int = 1,
    batch: int = 128,
    on_step: Callable[[int], None] | None = None,
) -> EpisodeRecord:
    """Run a policy (deterministic) over whole episodes and record localization error and range.

    Args:
        task: scenario and track; one vehicle and one tag. make_policy: is given the batch's ``Simulation``.
        episodes: E. seed: of episode 0. batch: worlds that run at once (results do not depend on it).
        on_step: called with the number of env steps done at each step, for progress bars.
    """
    record, _ = _run(task, make_policy, episodes, seed, threads, batch, on_step, traced=False)
    return record


def trace(
    task: Task,
    make_policy: PolicyMaker,
    *,
    episodes: int,
    seed: int,
    threads: int = 1,
    batch: int = 128,
    on_step: Callable[[int], None] | None = None,
) -> Trace:
    """As ``roll_out``, keeping paths and beliefs as well (64 bytes and more a step: for few episodes or for statistics)."""
    record, kept = _run(task, make_policy, episodes, seed, threads, batch, on_step, traced=True)
    return Trace(record=record, **kept)


def _run(
    task: Task,
    make_policy: PolicyMaker,
    episodes: int,
    seed: int,
    threads: int,
    batch: int,
    on_step: Callable[[int], None] | None,
    *,
    traced: bool,
) -> tuple[EpisodeRecord, dict[str, np.ndarray]]:
    if episodes < 1:
        raise ValueError(f"episodes must be at least 1, got {episodes}")
    steps = task.scenario.episode_steps
    error = np.empty((episodes, steps))
    distance = np.empty((episodes, steps))
    reward = np.empty((episodes, steps))
    shapes = {"estimate": (2,), "fish": (2,), "vehicle": (2,), "mean": (2,), "covariance": (2, 2)} if traced else {}
    kept = {name: np.empty((episodes, steps, *shape)) for name, shape in shapes.items()}
    for first in range(0, episodes, batch):
        rows = slice(first, min(first + batch, episodes))
        simulation = Simulation(task.scenario, rows.stop - first, threads=threads, tracks=task.tracks)
        observation = simulation.reset(seed + first)
        policy = make_policy(simulation)
        state, starts = None, np.ones(simulation.num_worlds, bool)
        for step in range(steps):
            actions, state = policy.predict(observation[:, 0], state, starts, deterministic=True)
            starts = np.zeros(simulation.num_worlds, bool)
            simulation.step(actions[:, np.newaxis])
            observation = simulation.observation
            error[rows, step] = simulation.error[:, 0, 0]
            distance[rows, step] = simulation.range[:, 0, 0]
            reward[rows, step] = simulation.reward[:, 0]
            if traced:
                kept["estimate"][rows, step] = simulation.estimate[:, 0, 0]
                kept["fish"][rows, step] = simulation.fish_position[:, 0]
                kept["vehicle"][rows, step] = simulation.vehicle_position[:, 0]
                kept["mean"][rows, step] = simulation.mean[:, 0, 0]
                kept["covariance"][rows, step] = simulation.covariance[:, 0, 0]
            if on_step is not None:
                on_step(simulation.num_worlds)
        simulation.close()
    return EpisodeRecord(error=error, range=distance, reward=reward), kept
