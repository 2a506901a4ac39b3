"""Figures by hand, intervals against scipy and against what they promise: to hold the truth 95 times in 100."""

import math

import numpy as np
import pytest

from tagtrack.eval.episode_record import EpisodeRecord
from tagtrack.eval.metrics import compare_runs, measure, paired_ratio, summarize, summarize_runs
from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.estimate import Interval

FIGURES = {
    "mean_error_m", "median_error_m", "rmse_m", "p95_error_m", "trimmed_mean_error_m",
    "error_if_not_lost_m", "lost_fraction", "mean_range_m", "inside_perimeter",
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
        "trimmed_mean_error_m": 4.0,  # too few episodes to drop a quarter
        "error_if_not_lost_m": 2.0,  # 1 and 3
        "lost_fraction": 0.5,
        "mean_range_m": 30.0,
        "inside_perimeter": 0.5,
    }
    assert {name: figure.value for name, figure in figures.items()} == pytest.approx(expected)


def test_a_step_exactly_at_the_bound_is_neither_lost_nor_inside():
    figures = summarize(EpisodeRecord(error=[[4.0], [4.1]], range=[[25.0], [24.9]]), perimeter=25.0, lost_error=4.0)
    assert figures["lost_fraction"].value == 0.5
    assert figures["inside_perimeter"].value == 0.5


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


def of_means(*means):
    """A record of one step an episode."""
    return EpisodeRecord(error=np.array(means, float)[:, None])


def test_comparison_of_runs_by_hand():
    first, runs = of_means(2, 4, 6), [of_means(1, 4, 8), of_means(3, 2, 4)]
    found = compare_runs([first], runs, Bootstrap(resamples=50))
    assert found["ratio"].value == pytest.approx(12 / 11)  # means 4 and 11/3
    assert found["median_ratio"].value == pytest.approx(1.0)  # of 2/2, 4/3, 6/6
    assert found["better"].value == pytest.approx((1 + 0.5 + 0 + 0 + 1 + 1) / 6)
    assert 0 < found["p"] < 1


def test_runs_of_a_training_widen_what_one_of_them_claims():
    rng = np.random.default_rng(7)
    error = lognormal_errors(rng, episodes=400)
    runs = [EpisodeRecord(error=factor * error) for factor in (0.9, 1.0, 1.1)]
    alone, together = summarize(runs[1]), summarize_runs(runs)
    assert together["mean_error_m"].value == pytest.approx(alone["mean_error_m"].value)
    # t of two degrees of freedom, 4.3, times 0.1 / sqrt(3), relative, or a little less
    assert 1.15 < together["mean_error_m"].high / together["mean_error_m"].value < 1.35
    against = compare_runs([runs[1]], runs, Bootstrap())
    assert against["ratio"].low < 0.85 and against["ratio"].high > 1.15
    assert paired_ratio(runs[1], runs[2]).low == pytest.approx(1 / 1.1)  # one run against another: no doubt at all


def test_share_of_lost_time_that_nobody_saw_is_not_zero_for_certain():
    figure = summarize(of_means(*np.ones(512)))["lost_fraction"]
    assert (figure.value, figure.low) == (0.0, 0.0) and figure.high == pytest.approx(0.00718, abs=1e-5)  # 1 - 0.025^(1/512)


def test_metrics_of_a_users_own_have_intervals_too():
    record = EpisodeRecord(error=[[1.0, 3.0], [5.0, 7.0]])
    assert summarize(record, metrics={"last_m": lambda record: record.error[:, -1]})["last_m"].value == 5.0


def test_metric_that_fails_is_named():
    with pytest.raises(ValueError, match="the metric 'odd' failed on a record of errors .2, 1.: AttributeError"):
        measure("odd", lambda record: record.speed, of_means(1, 2))


@pytest.mark.parametrize("wrong", [lambda record: 1.0, lambda record: record.error, lambda record: ["a", "b"]])
def test_metric_of_another_shape_is_named(wrong):
    with pytest.raises(ValueError, match=r"the metric 'odd' must give one number for each episode, shape \(2,\), got"):
        measure("odd", wrong, of_means(1, 2))
