"""Tables for the ``information`` planner: how likely each reading is by place, as the sensor foresees it, and how far it is."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.sim.acoustics import Water, hearing_chance


class ReadingTables(NamedTuple):
    """Over places about a vehicle."""

    by_distance: bool  # rows of the likelihood go by the distance in whole metres, not by the cosine of the bearing
    likelihood: np.ndarray  # (A, Z) float32 chance of each reading
    chance: np.ndarray  # (R,) float32 chance that a ping tells something, by distance in whole metres


def tabulate_readings(belief: Belief, water: Water) -> ReadingTables:
    """What a planner may expect of a sensor, averaged over bursts of losses.

    Raises:
        ValueError: for a sensor that foresees nothing.
    """
    sensor = belief.receiver
    prospect = sensor.prospect(_distances(water), belief.weight_floor)
    if prospect is None:
        raise ValueError(f"a {type(sensor).__name__} does not say what it is expected to read (Sensor.prospect)")
    likelihood = prospect.likelihood / prospect.likelihood.sum(axis=1, keepdims=True)
    chance = np.ones(1) if prospect.silence_tells else _hearing(water, sensor.hydrophones)
    return ReadingTables(prospect.by_distance, likelihood.astype(np.float32), chance.astype(np.float32))


def _distances(water: Water) -> np.ndarray:
    return np.arange(math.ceil(water.reach + 20.0 * water.edge_width)) + 0.5


def _hearing(water: Water, hydrophones: int) -> np.ndarray:
    """Chance that all hydrophones hear a ping, by distance in whole metres."""
    # As plain Python, which takes the dataclass where compiled code takes its record.
    clear, noisy = (
        np.array([hearing_chance.py_func(d, burst, water) for d in _distances(water)]) ** hydrophones for burst in (False, True)
    )
    return (1.0 - water.noisy_share) * clear + water.noisy_share * noisy
