"""A filter run again, as often as one likes, over what a vehicle recorded (offline, Clark et al. 2013, section 7).

The vehicle's path and what it heard stay as they were recorded; only the particles are drawn anew in each trial.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.measurement import Status
from tagtrack.envs.tag import Tag

TOGETHER = 128  # trials that run side by side: of fewer, calls from Python cost more than particles do


@dataclass(frozen=True, kw_only=True)
class Recording:
    """One mission of one vehicle and one tag: K steps, and before them the state at the start."""

    measurement: np.ndarray  # (K + 1,) MEASUREMENT; that of the start is absent
    navigation: np.ndarray  # (K + 1,) NAVIGATION
    vehicle: np.ndarray  # (K + 1, 2) true positions of the vehicle [m]
    fish: np.ndarray  # (K + 1, 2) true positions of the tag [m]
    belief: np.ndarray  # (K + 1,) BELIEF; of the filter that ran on board
    error: np.ndarray  # (K + 1,) of that filter [m]
    time_step: float  # [s]
    tag: Tag

    @property
    def detected(self) -> np.ndarray:
        """(K + 1,) whether the tag was heard."""
        return self.measurement["status"] == int(Status.HEARD)

    @property
    def range(self) -> np.ndarray:
        """(K + 1,) true distance from vehicle to tag [m]."""
        return np.hypot(*(self.fish - self.vehicle).T)


def refilter(
    recording: Recording,
    belief: Belief,
    trials: int,
    *,
    seed: int = 0,
    threads: int = 1,
    on_step: Callable[[int], None] | None = None,
) -> np.ndarray:
    """Localization error of a filter over a recording, in independent trials.

    Args:
        belief: the filter. trials: R. seed: of all of them; trial r draws the same particles whatever R is.
        threads: trials are split among so many; results do not depend on it.
        on_step: called with the number of filter steps just done.
    Returns:
        (R, K) distance from the estimate to the true fish [m].
    """
    steps = recording.measurement.size - 1
    start = recording.navigation[0]
    error = np.empty((trials, steps))
    for first in range(0, trials, TOGETHER * threads):
        rows = slice(first, min(first + TOGETHER * threads, trials))
        count = rows.stop - rows.start
        particle_filter = ParticleFilter(belief, recording.tag, rows=count, threads=min(threads, count))
        # The trial is the episode of its random numbers, from 1 on.
        particle_filter.begin(start["x"], start["y"], seed=np.full(count, seed), episode=1 + np.arange(rows.start, rows.stop))
        for k in range(steps):
            particle_filter.predict(recording.time_step)
            particle_filter.correct(recording.measurement[k + 1 : k + 2])
            miss = particle_filter.estimate - recording.fish[k + 1]
            error[rows, k] = np.hypot(miss[:, 0], miss[:, 1])
        particle_filter.close()
        if on_step is not None:
            on_step(count * steps)
    return error
