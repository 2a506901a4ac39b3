"""The compiled filter alone, and the readable reference doing the same: predict, weigh by a reading, resample, summarize.

Both watch a tag at rest from a vehicle that turns on the spot.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.measurement import measurement
from tagtrack.envs.sensors.bearing import bearing_in_units
from tagtrack.envs.tag import Tag
from tagtrack.eval.speed.reference_filter import ReferenceFilter, ReferenceFilterParameters

TIME_STEP = 1.0  # [s]
TAG = 30.0, 40.0  # where the tag rests [m]; the vehicle is at the origin
DISTANCE = math.hypot(*TAG)
HEADINGS = np.linspace(-math.pi, math.pi, 64, endpoint=False)  # one after the other [rad]


def readings() -> list[float]:
    """Rounded Lotek units of the tag at each of ``HEADINGS``."""
    line = math.atan2(TAG[1], TAG[0])
    bearings = [math.remainder(line - heading, 2.0 * math.pi) for heading in HEADINGS.tolist()]
    return [float(round(bearing_in_units.py_func(bearing))) for bearing in bearings]


def reading_of(belief: Belief, units: float) -> list[float]:
    """What the belief's sensor reads of the tag: its readings are units, ranges, or none."""
    known = {"units": units, "slant_range": DISTANCE}
    return [known.get(name, math.nan) for name in belief.receiver.readings]


class FilterBank:
    """B beliefs, updated together at each ``step``.

    Args:
        belief: of all of them. rows: B. threads: the rows are split among so many.
    """

    def __init__(self, belief: Belief, rows: int, threads: int = 1) -> None:
        self.filter = ParticleFilter(belief, Tag(period=TIME_STEP), rows=rows, threads=threads)
        self._given = [
            measurement(time=0.0, x=0.0, y=0.0, heading=heading, readings=reading_of(belief, units))
            for heading, units in zip(HEADINGS.tolist(), readings(), strict=True)
        ]
        self._steps = 0
        self.filter.begin(0.0, 0.0)

    def step(self) -> None:
        """One prediction, correction and summary of every belief."""
        self._steps += 1
        given = self._given[self._steps % len(self._given)]
        given["time"] = self._steps * TIME_STEP
        self.filter.predict(TIME_STEP)
        self.filter.correct(given)
        self.filter.summary  # noqa: B018 - it is computed when asked for

    def close(self) -> None:
        """End the threads."""
        self.filter.close()


class ReferenceBank:
    """One reference filter that does the same."""

    def __init__(self, particles: int) -> None:
        self.filter = ReferenceFilter(ReferenceFilterParameters(particles=particles), np.random.default_rng(0))
        self._given = list(zip(HEADINGS.tolist(), readings(), strict=True))
        self._steps = 0

    def step(self) -> None:
        """One prediction, correction and summary."""
        self._steps += 1
        heading, units = self._given[self._steps % len(self._given)]
        self.filter.predict()
        self.filter.correct(0.0, 0.0, heading, bearing_units=units)
        self.filter.mean()
        self.filter.covariance()
