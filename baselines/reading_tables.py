"""Tables for the ``information`` planner: how likely each reading is by bearing or by distance, and how far sound carries."""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.sensors import PresenceReceiver, RangeReceiver, StereoHydrophone, TimeOfFlightReceiver
from tagtrack.envs.sensors.bearing import LARGEST_UNIT, bearing_in_units
from tagtrack.envs.sim.acoustics import Water, hearing_chance

COSINE_BINS = 2048  # of the tables by bearing: at most 2.5 degrees, a quarter of the receiver's sigma, a bin


def tabulate_likelihood(belief: Belief, water: Water) -> np.ndarray:
    """(A, Z) float32 chance of each reading, as the filter scores it.

    A stereo hydrophone's readings are -9 to 9 units by the cosine of the bearing in A equal bins (Eqs. 5, 6); where it ranges,
    too, only the bearings count. The others' go by distance in whole metres: ranges in bins two sigmas wide (Eq. 21), or silence
    and detection (Eq. 22).
    """
    receiver = belief.receiver
    if isinstance(receiver, (StereoHydrophone, TimeOfFlightReceiver)):
        weight = belief.weight_floor + _bearing_density(receiver)
    elif isinstance(receiver, RangeReceiver):
        weight = _range_chance(receiver, _distances(water))
    else:
        heard = _presence_chance(receiver, _distances(water))
        weight = np.stack((1.0 - heard, heard), axis=1)
    return (weight / weight.sum(axis=1, keepdims=True)).astype(np.float32)


def _bearing_density(receiver: StereoHydrophone | TimeOfFlightReceiver) -> np.ndarray:
    cosine = (np.arange(COSINE_BINS) + 0.5) * (2.0 / COSINE_BINS) - 1.0
    expected = np.array([bearing_in_units.py_func(angle) for angle in np.arccos(cosine)])
    readings = np.arange(-LARGEST_UNIT, LARGEST_UNIT + 1.0)
    sigma = receiver.bearing_sigma
    return np.exp(-0.5 * ((readings - expected[:, None]) / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)


def _range_chance(receiver: RangeReceiver, distance: np.ndarray) -> np.ndarray:
    width = 2.0 * receiver.range_sigma
    edges = np.arange(math.ceil(receiver.range_factor * distance[-1] / width) + 2) * width
    below = normal_cdf((edges - receiver.range_factor * distance[:, None]) / receiver.range_sigma)
    return np.diff(below, axis=1)


def _presence_chance(receiver: PresenceReceiver, distance: np.ndarray) -> np.ndarray:
    return receiver.reception * normal_cdf((receiver.max_range - distance) / receiver.detection_sigma)


def normal_cdf(z: np.ndarray) -> np.ndarray:
    """Chance that a standard normal number lies below ``z``, exact far below the mean, too. Without scipy: vehicles lack it."""
    chance = np.where(z > 0.0, 1.0, 0.0)
    near = np.abs(z) < 15.0  # beyond, it is 0 or 1 to the last bit of a float32
    chance[near] = [0.5 * math.erfc(-value) for value in z[near] / math.sqrt(2.0)]
    return chance


def _distances(water: Water) -> np.ndarray:
    return np.arange(math.ceil(water.reach + 20.0 * water.edge_width)) + 0.5


def tabulate_chance(water: Water, belief: Belief) -> np.ndarray:
    """(R,) float32 chance that a ping tells something, by distance in whole metres, averaged over bursts of losses.

    A bearing needs both hydrophones, a range one; of a presence receiver silence tells as well, so that every ping does.
    """
    receiver = belief.receiver
    if isinstance(receiver, PresenceReceiver):
        return np.ones(1, np.float32)
    hydrophones = 2 if isinstance(receiver, (StereoHydrophone, TimeOfFlightReceiver)) else 1
    # As plain Python, which takes the dataclass where compiled code takes its record.
    clear, noisy = (
        np.array([hearing_chance.py_func(d, burst, water) for d in _distances(water)]) ** hydrophones for burst in (False, True)
    )
    return ((1.0 - water.noisy_share) * clear + water.noisy_share * noisy).astype(np.float32)
