"""What moored receivers reach on the same fish: four of them on a square as a contestant of benchmarks, beside the policies.

They locate each ping by WLS-ML (Masmitja et al. 2020), in the horizontal plane, and hold that position until the next. Left out
is what the field adds: pings that are missed, echoes, clocks that drift, receivers that are not where they are thought to be.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tagtrack.envs.task import Task
from tagtrack.eval.episode_record import EpisodeRecord
from tagtrack.eval.episodes import Episodes
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions
from tagtrack.eval.field.static_array.registry import locate
from tagtrack.eval.rollout import Trace, watch_fish

NAME = "static_array"
NOISE = 4  # keeps the arrivals' noise apart from other random numbers of an episode


@dataclass(frozen=True, kw_only=True)
class StaticArray:
    """Four receivers on a square about the origin, where vehicles start: neither knows where the fish begins."""

    note: ClassVar[str] = (
        f"{NAME} is no policy: four moored receivers about the origin (a square of 200 m, or of the side named) that hear every "
        "ping, each arrival with an error of 1 ms, and locate it by WLS-ML."
    )
    baseline: float = 200.0  # side of the square [m]
    setting: ArraySetting = field(default_factory=ArraySetting)  # 1500 m/s, arrivals known to 1 ms

    def __post_init__(self) -> None:
        if not (math.isfinite(self.baseline) and self.baseline > 0):
            raise ValueError(f"baseline must be positive, got {self.baseline} m")

    @property
    def receivers(self) -> Floats:
        """(4, 2) [m]."""
        return 0.5 * self.baseline * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])

    def trace(self, task: Task, episodes: Episodes) -> Trace:
        """Estimates of the fish that policies meet in these episodes, as ``rollout.trace`` gives theirs.

        Before its first ping a fish is taken to be in the middle, with a NaN covariance. There is no vehicle: its path is NaN,
        and the record has neither range nor reward.
        """
        truth = watch_fish(task, episodes)
        estimate = np.empty_like(truth.fish)
        covariance = np.empty((*truth.fish.shape, 2))
        for episode, (fish, pinged) in enumerate(zip(truth.fish, truth.pinged, strict=True)):
            found = self.hear(fish, np.random.default_rng((episodes.seed + episode, NOISE)), pinged, task.scenario.time_step)
            estimate[episode], covariance[episode] = hold(found, pinged)
        return Trace(
            record=EpisodeRecord(error=np.linalg.norm(estimate - truth.fish, axis=-1)),
            estimate=estimate,
            fish=truth.fish,
            vehicle=np.full_like(truth.fish, np.nan),
            mean=estimate,
            covariance=covariance,
        )

    def hear(self, fish: Floats, generator: np.random.Generator, pinged: np.ndarray, time_step: float) -> Positions:
        """Positions of the pings of one episode: ``fish`` (K, 2) [m] and ``pinged`` (K,) at every step."""
        noise = self.setting.sigma * generator.standard_normal((len(fish), len(self.receivers)))
        distance = np.linalg.norm(fish[:, None] - self.receivers, axis=-1)
        time = time_step * np.arange(1.0, len(fish) + 1.0)
        arrival = time[:, None] + distance / self.setting.sound_speed + noise
        return locate("wls_ml", Pings(time=time[pinged], arrival=arrival[pinged]), self.receivers, self.setting)


def hold(found: Positions, pinged: np.ndarray) -> tuple[Floats, Floats]:
    """Position (K, 2) and covariance (K, 2, 2) at every step of the last ping that could be located, ``pinged`` being (K,)."""
    located = np.isfinite(found.position).all(axis=1)
    position = np.concatenate([np.zeros((1, 2)), found.position[located]])
    covariance = np.concatenate([np.full((1, 2, 2), np.nan), found.covariance[located]])
    fresh = np.zeros(len(pinged), np.intp)
    fresh[np.flatnonzero(pinged)[located]] = 1
    last = np.cumsum(fresh)
    return position[last], covariance[last]


def is_static_array(spec: str) -> bool:
    """Whether a name of a command line, as ``static_array:200``, is one."""
    return spec.partition(":")[0] == NAME


def read_static_array(spec: str) -> StaticArray:
    """The array that ``static_array`` or ``static_array:BASELINE`` names. Raises ValueError for a baseline out of range."""
    _, colon, text = spec.partition(":")
    if not colon:
        return StaticArray()
    try:
        baseline = float(text)
    except ValueError:
        raise ValueError(f"{spec}: baseline must be a number of metres, got {text!r}") from None
    try:
        return StaticArray(baseline=baseline)
    except ValueError as error:
        raise ValueError(f"{spec}: {error}") from None
