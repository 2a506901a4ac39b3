"""Figures by hand, intervals against scipy and against what they promise: to hold the truth 95 times in 100."""

import math

import numpy as np
import pytest
from scipy import stats

from tagtrack.eval.episode_record import EpisodeRecord
from tagtrack.eval.metrics import (
    Bootstrap,
    Interval,
    interquartile_mean,
    paired_ratio,
    pooled_quantile_replicates,
    ratios_to_first,
    summarize,
)

FIGURES = {
    "mean_error_m", "median_error_m", "rmse_m", "p95_error_m", "iqm_error_m",
    "lost_fraction", "mean_range_m", "inside_perimeter",
}  # fmt: skip


def lognormal_errors(rng, episodes, steps=20):
    """Errors with a factor of the episode and one of the step, like those of a fish that is hard to track."""
    return rng.lognormal(1.5, 0.5, (episodes, 1)) * rng.lognormal(0.0, 0.5, (episodes, steps))


def test_figures_of_four_steps_by_hand():
    record = EpisodeRecord(error=[[1.0, 3.0], [5.0, 7.0]], range=[[10.0, 20.0], [30.0, 60.0]])
    figures = summarize(record, perimeter=25.0, lost_error=4.0)
    assert set(figures) == FIGURES
    expected = {
        "mean_error_m": 4.0,
        "median_error_m": 4.0,
        "rmse_m": math.sqrt(21.0),  # (1 + 9 + 25 + 49) / 4
        "p95_error_m": 6.7,  # 0.95 * 3 = 2.85 steps into 1, 3, 5, 7
        "iqm_error_m": 4.0,  # too few episodes to drop a quarter
        "lost_fraction": 0.5,
        "mean_range_m": 30.0,
        "inside_perimeter": 0.5,
    }
    assert {name: figure.value for name, figure in figures.items()} == pytest.approx(expected)


def test_a_step_exactly_at_the_bound_is_neither_lost_nor_inside():
    figures = summarize(EpisodeRecord(error=[[4.0], [4.1]], range=[[25.0], [24.9]]), perimeter=25.0, lost_error=4.0)
    assert figures["lost_fraction"].value == 0.5
    assert figures["inside_perimeter"].value == 0.5


def test_interquartile_mean_drops_a_quarter_at_each_end():
    assert interquartile_mean(np.array([9.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1000.0])) == pytest.approx(4.5)


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


def test_interval_of_the_mean_is_scipys_percentile_bootstrap():
    values = np.random.default_rng(3).lognormal(size=40)
    ours = Bootstrap(resamples=20_000).mean(values)
    theirs = stats.bootstrap(
        (values,), np.mean, n_resamples=20_000, method="percentile", random_state=np.random.default_rng(4)
    ).confidence_interval
    # An end found from 20,000 replicates has a standard error of sqrt(0.025 * 0.975 / 20,000) / phi(1.96) = 0.019
    # standard errors of the mean; two independent ones differ by 0.027, and 4 of those are allowed.
    tolerance = 0.11 * values.std() / math.sqrt(values.size)
    assert ours.low == pytest.approx(theirs.low, abs=tolerance)
    assert ours.high == pytest.approx(theirs.high, abs=tolerance)


def test_intervals_hold_the_truth_in_about_95_of_100_experiments():
    rng = np.random.default_rng(5)
    truth = {
        "mean_error_m": math.exp(1.5 + 0.25),
        "median_error_m": math.exp(1.5),
        "rmse_m": math.exp(1.5 + 0.5),
        "p95_error_m": math.exp(1.5 + 1.6449 * math.sqrt(0.5)),
    }
    held = dict.fromkeys(truth, 0)
    experiments = 300
    for _ in range(experiments):
        figures = summarize(
            EpisodeRecord(error=lognormal_errors(rng, episodes=200)), bootstrap=Bootstrap(resamples=400)
        )
        for name, value in truth.items():
            held[name] += figures[name].low <= value <= figures[name].high
    # 300 experiments have a standard error of 1.3 %, and 4 of those are allowed. (Drawing single steps instead of
    # episodes would hold the median about half the time; 50 episodes as skewed as these hold the tail 89 % of it.)
    for name, count in held.items():
        assert abs(count / experiments - 0.95) < 0.052, name


def test_ratio_is_first_over_other_so_above_one_means_that_the_other_is_better():
    first, other = EpisodeRecord(error=[[6.0, 6.0], [2.0, 2.0]]), EpisodeRecord(error=[[3.0, 3.0], [1.0, 1.0]])
    # In every episode twice as far off: paired, there is nothing to be unsure about.
    assert paired_ratio(first, other) == Interval(value=2.0, low=2.0, high=2.0)


def test_paired_ratio_is_narrower_than_an_unpaired_one_and_holds_the_truth():
    rng = np.random.default_rng(6)
    error = lognormal_errors(rng, episodes=200)
    record = EpisodeRecord(error=1.25 * error * rng.lognormal(0.0, 0.1, (200, 1)))
    paired = paired_ratio(record, EpisodeRecord(error=error))
    unpaired = paired_ratio(record, EpisodeRecord(error=rng.permutation(error)))
    assert paired.low < 1.25 * math.exp(0.005) < paired.high
    assert paired.high - paired.low < 0.4 * (unpaired.high - unpaired.low)


def test_ratios_name_the_first_policy_over_each_other_one():
    records = {
        name: EpisodeRecord(error=[[level], [level]]) for name, level in (("three_step", 6.0), ("a", 3.0), ("b", 12.0))
    }
    ratios = ratios_to_first(records)
    assert {pair: ratio.value for pair, ratio in ratios.items()} == {"three_step/a": 2.0, "three_step/b": 0.5}


def test_ratio_refuses_records_of_different_length():
    with pytest.raises(ValueError, match="got 2 and 1"):
        paired_ratio(EpisodeRecord(error=[[1.0], [1.0]]), EpisodeRecord(error=[[1.0]]))


def test_steps_after_the_end_of_an_episode_count_nowhere():
    full = EpisodeRecord(error=[[1.0, 3.0], [8.0, np.nan]], range=[[5.0, 9.0], [7.0, np.nan]])
    figures = summarize(full, perimeter=8.0, lost_error=2.0)
    assert figures["mean_error_m"].value == 5.0  # (2 + 8) / 2: each episode weighs the same
    assert figures["median_error_m"].value == 3.0
    assert figures["lost_fraction"].value == 0.75
    assert figures["inside_perimeter"].value == 0.75
    assert all(math.isfinite(figure.low) for figure in figures.values())


@pytest.mark.parametrize(
    ("error", "distance", "message"),
    [
        ([1.0, 2.0], None, "shape"),
        ([[1.0, -2.0]], None, "-2.0 m"),
        ([[1.0, math.inf]], None, "inf m"),
        ([[1.0], [math.nan]], None, "episode 1 has no step"),
        ([[1.0, 2.0]], [[1.0]], r"shape \(1, 1\)"),
        ([[1.0, math.nan]], [[1.0, 2.0]], "episode 0, step 1"),  # a broken belief is not a missing step
    ],
)
def test_records_that_make_no_sense_are_refused(error, distance, message):
    with pytest.raises(ValueError, match=message):
        EpisodeRecord(error=error, range=distance)


def test_without_range_or_perimeter_their_figures_are_null():
    error = [[1.0, 2.0], [3.0, 4.0]]
    without_range = summarize(EpisodeRecord(error=error), perimeter=20.0)
    without_perimeter = summarize(EpisodeRecord(error=error, range=error))
    nothing = {"value": None, "low": None, "high": None}
    assert without_range["mean_range_m"].to_json() == nothing
    assert without_range["inside_perimeter"].to_json() == nothing
    assert without_perimeter["inside_perimeter"].to_json() == nothing
    assert without_perimeter["mean_range_m"].value == 2.5


def test_a_single_episode_has_figures_but_no_intervals():
    for figure in summarize(EpisodeRecord(error=[[1.0, 2.0]], range=[[1.0, 2.0]]), perimeter=1.5).values():
        assert math.isfinite(figure.value)
        assert math.isnan(figure.low) and math.isnan(figure.high)
    assert math.isnan(paired_ratio(EpisodeRecord(error=[[2.0]]), EpisodeRecord(error=[[1.0]])).low)


@pytest.mark.parametrize("parameters", [{"resamples": 0}, {"level": 1.0}])
def test_bootstrap_refuses_what_it_cannot_do(parameters):
    with pytest.raises(ValueError, match="got"):
        Bootstrap(**parameters)
