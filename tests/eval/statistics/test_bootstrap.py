"""The bootstrap against scipy and by hand."""

import math

import numpy as np
import pytest
from scipy import stats

from tagtrack.eval.statistics.bootstrap import Bootstrap, interquartile_mean, pooled_quantile_replicates


@pytest.mark.parametrize("episodes", [1, 3, 4, 7, 50])
def test_interquartile_mean_of_each_resample_is_scipys_trimmed_mean(episodes):
    values = np.random.default_rng(episodes).lognormal(size=episodes)
    counts = Bootstrap(resamples=40).counts(episodes)
    resampled = [np.repeat(values, row.astype(int)) for row in counts]
    assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25))
    assert interquartile_mean(values, counts) == pytest.approx([stats.trim_mean(sample, 0.25) for sample in resampled])


@pytest.mark.parametrize(("episodes", "steps"), [(1, 1), (2, 3), (9, 1), (6, 40)])
def test_pooled_quantiles_of_each_resample_are_numpys_quantiles_of_its_steps(episodes, steps):
    rng = np.random.default_rng(episodes)
    error = rng.integers(0, 12, (episodes, steps)).astype(float)  # whole numbers: many ties
    error[episodes // 2, steps // 2 + 1 :] = np.nan
    counts = Bootstrap(resamples=60).counts(episodes)
    probabilities = (0.0, 0.5, 0.95, 1.0)
    pooled = [np.repeat(error, row.astype(int), axis=0) for row in counts]
    expected = np.array([np.nanquantile(steps_drawn, probabilities) for steps_drawn in pooled]).T
    np.testing.assert_allclose(pooled_quantile_replicates(error, counts, probabilities), expected)


def test_bootstrap_draws_as_many_episodes_as_there_are_and_the_same_ones_each_time():
    counts = Bootstrap(resamples=100).counts(37)
    assert (counts.sum(axis=1) == 37).all()
    np.testing.assert_array_equal(counts, Bootstrap(resamples=100).counts(37))
    assert (counts != Bootstrap(resamples=100, seed=1).counts(37)).any()


def test_interval_of_values_that_may_be_negative_is_scipys_percentile_bootstrap():
    values = np.random.default_rng(3).normal(0.0, 1.0, size=40)
    ours = Bootstrap(resamples=20_000).mean(values)
    theirs = stats.bootstrap(
        (values,), np.mean, n_resamples=20_000, method="percentile", random_state=np.random.default_rng(4)
    ).confidence_interval
    # An end found from 20,000 replicates has a standard error of sqrt(0.025 * 0.975 / 20,000) / phi(1.96) = 0.019
    # standard errors of the mean; two independent ones differ by 0.027, and 4 of those are allowed.
    tolerance = 0.11 * values.std() / math.sqrt(values.size)
    assert ours.low == pytest.approx(theirs.low, abs=tolerance)
    assert ours.high == pytest.approx(theirs.high, abs=tolerance)


@pytest.mark.parametrize("parameters", [{"resamples": 0}, {"level": 1.0}])
def test_bootstrap_refuses_what_it_cannot_do(parameters):
    with pytest.raises(ValueError, match="got"):
        Bootstrap(**parameters)
def test_interquartile_mean_drops_a_quarter_at_each_end():
    assert interquartile_mean(np.array([9.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1000.0])) == pytest.approx(4.5)


def test_mean_of_positive_values_is_studentized_on_the_logarithm():
    """Draw by draw, as the definition has it (Efron and Tibshirani 1993, 12.5)."""
    values = np.random.default_rng(4).lognormal(size=30)
    bootstrap = Bootstrap(resamples=300)
    mean, error = values.mean(), values.std() / values.mean() / math.sqrt(30)
    t = []
    for row in bootstrap.counts(30).astype(int):
        drawn = np.repeat(values, row)
        t.append(math.log(drawn.mean() / mean) / (drawn.std() / drawn.mean() / math.sqrt(30)))
    low, high = np.quantile(t, (0.025, 0.975))
    ours = bootstrap.mean(values)
    assert (ours.low, ours.high) == pytest.approx((mean * math.exp(-high * error), mean * math.exp(-low * error)))


def test_ratio_is_studentized_by_what_each_pair_adds():
    rng = np.random.default_rng(5)
    below = rng.lognormal(size=25)
    above = below * rng.lognormal(0.3, 0.2, size=25)
    bootstrap = Bootstrap(resamples=200)
    t = []
    for row in bootstrap.counts(25).astype(int):
        a, b = np.repeat(above, row), np.repeat(below, row)
        error = (a / a.mean() - b / b.mean()).std() / 5
        t.append(math.log(a.mean() / b.mean() / (above.mean() / below.mean())) / error)
    high = np.quantile(t, 0.975)
    error = (above / above.mean() - below / below.mean()).std() / 5
    ours = bootstrap.interval(bootstrap.ratio_estimate(above, below))
    assert ours.low == pytest.approx(above.mean() / below.mean() * math.exp(-high * error))
