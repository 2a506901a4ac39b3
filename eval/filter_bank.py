"""The compiled filter alone, and the readable reference doing the same: predict, weigh by a reading, resample, summarize.

Both watch a tag at rest from a vehicle that turns on the spot. The row loop is the one of ``envs/world.py`` without the world.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from tagtrack.envs.belief.filter import (
    BELIEF,
    Belief,
    correct,
    filter_rule,
    make_scratch,
    predict,
    spread_particles,
)
from tagtrack.envs.belief.summary import summarize
from tagtrack.envs.belief.weighing import begin_weights, weigh
from tagtrack.envs.kernels.compiling import FAST_MATHS
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.sim.acoustics import CONTACT
from tagtrack.envs.sim.readings import bearing_in_units
from tagtrack.envs.sim.vehicle import VEHICLE
from tagtrack.envs.workers import Workers
from tagtrack.eval.reference_filter import ReferenceFilter, ReferenceFilterParameters

TIME_STEP = 1.0  # [s]
TAG = 30.0, 40.0  # where the tag rests [m]; the vehicle is at the origin
DISTANCE = math.hypot(*TAG)
HEADINGS = np.linspace(-math.pi, math.pi, 64, endpoint=False)  # one after the other [rad]


# Not cached: numba would look at this file alone, and go on with old code when a kernel in envs/ has changed.
@numba.njit(nogil=True, fastmath=FAST_MATHS, error_model="numpy")
def spread_rows(parameters, particles, beliefs, scratch):
    for b in range(beliefs.shape[0]):
        stream = (np.uint64(b), np.uint64(0), np.uint64(0), np.uint64(0))
        spread_particles(particles[b], beliefs[b], 0.0, 0.0, stream, 0, parameters[0], scratch)


@numba.njit(nogil=True, fastmath=FAST_MATHS, error_model="numpy")
def update_rows(first, last, step, heading, units, parameters, particles, beliefs, vehicles, contacts, scratch):
    rule = parameters[0]
    for b in range(first, last):
        stream = (np.uint64(b), np.uint64(0), np.uint64(0), np.uint64(step))
        vehicles[b].compass = heading
        contacts[b].units = units
        contacts[b].detected = True
        contacts[b].slant_range = DISTANCE
        contacts[b].previous_range = DISTANCE
        predict(particles[b], beliefs[b], stream, 0, rule, TIME_STEP, scratch)
        begin_weights(scratch)
        weigh(particles[b], vehicles[b], contacts[b], rule, scratch)
        correct(particles[b], beliefs[b], stream, 0, rule, scratch)
        summarize(particles[b], beliefs[b], vehicles[b], rule)


def readings() -> list[float]:
    """Rounded Lotek units of the tag at each of ``HEADINGS``."""
    line = math.atan2(TAG[1], TAG[0])
    bearings = [math.remainder(line - heading, 2.0 * math.pi) for heading in HEADINGS.tolist()]
    return [float(round(bearing_in_units.py_func(bearing))) for bearing in bearings]


class FilterBank:
    """B beliefs, updated together at each ``step``.

    Args:
        belief: of all of them. rows: B. threads: the rows are split among so many.
    """

    def __init__(self, belief: Belief, rows: int, threads: int = 1) -> None:
        self.particles = np.zeros((rows, belief.rows, belief.particles), np.float32)
        self.beliefs = np.zeros(rows, BELIEF)
        self._vehicles = np.zeros(rows, VEHICLE)
        self._contacts = np.zeros(rows, CONTACT)
        self._parameters = to_record(filter_rule(belief, TIME_STEP))
        self._workers = Workers(rows, threads, lambda: make_scratch(belief.particles))
        self._given = list(zip(HEADINGS.tolist(), readings(), strict=True))
        self._steps = 0
        spread_rows(self._parameters, self.particles, self.beliefs, self._workers.scratch[0])

    def step(self) -> None:
        """One prediction, correction and summary of every belief."""
        self._steps += 1
        given = (self._steps, *self._given[self._steps % len(self._given)], self._parameters, self.particles)
        self._workers.run(update_rows, *given, self.beliefs, self._vehicles, self._contacts)

    def close(self) -> None:
        """End the threads."""
        self._workers.close()


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
