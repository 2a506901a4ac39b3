"""Weighted least squares (Eqs. 12-13)."""

from __future__ import annotations

import numpy as np
import pytest

from tagtrack.eval.field.static_array.bound import cramer_rao_bound, root_trace
from tagtrack.eval.field.static_array.closed_form import weighted_least_squares
from tagtrack.eval.field.static_array.model import Pings, arrival_information
from tests.eval.field.static_array.scene import EPOCH, SETTING, SPACE, SQUARE, deafen, hear, rmse

IN_THE_PLANE = np.random.default_rng(1).uniform(-180, 180, (200, 2))
IN_SPACE = np.random.default_rng(2).uniform(-120, 120, (200, 3))


@pytest.mark.parametrize(("receivers", "truth"), [(SQUARE, IN_THE_PLANE), (SPACE, IN_SPACE)])
def test_wls_is_exact_without_noise(receivers, truth):
    found = weighted_least_squares(hear(truth, receivers, time=0.0), receivers, SETTING)
    np.testing.assert_allclose(found.position, truth, atol=1e-5)


def test_wls_is_exact_to_the_clocks_resolution_at_unix_times():
    """A double at 1.56e9 s steps by 0.24 microseconds, 0.36 mm of sound."""
    found = weighted_least_squares(hear(IN_SPACE, SPACE, time=EPOCH), SPACE, SETTING)
    assert np.abs(found.position - IN_SPACE).max() < 0.02


def test_wls_is_exact_with_any_receiver_missing():
    for missing in range(6):
        found = weighted_least_squares(deafen(hear(IN_SPACE, SPACE, time=0.0), [missing]), SPACE, SETTING)
        np.testing.assert_allclose(found.position, IN_SPACE, atol=1e-4)


def test_wls_is_exact_in_the_middle_of_a_square_where_the_linear_equations_do_not_tell_the_range():
    found = weighted_least_squares(hear([[0.0, 0.0], [0.0, 40.0], [1e-4, 0.0]], SQUARE, time=0.0), SQUARE, SETTING)
    np.testing.assert_allclose(found.position, [[0, 0], [0, 40], [1e-4, 0]], atol=1e-6)


def test_three_receivers_give_a_crossing_that_fits_and_inside_their_triangle_the_truth():
    inside = np.random.default_rng(3).dirichlet(np.ones(3), 200) @ SQUARE[:3]
    pings = deafen(hear(inside, SQUARE, time=0.0), [3])
    np.testing.assert_allclose(weighted_least_squares(pings, SQUARE, SETTING).position, inside, atol=1e-5)


def test_of_two_crossings_the_one_nearer_the_centre_is_taken():
    """Far behind a corner of three receivers the differences also fit a place nearer to them."""
    pings = deafen(hear([[250.0, -180.0]], SQUARE, time=0.0), [3])
    found = weighted_least_squares(pings, SQUARE, SETTING).position
    again = hear(found, SQUARE, time=0.0).arrival[:, :3]
    np.testing.assert_allclose(again - again[:, :1], pings.arrival[:, :3] - pings.arrival[:, :1], atol=1e-9)
    assert np.linalg.norm(found) < np.hypot(250, 180) - 10


def test_differences_longer_than_a_baseline_have_no_crossing():
    pings = Pings(time=np.zeros(1), arrival=np.array([[0.0, 0.2, 0.1, np.nan]]))  # 300 m along 200 m
    assert np.isnan(weighted_least_squares(pings, SQUARE, SETTING).position).all()


def test_a_ping_that_n_receivers_heard_has_no_position():
    pings = deafen(hear(IN_THE_PLANE, SQUARE), [0, 2])
    found = weighted_least_squares(pings, SQUARE, SETTING)
    assert np.isnan(found.position).all() and np.isnan(found.covariance).all()


def test_receivers_in_a_plane_or_unlinked_differences_have_no_closed_form():
    flat = np.column_stack([SQUARE, np.zeros(4)])
    assert np.isnan(weighted_least_squares(hear([[10.0, 20.0, 30.0]], flat), flat, SETTING).position).all()
    pings = hear([[10.0, 20.0]], SQUARE)
    pairs = np.array([(0, 1), (2, 3)])
    unlinked = arrival_information(pings.heard, 1e-3, pairs)
    assert np.isnan(weighted_least_squares(pings, SQUARE, SETTING, information=unlinked).position).all()


def test_row_of_a_batch_equals_a_batch_of_one():
    pings = hear(IN_THE_PLANE[:20], SQUARE, sigma=1e-3)
    pings.arrival[3, 1] = pings.arrival[7, 0] = np.nan
    together = weighted_least_squares(pings, SQUARE, SETTING)
    for row in range(20):
        one = Pings(time=pings.time[[row]], arrival=pings.arrival[[row]])
        alone = weighted_least_squares(one, SQUARE, SETTING)
        np.testing.assert_allclose(alone.position[0], together.position[row], atol=1e-8)
        np.testing.assert_allclose(alone.covariance[0], together.covariance[row], rtol=1e-8)


def test_error_in_the_array_is_within_a_tenth_of_the_bound_and_its_covariance_is_the_bound():
    """2000 draws: the rmse of a Gaussian is known to 1.1 %. Near receivers and edges the second order costs more."""
    truth = np.random.default_rng(4).uniform(-50, 50, (2000, 2))
    found = weighted_least_squares(hear(truth, SQUARE, sigma=1e-3), SQUARE, SETTING)
    bound = cramer_rao_bound(truth, SQUARE, SETTING)
    assert rmse(found.position, truth) / np.sqrt(np.mean(root_trace(bound) ** 2)) < 1.1
    np.testing.assert_allclose(found.covariance, cramer_rao_bound(found.position, SQUARE, SETTING), rtol=1e-9)
