"""Timing: both filters do the same work, and the ratio is that of things timed in turn."""

import time

import numpy as np
import pytest

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.eval.speed.filter_bank import TAG, FilterBank, ReferenceBank, readings
from tagtrack.eval.speed.timing import time_in_turn


def test_filter_bank_and_reference_come_to_the_same_belief():
    rows, particles, steps = 16, 2000, 64
    bank = FilterBank(Belief(particles=particles), rows)
    references = [ReferenceBank(particles) for _ in range(4)]
    for number, reference in enumerate(references):
        reference.filter.rng = np.random.default_rng(number)
        reference.filter.initialize(0.0, 0.0)
    for _ in range(steps):
        bank.step()
        for reference in references:
            reference.step()
    own = bank.filter.mean
    other = np.array([reference.filter.mean() for reference in references])
    # The reading gives no distance, so the belief is a long wedge: its bearing is sharp, its mean is not.
    bearing = np.arctan2(own[:, 1], own[:, 0]).mean()
    assert bearing == pytest.approx(np.arctan2(TAG[1], TAG[0]), abs=0.1)
    assert bearing == pytest.approx(np.arctan2(other[:, 1], other[:, 0]).mean(), abs=0.1)
    assert np.hypot(*own.T).mean() == pytest.approx(np.hypot(*other.T).mean(), rel=0.3)


def test_threads_do_not_change_the_filter_bank():
    one, two = FilterBank(Belief(particles=100), 5), FilterBank(Belief(particles=100), 5, threads=2)
    for _ in range(5):
        one.step()
        two.step()
    two.close()
    np.testing.assert_array_equal(one.filter.particles, two.filter.particles)


def test_readings_are_whole_units_from_astern_to_ahead():
    units = readings()
    assert all(unit == round(unit) for unit in units)
    # Eq. 5 gives -7.9 dead astern, and 7.49 at the 2.5 degrees off the bow that come nearest to dead ahead.
    assert (min(units), max(units)) == (-8, 7)


def test_ratio_is_that_of_the_rates():
    pace = time_in_turn(lambda: time.sleep(0.001), lambda: time.sleep(0.005), rounds=3, seconds=0.05)
    assert pace.ratio == pytest.approx(5, rel=0.5)
    assert pace.steps_per_s > pace.reference_steps_per_s
