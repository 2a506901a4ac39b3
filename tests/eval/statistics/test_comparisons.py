"""Many looks: Holm by hand and by what it promises; one figure over tasks."""

import math

import numpy as np
import pytest

from tagtrack.eval.statistics.comparisons import estimate_of, geometric_mean, holm, wins
from tagtrack.eval.statistics.estimate import Estimate


def test_holm_by_hand():
    np.testing.assert_allclose(holm([0.01, 0.04, math.nan, 0.02]), [0.03, 0.04, math.nan, 0.04])  # 3 x 0.01, 1 x, -, 2 x 0.02
    assert holm([0.6, 0.9]).tolist() == [1.0, 1.0] and holm([]).size == 0


def test_holm_errs_in_5_of_100_families_of_five():
    p = np.random.default_rng(1).random((4000, 5))
    erring = np.mean([(holm(row) < 0.05).any() for row in p])
    assert erring == pytest.approx(1 - 0.99**5, abs=4 * math.sqrt(0.05 / 4000))


def test_a_tie_is_half_a_win():
    assert wins(np.array([2.0, 2.0, 2.0]), np.array([1.0, 2.0, 3.0])).tolist() == [1.0, 0.5, 0.0]


def test_figure_over_tasks_is_the_geometric_mean_and_narrower():
    each = [Estimate(value=value, below=0.1, above=0.2, relative=True) for value in (1.0, 1.21)]
    both = geometric_mean(each)
    assert both.value == pytest.approx(1.1)
    assert (both.below, both.above) == pytest.approx((0.1 / math.sqrt(2), 0.2 / math.sqrt(2)))
    few = geometric_mean([Estimate(value=1.0, below=0.1, above=0.1, relative=True, freedom=4.0)] * 2)
    assert few.freedom == pytest.approx(8.0)  # equal variances: the degrees add up


def test_what_a_file_holds_gives_the_estimate_back():
    estimate = Estimate(value=1.2, below=0.03, above=0.05, relative=True, freedom=6.5)
    interval = estimate.interval()
    back = estimate_of(interval.value, interval.low, interval.high, 6.5)
    assert (back.below, back.above) == pytest.approx((0.03, 0.05))


@pytest.mark.parametrize("estimates", [[], [Estimate(value=0.0, below=0.1, above=0.1, relative=False)]])
def test_a_mean_over_no_task_or_of_no_ratio_is_refused(estimates):
    with pytest.raises(ValueError, match="task|positive"):
        geometric_mean(estimates)
