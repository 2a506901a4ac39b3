"""ML and WLS-ML (Eqs. 4-6), and their weights for outliers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from tagtrack.eval.field.static_array.bound import cramer_rao_bound, root_trace
from tagtrack.eval.field.static_array.likelihood import make_likelihood
from tagtrack.eval.field.static_array.maximum_likelihood import maximum_likelihood, wls_ml
from tagtrack.eval.field.static_array.model import Pings, arrival_information, full_pairs
from tagtrack.eval.field.static_array.robust import add_variance
from tests.eval.field.static_array.scene import EPOCH, SETTING, SPACE, SQUARE, deafen, hear, rmse

INSIDE = np.random.default_rng(5).uniform(-90, 90, (4000, 2))
EIGHT = 150.0 * np.stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)], axis=1)


@pytest.mark.parametrize("estimate", [maximum_likelihood, wls_ml])
def test_optimum_is_that_of_an_independent_minimizer(estimate):
    truth = np.random.default_rng(6).uniform(-120, 120, (12, 3))
    pings = deafen(hear(truth, SPACE, sigma=1e-3, time=0.0), [2])
    found = estimate(pings, SPACE, SETTING).position
    for row in range(12):
        one = make_likelihood(Pings(time=pings.time[[row]], arrival=pings.arrival[[row]]), SPACE, SETTING)
        oracle = minimize(lambda q, one=one: one.cost(q[None])[0], truth[row], method="Nelder-Mead", tol=1e-10)
        np.testing.assert_allclose(found[row], oracle.x, atol=1e-3)


def test_no_place_of_a_dense_grid_fits_better_than_ml():
    """Anywhere within 180 m of the centre, and within 3 m of a receiver, where the cost has a kink."""
    rng = np.random.default_rng(7)
    truth = np.concatenate([rng.uniform(-180, 180, (100, 2)), SQUARE[rng.integers(0, 4, 100)] + rng.normal(0, 3, (100, 2))])
    likelihood = make_likelihood(pings := hear(truth, SQUARE, sigma=1e-3), SQUARE, SETTING)
    grid = np.stack(np.meshgrid(*[np.arange(-300, 300, 6.0)] * 2), axis=-1).reshape(-1, 2)
    lowest = np.min([likelihood.cost(np.tile(place, (200, 1))) for place in grid], axis=0)
    worse = likelihood.cost(maximum_likelihood(pings, SQUARE, SETTING).position) > lowest
    assert worse.mean() < 0.02


@pytest.mark.parametrize("estimate", [maximum_likelihood, wls_ml])
def test_error_in_the_array_is_within_a_tenth_of_the_bound(estimate):
    """Paper's noise of 1 ms; 4000 draws know an rmse to 0.8 %, and its covariance is as large as its errors."""
    found = estimate(hear(INSIDE, SQUARE, sigma=1e-3), SQUARE, SETTING)
    bound = np.sqrt(np.mean(root_trace(cramer_rao_bound(INSIDE, SQUARE, SETTING)) ** 2))
    assert 0.97 < rmse(found.position, INSIDE) / bound < 1.1
    error = found.position - INSIDE
    squares = np.einsum("ka,kab,kb->k", error, np.linalg.inv(found.covariance), error)
    assert np.mean(squares) == pytest.approx(2.0, rel=0.1)


def test_one_start_is_caught_near_receivers_where_several_and_the_closed_form_are_not():
    """Lines 130-135: ML from one start gets caught near a receiver; started from WLS it does not."""
    pings = hear(INSIDE, SQUARE, sigma=1e-3)
    one, several, closed = (
        np.mean(np.linalg.norm(found.position - INSIDE, axis=1) > 15)
        for found in (
            maximum_likelihood(pings, SQUARE, SETTING, starts=1),
            maximum_likelihood(pings, SQUARE, SETTING),
            wls_ml(pings, SQUARE, SETTING),
        )
    )
    assert one > 10 * max(several, closed, 1 / len(INSIDE))
    with pytest.raises(ValueError, match="starts must be within 1 and 5, got 0"):
        maximum_likelihood(pings, SQUARE, SETTING, starts=0)


def test_ml_in_the_full_set_of_differences_equals_ml_in_arrivals():
    """With every receiver heard the two information matrices are in proportion (L = 4): the same minimum, half the error."""
    pings = hear(INSIDE[:50], SQUARE, sigma=1e-3)
    information = arrival_information(pings.heard, SETTING.sigma, full_pairs(4))
    arrivals, pairs = wls_ml(pings, SQUARE, SETTING), wls_ml(pings, SQUARE, SETTING, information=information)
    np.testing.assert_allclose(pairs.position, arrivals.position, atol=1e-4)
    np.testing.assert_allclose(pairs.covariance, arrivals.covariance / 4, rtol=1e-4)


@pytest.mark.parametrize("estimate", [maximum_likelihood, wls_ml])
def test_receivers_in_a_plane_give_a_place_or_its_mirror_image(estimate):
    flat = np.column_stack([EIGHT, np.zeros(8)])
    truth = np.array([[20.0, -30.0, 60.0], [-40.0, 10.0, -80.0]])
    found = estimate(hear(truth, flat, time=0.0), flat, SETTING).position
    np.testing.assert_allclose(np.abs(found), np.abs(truth), atol=1e-3)


@pytest.mark.parametrize("estimate", [maximum_likelihood, wls_ml])
def test_too_few_receivers_give_no_position_and_others_of_the_batch_keep_theirs(estimate):
    pings = hear(INSIDE[:4], SQUARE)
    pings.arrival[0] = np.nan
    pings.arrival[1, 1:] = np.nan
    pings.arrival[2, 2:] = np.nan
    found = estimate(pings, SQUARE, SETTING)
    assert np.isnan(found.position[:3]).all() and np.isnan(found.covariance[:3]).all()
    np.testing.assert_allclose(found.position[3], INSIDE[3], atol=0.01)


def test_a_plane_wave_has_no_position():
    """From one direction at the speed of sound: the best fit is infinitely far."""
    arrival = EPOCH + SQUARE @ np.array([[0.8], [0.6]]) / SETTING.sound_speed * 1.001
    assert np.isnan(wls_ml(Pings(time=np.full(1, EPOCH), arrival=arrival.T), SQUARE, SETTING).position).all()


def test_robust_weights_spare_the_position_a_late_arrival_among_eight_receivers():
    """One arrival of eight late by 20 ms (30 m). Without it the bound is about 1.2 m."""
    truth = np.random.default_rng(8).uniform(-80, 80, (500, 2))
    pings = hear(truth, EIGHT, sigma=1e-3)
    pings.arrival[np.arange(500), np.arange(500) % 8] += 0.02
    clean = rmse(wls_ml(hear(truth, EIGHT, sigma=1e-3), EIGHT, SETTING).position, truth)
    assert rmse(wls_ml(pings, EIGHT, SETTING).position, truth) > 6 * clean
    assert rmse(wls_ml(pings, EIGHT, SETTING, robust=True).position, truth) < 1.5 * clean


def test_added_variance_makes_the_information_that_of_arrivals_with_that_variance():
    variance = np.array([[0.0, 3e-6, 1.0, 0.0]])
    precision = 1 / (1e-6 + variance[0])
    expected = np.diag(precision) - np.outer(precision, precision) / precision.sum()
    found = add_variance(arrival_information(np.ones((1, 4)), 1e-3), variance)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-3)
