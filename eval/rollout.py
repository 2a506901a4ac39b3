"""Roll-outs: policies over the same episodes. Episode e of seed s is the first episode of world s + e: the same fish for all.

The blocks of seeds of training, validation, tuning and benchmarks never meet: each use adds its own multiple of 2^32.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from tagtrack.envs.motions.replay import START_ROW, Replay, find_stretches, make_table
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.cells.cell import Cell, Done
from tagtrack.eval.episode_record import EpisodeRecord, join
from tagtrack.eval.episodes import Episodes
from tagtrack.eval.statistics.clusters import Clusters, cluster_windows
from tagtrack.eval.step_log import EpisodeLog
from tagtrack.policies.protocol import Policy

PolicyMaker = Callable[[Simulation], Policy]
Key = TypeVar("Key", bound=Hashable)


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


EPISODES_OF_A_RUN = 4096


def run_seed(block: SeedBlock, seed: int) -> int:
    """Seed of the first episode of a use by a training run, so that runs of neighbouring seeds share none of 4096 episodes.

    Seeds that differ by a multiple of 2^19 share theirs. Raises ValueError unless 0 <= seed < 2^31.
    """
    block_seed(block, seed)
    return block_seed(block, seed * EPISODES_OF_A_RUN % 2**31)


@dataclass(frozen=True, kw_only=True)
class Trace:
    """What a roll-out keeps of E episodes of K steps, beside the record of errors.

    Of a fleet with O beliefs, V vehicles and T tags the axes O, T (estimate, mean, covariance), T (fish) or V (vehicle) follow K.
    """

    record: EpisodeRecord
    estimate: np.ndarray  # (E, K, 2) what the filter reports [m]
    fish: np.ndarray  # (E, K, 2) true positions [m]
    vehicle: np.ndarray  # (E, K, 2) true positions [m]
    mean: np.ndarray  # (E, K, 2) mean of the particles [m]
    covariance: np.ndarray  # (E, K, 2, 2) of the particles [m^2]


@runtime_checkable
class Localizer(Protocol):
    """What tells where the fish of an episode is without steering a vehicle."""

    def trace(self, task: Task, episodes: Episodes) -> Trace: ...


Contestant = PolicyMaker | Localizer


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What the fish do in E episodes of K steps, whoever tracks them."""

    fish: np.ndarray  # (E, K, 2) positions [m]
    pinged: np.ndarray  # (E, K) whether the tag pinged within the step


def roll_out(
    task: Task,
    contestant: Contestant,
    *,
    episodes: int,
    seed: int,
    threads: int = 1,
    batch: int = 128,
    on_step: Callable[[int], None] | None = None,
) -> EpisodeRecord:
    """Run a policy (deterministic) over whole episodes and record localization error and range.

    Args:
        task: scenario and tracks.
        contestant: makes a policy, given the batch's ``Simulation``; or a ``Localizer``, whose record has no range.
        episodes: E. seed: of episode 0. batch: worlds that run at once (results do not depend on it).
        on_step: called with the number of env steps done at each step, for progress bars.
    """
    chosen = Episodes(count=episodes, seed=seed, threads=threads, batch=batch, on_step=on_step)
    if isinstance(contestant, Localizer):
        return contestant.trace(task, chosen).record
    return _run(task, contestant, chosen, traced=False).record()


def cells_of(
    name: str, task: Task, contestant: Contestant, *, episodes: int, seed: int, threads: int = 1, batch: int = 128
) -> list[Cell]:
    """``roll_out`` cut into its batches, whose records ``episode_record.join`` joins."""
    return [
        Cell(
            name=name,
            function=_roll_out_batch,
            arguments=(task, contestant, min(batch, episodes - first), seed + first, threads),
            units=min(batch, episodes - first) * task.scenario.episode_steps,
        )
        for first in range(0, episodes, batch)
    ]


def _roll_out_batch(
    task: Task, contestant: Contestant, episodes: int, seed: int, threads: int, *, tell: Callable[[int], None]
) -> EpisodeRecord:
    return roll_out(task, contestant, episodes=episodes, seed=seed, threads=threads, batch=episodes, on_step=tell)


def join_parts(cells: Mapping[Key, Sequence[Cell]], done: Sequence[Done]) -> dict[Key, EpisodeRecord]:
    """Whole records from what an engine made of the cells that ``cells_of`` gave for several contestants, one after the other."""
    each = iter(done)
    return {key: join([next(each).value for _ in parts]) for key, parts in cells.items()}


def trace(
    task: Task,
    contestant: Contestant,
    *,
    episodes: int,
    seed: int,
    threads: int = 1,
    batch: int = 128,
    on_step: Callable[[int], None] | None = None,
) -> Trace:
    """As ``roll_out``, keeping paths and beliefs as well (64 bytes and more a step: for few episodes or for statistics)."""
    chosen = Episodes(count=episodes, seed=seed, threads=threads, batch=batch, on_step=on_step)
    if isinstance(contestant, Localizer):
        return contestant.trace(task, chosen)
    log = _run(task, contestant, chosen, traced=True)
    return Trace(record=log.record(), **log.kept)


def watch_fish(task: Task, episodes: Episodes) -> Truth:
    """The same fish and pings that ``roll_out`` shows a policy: they depend on the episode alone, not on vehicle or belief."""
    steps = task.scenario.episode_steps
    fish = np.empty((episodes.count, steps, 2))
    pinged = np.empty((episodes.count, steps), bool)
    for rows, simulation in episodes.begin(_without_belief(task)):
        idle = np.zeros((simulation.num_worlds, 1, len(simulation.action_names)), np.float32)
        last_ping = simulation.worlds.targets["last_ping"][:, 0].copy()
        for step in range(steps):
            simulation.step(idle)
            fish[rows, step] = simulation.fish_position[:, 0]
            pinged[rows, step] = simulation.worlds.targets["last_ping"][:, 0] != last_ping
            last_ping = simulation.worlds.targets["last_ping"][:, 0].copy()
            episodes.tell(simulation.num_worlds)
    return Truth(fish=fish, pinged=pinged)


def cluster_episodes(task: Task, episodes: Episodes) -> Clusters | None:
    """Which episodes swim the same stretch of a recorded track; None where fish do not replay any."""
    if task.tracks is None or not isinstance(task.scenario.fish, Replay):
        return None
    scenario = task.scenario
    start = np.empty((episodes.count, scenario.targets), np.int64)
    for rows, simulation in episodes.begin(_without_belief(task)):
        start[rows] = simulation.worlds.targets["memory"][..., START_ROW]
    last = make_table(task.tracks, task.scenario.fish, scenario.time_step, scenario.episode_steps).last
    stretches = find_stretches(task.tracks, task.scenario.fish, scenario.time_step, scenario.episode_steps)
    return cluster_windows(start, last, scenario.episode_steps, animals=len({stretch.tag for stretch in stretches}))


def _without_belief(task: Task) -> Task:
    """With one particle, for those who do not look at the belief."""
    return task._replace(scenario=with_overrides(task.scenario, {"belief.particles": 1}))


def _run(task: Task, make_policy: PolicyMaker, episodes: Episodes, *, traced: bool) -> EpisodeLog:
    fleet = task.scenario.vehicles
    log = EpisodeLog(task.scenario, episodes.count, traced=traced)
    for rows, simulation in episodes.begin(task):
        worlds, components = simulation.num_worlds, len(simulation.action_names)
        policy = make_policy(simulation)
        state, starts = None, np.ones(worlds * fleet, bool)
        for step in range(task.scenario.episode_steps):
            observation = simulation.observation.reshape(worlds * fleet, -1)
            actions, state = policy.predict(observation, state, starts, deterministic=True)
            starts = np.zeros(worlds * fleet, bool)
            if np.shape(actions) != (worlds * fleet, components):
                raise ValueError(f"a policy must give actions {(worlds * fleet, components)}, got {np.shape(actions)}")
            simulation.step(np.reshape(actions, (worlds, fleet, components)))
            log.note(rows, step, simulation)
            episodes.tell(worlds)
    return log
