"""Variances that add up, degrees of freedom after Satterthwaite, and the p-value that an interval implies."""

import math

import numpy as np
import pytest
from scipy import stats

from tagtrack.eval.statistics.estimate import Estimate


def test_runs_alone_are_students_interval():
    values = np.array([0.9, 1.0, 1.05, 1.2, 1.1])
    centre = math.exp(np.log(values).mean())
    ours = Estimate(value=centre, below=0.0, above=0.0, relative=True).over_runs(values, fish=10**9).interval()
    low, high = stats.t.interval(0.95, 4, np.log(values).mean(), stats.sem(np.log(values)))
    assert (ours.low, ours.high) == pytest.approx((math.exp(low), math.exp(high)))


def test_satterthwaites_degrees_of_freedom_by_hand():
    """Variances 0.01 of fish (101 of them) and 0.02 / 2 of two runs: 0.02^2 / (0.01^2 / 1 + 0.01^2 / 100) = 3.96."""
    spread = 0.1  # two values 2 d apart have a variance of 2 d^2: d = 0.1
    estimate = Estimate(value=5.0, below=0.1, above=0.1, relative=False)
    both = estimate.over_runs([5.0 - spread, 5.0 + spread], fish=101)
    assert both.freedom == pytest.approx(400 / 101)
    assert both.below == both.above == pytest.approx(math.sqrt(0.02))


@pytest.mark.parametrize(("further", "own"), [(0.0, 0.02), (0.05, 0.015), (0.2, 0.0)])
def test_what_fish_add_to_the_difference_of_runs_is_taken_off(further, own):
    """Runs 0.2 apart have a variance of 0.02; 0.2 + 2 c and 0.2 - 2 c apart, in two draws of fish, one of 0.02 + 2 c^2."""
    draws = np.array([[4.9 - further, 4.9 + further], [5.1 + further, 5.1 - further]])
    both = Estimate(value=5.0, below=0.1, above=0.1, relative=False).over_runs([4.9, 5.1], fish=101, draws=draws)
    assert both.below == pytest.approx(math.sqrt(0.01 + own / 2))


def test_one_run_says_nothing_of_others():
    assert math.isnan(Estimate(value=1.0, below=0.1, above=0.1, relative=True).over_runs([1.0], fish=50).interval().low)


@pytest.mark.parametrize("value", [0.8, 1.3])
@pytest.mark.parametrize("freedom", [3.0, math.inf])
def test_p_value_is_one_minus_the_level_at_which_the_interval_reaches_one(value, freedom):
    estimate = Estimate(value=value, below=0.2, above=0.1, relative=True, freedom=freedom)
    interval = estimate.interval(1 - estimate.p_value())
    assert (interval.low if value > 1 else interval.high) == pytest.approx(1.0)


def test_p_value_without_doubt_or_without_a_standard_error():
    sure = Estimate(value=2.0, below=0.0, above=0.0, relative=True)
    assert sure.p_value() == 0.0 and Estimate(value=1.0, below=0.0, above=0.0, relative=True).p_value() == 1.0
    assert math.isnan(Estimate(value=2.0, below=math.nan, above=math.nan, relative=True).p_value())
