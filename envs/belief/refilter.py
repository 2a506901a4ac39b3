"""A filter run again, as often as one likes, over what a vehicle recorded (offline, Clark et al. 2013, section 7).

The vehicle's path and what it heard stay as they were recorded; only the particles are drawn anew in each trial.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.belief.filter import (
    BELIEF,
    Belief,
    Scratch,
    filter_rule,
    make_scratch,
    spread_particles,
)
from tagtrack.envs.belief.summary import summarize
from tagtrack.envs.belief.update import update_belief
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.workers import Workers


@dataclass(frozen=True, kw_only=True)
class Recording:
    """One mission of one vehicle and one tag: K steps, and before them the state at the start."""

    vehicle: np.ndarray  # (K + 1,) VEHICLE
    contact: np.ndarray  # (K + 1,) CONTACT; what was heard at each step
    fish: np.ndarray  # (K + 1, 2) true positions of the tag [m]
    belief: np.ndarray  # (K + 1,) BELIEF; of the filter that ran on board
    time_step: float  # [s]


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
    error = np.empty((trials, recording.fish.shape[0] - 1))
    rule = to_record(filter_rule(belief, recording.time_step))

    def run(first: int, last: int, scratch: Scratch) -> None:
        particles = np.zeros((belief.rows, belief.particles), np.float32)
        mission = (recording.vehicle, recording.contact, recording.fish, recording.time_step)
        for trial in range(first, last):
            refilter_once(np.uint64(seed), trial, *mission, rule, particles, np.zeros(1, BELIEF), scratch, error[trial])
            if on_step is not None:
                on_step(error.shape[1])

    workers = Workers(trials, threads, lambda: make_scratch(belief.particles))
    workers.run(run)
    workers.close()
    return error


@compiled
def refilter_once(seed, trial, vehicle, contact, fish, time_step, parameters, particles, beliefs, scratch, error):
    """One trial, as ``envs/world.py`` updates a belief; the trial is the episode of its random numbers, from 1 on."""
    rule = parameters[0]
    belief = beliefs[0]
    low, high, episode = seed & np.uint64(0xFFFFFFFF), seed >> np.uint64(32), np.uint64(trial + 1)
    start = vehicle[0]
    stream = (low, high, episode, np.uint64(0))
    spread_particles(particles, belief, start.believed_x, start.believed_y, stream, 0, rule, scratch)
    for k in range(1, vehicle.shape[0]):
        stream = (low, high, episode, np.uint64(k))
        update_belief(particles, belief, vehicle[k : k + 1], contact[k : k + 1], stream, 0, rule, time_step, scratch)
        summarize(particles, belief, vehicle[k], rule)
        miss_x = belief.estimate_x - fish[k, 0]
        miss_y = belief.estimate_y - fish[k, 1]
        error[k - 1] = np.sqrt(miss_x * miss_x + miss_y * miss_y)
