"""An interval is a claim: it must hold the truth in 93 to 97 of 100 experiments. Here are the experiments.

In the suite they are few, with a tolerance of four standard errors; the slow ones are enough to tell 93 from 95 (of 1,200
experiments the standard error is 0.6 %).
"""

import math

import numpy as np
import pytest

from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.clusters import cluster_windows

FEW, MANY = 120, 1200


def settings(*values):
    """The first setting a few times in the suite, all of them many times in the slow tests."""
    return [(FEW, *values[0]), *(pytest.param(MANY, *each, marks=pytest.mark.slow) for each in values)]


def check(held, experiments):
    share = held / experiments
    if experiments == MANY:
        assert 0.93 <= share <= 0.97, share
    assert abs(share - 0.95) < 0.02 + 4 * math.sqrt(0.95 * 0.05 / experiments), share


@pytest.mark.parametrize(
    ("experiments", "effect", "episodes"),
    settings((0.02, 512), (0.0, 512), (0.04, 512), (0.0, 2048), (0.02, 2048), (0.04, 2048)),
)
def test_ratio_over_five_runs_holds_the_truth(experiments, effect, episodes):
    """Runs differ by a factor of their own, fish by one that all runs meet, and each pair by one more."""
    rng = np.random.default_rng(int(1000 * effect) + episodes)
    held = 0
    for seed in range(experiments):
        fish = rng.lognormal(1.5, 0.5, episodes)
        first = 1.2 * fish * rng.lognormal(0.0, 0.3, episodes)
        runs = fish * np.exp(effect * rng.standard_normal((5, 1))) * rng.lognormal(0.0, 0.3, (5, episodes))
        ratios = first.mean() / runs.mean(axis=1)
        bootstrap = Bootstrap(resamples=400, seed=seed)
        of_fish = bootstrap.ratio_estimate(first, runs.mean(axis=0))
        interval = of_fish.over_runs(ratios, episodes, bootstrap.draws_of_mean(runs)).interval()
        held += interval.low <= 1.2 <= interval.high
    check(held, experiments)


@pytest.mark.parametrize(("experiments", "episodes"), settings((512,), (2048,)))
def test_mean_with_one_episode_in_a_hundred_lost_holds_the_truth(experiments, episodes):
    rng = np.random.default_rng(episodes)
    truth = 0.99 * 5.0 + 0.01 * 170.0
    held = percentiles = 0
    for seed in range(experiments):
        error = 5.0 * rng.lognormal(-0.125, 0.5, episodes)
        lost = rng.random(episodes) < 0.01
        error[lost] = rng.uniform(40.0, 300.0, lost.sum())
        bootstrap = Bootstrap(resamples=800, seed=seed)
        interval = bootstrap.mean(error)
        held += interval.low <= truth <= interval.high
        low, high = np.quantile(bootstrap.draws_of_mean(error), (0.025, 0.975))
        percentiles += low <= truth <= high
    check(held, experiments)
    assert percentiles < held
    if (experiments, episodes) == (MANY, 512):
        assert percentiles / experiments < 0.925  # plain percentiles are too narrow


def swim(rng, windows, episodes, steps=40):
    """Mean errors (E,) of episodes along one recorded track, whose stretches of 5 steps are each as hard as chance has it."""
    hard = np.repeat(rng.lognormal(0.0, 0.6, windows * steps // 5), 5)
    start = rng.integers(len(hard) - steps, size=episodes)
    summed = np.concatenate([[0.0], np.cumsum(hard)])
    error = (summed[start + steps] - summed[start]) / steps * rng.lognormal(-0.045, 0.3, episodes)
    return error, cluster_windows(start[:, None], np.array([len(hard) - 1]), steps, animals=1)


@pytest.mark.parametrize(("experiments", "windows"), settings((12,), (48,)))
def test_mean_over_recorded_tracks_holds_that_of_other_tracks(experiments, windows):
    rng = np.random.default_rng(windows)
    truth = math.exp(0.18)
    held = naive = 0
    for seed in range(experiments):
        error, clusters = swim(rng, windows, episodes=512)
        interval = Bootstrap(resamples=400, seed=seed, clusters=clusters).mean(error)
        held += interval.low <= truth <= interval.high
        alone = Bootstrap(resamples=400, seed=seed).mean(error)
        naive += alone.low <= truth <= alone.high
    check(held, experiments)
    assert naive / experiments < 0.8  # as if each episode told something new


def test_tracks_of_fewer_than_ten_episodes_have_no_interval():
    error, clusters = swim(np.random.default_rng(0), 6, episodes=512)
    assert not clusters.suffices and math.isnan(Bootstrap(clusters=clusters).mean(error).low)


def test_episodes_far_apart_need_no_widening():
    """One window in each of forty stretches: clusters share nothing."""
    last = 100 * np.arange(1, 41) - 1
    clusters = cluster_windows(np.repeat(last - 99, 3)[:, None], last, 99, animals=40)
    assert (clusters.count, clusters.widening) == (40, 1.0)
    assert clusters.windows == pytest.approx(40 * 100 / 99)
