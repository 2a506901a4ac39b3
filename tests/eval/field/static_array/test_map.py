"""MAP over the track and MAP-M over a window (Eqs. 7-11)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from tagtrack.eval.field.static_array.block_tridiagonal import diagonal_of_inverse, solve
from tagtrack.eval.field.static_array.map_track import maximum_a_posteriori, white_acceleration
from tagtrack.eval.field.static_array.map_window import map_marginal
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import Pings
from tests.eval.field.static_array.scene import EPOCH, SETTING, SQUARE, Floats, hear, rmse

# So far away that ranges are linear in the position: x = c (arrival_0 - arrival_2) / 2, known to c sigma / sqrt 2.
FAR_AWAY = 1e7 * np.array([(-1.0, 0.0), (0.0, -1.0), (1.0, 0.0), (0.0, 1.0)])


def swim(count: int, seed: int = 0) -> tuple[Floats, Floats]:
    """Times (count,) [s] 60 to 120 s apart, and positions (count, 2) [m] within 80 m of the centre, at some 0.1 m/s."""
    time = np.cumsum(np.random.default_rng(seed).uniform(60, 120, count))
    return time, 80.0 * np.stack([np.sin(time / 800), np.cos(time / 1100)], axis=1)


def kalman(pings: Pings, first: Floats) -> tuple[KalmanFilter, Floats, Floats, list[Floats], list[Floats]]:
    """The linear problem for filterpy, with states [x, y, vx, vy] as ours: means, covariances, and each step's F and Q."""
    measured = 0.5 * SETTING.sound_speed * (pings.arrival[:, :2] - pings.arrival[:, 2:])
    oracle = KalmanFilter(dim_x=4, dim_z=2)
    oracle.x, oracle.P = np.concatenate([first, [0, 0]]), np.diag([1e8, 1e8, 0.04, 0.04])
    oracle.H, oracle.R = np.eye(2, 4), 1.5**2 / 2 * np.eye(2)
    transition, precision = white_acceleration(np.diff(pings.time), SETTING.acceleration_sigma, 2)
    means, covariances = [], []
    for index, z in enumerate(measured):
        if index:
            oracle.predict(F=transition[index - 1], Q=np.linalg.inv(precision[index - 1]))
        oracle.update(z)
        means.append(oracle.x)
        covariances.append(oracle.P)
    moves = [*transition, transition[-1]]
    noises = [*np.linalg.inv(precision), np.linalg.inv(precision[-1])]
    return oracle, np.array(means), np.array(covariances), moves, noises


@pytest.fixture(scope="module")
def linear() -> Pings:
    time, truth = swim(40)
    return replace(hear(truth, FAR_AWAY, sigma=1e-3), time=time)


def test_white_acceleration_has_the_covariance_of_its_integrals():
    transition, precision = white_acceleration(np.array([60.0, 90.0]), 2e-3, 2)
    for index, dt in enumerate((60.0, 90.0)):
        np.testing.assert_array_equal(transition[index], [[1, 0, dt, 0], [0, 1, 0, dt], [0, 0, 1, 0], [0, 0, 0, 1]])
        expected = 4e-6 * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(2))
        np.testing.assert_allclose(np.linalg.inv(precision[index]), expected, rtol=1e-9, atol=1e-12)


def test_block_tridiagonal_solution_and_inverse_are_those_of_the_full_matrix():
    rng = np.random.default_rng(1)
    diagonal, above = rng.normal(size=(6, 3, 3)), rng.normal(size=(5, 3, 3))
    diagonal = diagonal + diagonal.swapaxes(1, 2) + 12 * np.eye(3)
    full = np.zeros((18, 18))
    for index in range(6):
        here = slice(3 * index, 3 * index + 3)
        full[here, here] = diagonal[index]
        if index < 5:
            after = slice(3 * index + 3, 3 * index + 6)
            full[here, after], full[after, here] = above[index], above[index].T
    right = rng.normal(size=(6, 3))
    np.testing.assert_allclose(solve(diagonal, above, right).ravel(), np.linalg.solve(full, right.ravel()), rtol=1e-9)
    blocks = [np.linalg.inv(full)[i : i + 3, i : i + 3] for i in range(0, 18, 3)]
    np.testing.assert_allclose(diagonal_of_inverse(diagonal, above), blocks, rtol=1e-9, atol=1e-12)


def test_map_of_a_linear_problem_is_the_rts_smoother(linear):
    found = maximum_a_posteriori(linear, FAR_AWAY, SETTING)
    oracle, means, covariances, moves, noises = kalman(linear, wls_ml(linear, FAR_AWAY, SETTING).position[0])
    # filterpy takes the step out of k from place k + 1.
    smooth, spread, _, _ = oracle.rts_smoother(means, covariances, Fs=[moves[0], *moves], Qs=[noises[0], *noises])
    np.testing.assert_allclose(found.position, smooth[:, :2], atol=5e-3)
    np.testing.assert_allclose(found.covariance, spread[:, :2, :2], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("window", [1, 4])
def test_map_m_of_a_linear_problem_is_the_kalman_filter_whatever_the_window(linear, window):
    found = map_marginal(linear, FAR_AWAY, SETTING, window=window)
    _, means, covariances, _, _ = kalman(linear, wls_ml(linear, FAR_AWAY, SETTING).position[0])
    np.testing.assert_allclose(found.position, means[:, :2], atol=5e-3)
    np.testing.assert_allclose(found.covariance, covariances[:, :2, :2], rtol=1e-3, atol=1e-4)


def test_map_m_with_the_whole_track_in_its_window_ends_where_map_does():
    time, truth = swim(25)
    pings = hear(truth, SQUARE, sigma=1e-3, time=EPOCH + time)
    whole, window = maximum_a_posteriori(pings, SQUARE, SETTING), map_marginal(pings, SQUARE, SETTING, window=25)
    np.testing.assert_allclose(window.position[-1], whole.position[-1], atol=1e-3)
    np.testing.assert_allclose(window.covariance[-1], whole.covariance[-1], rtol=1e-3)


@pytest.mark.parametrize("estimate", [maximum_a_posteriori, map_marginal])
def test_with_boundless_acceleration_each_ping_stands_alone(estimate):
    time, truth = swim(30)
    pings = hear(truth, SQUARE, sigma=1e-3, time=EPOCH + time)
    wild = replace(SETTING, acceleration_sigma=1e2, first_speed_sigma=1e4)
    alone = wls_ml(pings, SQUARE, SETTING)
    found = estimate(pings, SQUARE, wild)
    np.testing.assert_allclose(found.position, alone.position, atol=2e-3)
    np.testing.assert_allclose(found.covariance, alone.covariance, rtol=2e-3, atol=1e-3)


def test_map_beats_map_m_which_beats_a_ping_alone_and_covariances_are_honest():
    """200 positions of a smooth track: the errors of neighbours hang together, so only clear orders are asked for."""
    time, truth = swim(200, seed=3)
    pings = hear(truth, SQUARE, sigma=2e-3, time=EPOCH + time)
    setting = replace(SETTING, sigma=2e-3, acceleration_sigma=3e-3)
    smooth = maximum_a_posteriori(pings, SQUARE, setting)
    whole, window = rmse(smooth.position, truth), rmse(map_marginal(pings, SQUARE, setting).position, truth)
    alone = rmse(wls_ml(pings, SQUARE, setting).position, truth)
    assert whole < 0.9 * window < 0.9 * 0.95 * alone
    assert whole < 1.2 * np.sqrt(np.mean(np.trace(smooth.covariance, axis1=1, axis2=2)))


@pytest.mark.parametrize("estimate", [maximum_a_posteriori, map_marginal])
def test_two_arrivals_tell_a_difference_and_silence_only_that_time_went_by(estimate):
    time, truth = swim(20)
    pings = hear(truth, SQUARE, sigma=1e-3, time=EPOCH + time)
    spread = []
    for deaf in ([], [2, 3], [0, 1, 2, 3]):
        arrival = pings.arrival.copy()
        arrival[10, deaf] = np.nan
        found = estimate(Pings(time=pings.time, arrival=arrival), SQUARE, SETTING)
        assert np.linalg.norm(found.position[10] - truth[10]) < 4 * np.sqrt(np.trace(found.covariance[10]))
        spread.append(np.trace(found.covariance[10]))
    assert spread[0] < spread[1] < spread[2] < np.inf


@pytest.mark.parametrize(("estimate", "worst"), [(maximum_a_posteriori, 1.3), (map_marginal, 2.5)])
def test_robust_weights_spare_the_track_the_late_arrivals_of_four_receivers(estimate, worst):
    """5 % of arrivals late by 30 ms on average (45 m), after ten clean pings. One ping of four receivers cannot tell which
    arrival is late; its neighbours can, less so where they are all in the past."""
    time, truth = swim(80, seed=4)
    setting = replace(SETTING, acceleration_sigma=3e-3)
    pings = hear(truth, SQUARE, sigma=1e-3, time=EPOCH + time)
    clean = rmse(estimate(pings, SQUARE, setting).position, truth)
    rng = np.random.default_rng(5)
    pings.arrival[10:] += np.where(rng.random((70, 4)) < 0.05, rng.exponential(0.03, (70, 4)), 0.0)
    assert rmse(estimate(pings, SQUARE, setting).position, truth) > 4 * clean
    assert rmse(estimate(pings, SQUARE, setting, robust=True).position, truth) < worst * clean


def test_a_window_holds_at_least_one_ping():
    with pytest.raises(ValueError, match="window must be at least 1 ping, got 0"):
        map_marginal(hear(np.zeros((3, 2)), SQUARE), SQUARE, SETTING, window=0)
