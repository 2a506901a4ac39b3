"""A belief that is honest by construction must look honest, and one that boasts must not."""

import math

import numpy as np
import pytest

from tagtrack.eval.consistency import (
    SMALLEST_SIGMA,
    TABLE_II,
    normalized_error_squared,
    share_inside_ellipses,
    summarize_consistency,
    table_ii_proportions,
)

COVARIANCE = np.array([[25.0, 12.0], [12.0, 9.0]])


def gaussian_errors(shape, seed=0):
    return np.random.default_rng(seed).multivariate_normal([0.0, 0.0], COVARIANCE, shape)


def test_normalized_error_of_one_sigma_along_each_axis_is_two():
    assert normalized_error_squared([3.0, -4.0], [[9.0, 0.0], [0.0, 16.0]]) == pytest.approx(2.0)


def test_normalized_error_is_the_quadratic_form_of_the_inverse():
    rng = np.random.default_rng(1)
    error = rng.normal(size=(5, 7, 2))
    root = rng.normal(size=(5, 7, 2, 2))
    covariance = root @ root.swapaxes(-1, -2) + 0.1 * np.eye(2)
    expected = np.einsum("...i,...ij,...j", error, np.linalg.inv(covariance), error)
    np.testing.assert_allclose(normalized_error_squared(error, covariance), expected, rtol=1e-9)


def test_singular_covariance_is_no_shorter_than_the_smallest_sigma():
    # All particles on a line along x: one metre of error across it is 100 smallest sigmas.
    line = [[4.0, 0.0], [0.0, 0.0]]
    assert normalized_error_squared([2.0, 1.0], line) == pytest.approx(1.0 + (1.0 / SMALLEST_SIGMA) ** 2)
    assert normalized_error_squared([1.0, 0.0], np.zeros((2, 2)), smallest_sigma=0.5) == pytest.approx(4.0)


def test_missing_steps_stay_nan():
    error = [[1.0, 1.0], [math.nan, math.nan], [1.0, 1.0]]
    covariance = np.stack([np.eye(2), np.eye(2), np.full((2, 2), math.nan)])
    normalized = normalized_error_squared(error, covariance)
    np.testing.assert_array_equal(np.isnan(normalized), [False, True, True])
    np.testing.assert_allclose(share_inside_ellipses(normalized), [0.0, 1.0, 1.0])  # 2 lies between 1.39 and 4.61
    assert np.isnan(share_inside_ellipses(normalized[1:])).all()


def test_shapes_that_are_no_plane_are_refused():
    with pytest.raises(ValueError, match="expected shapes"):
        normalized_error_squared(np.zeros((4, 3)), np.zeros((4, 3, 3)))


def test_true_gaussian_lies_inside_its_ellipses_as_often_as_they_say():
    steps = 40_000
    normalized = normalized_error_squared(gaussian_errors(steps), COVARIANCE)
    for share, nominal in zip(share_inside_ellipses(normalized), (0.5, 0.9, 0.99), strict=True):
        assert share == pytest.approx(
            nominal, abs=4 * math.sqrt(nominal * (1 - nominal) / steps)
        )  # four standard errors
    assert normalized.mean() == pytest.approx(2.0, abs=4 * 2.0 / math.sqrt(steps))  # chi-square, 2 dof: variance 4


def test_belief_that_halves_its_sigmas_is_found_out():
    shares = share_inside_ellipses(normalized_error_squared(gaussian_errors(40_000), COVARIANCE / 4))
    # Inside means chi-square < q / 4, which has probability 1 - (1 - p)^(1/4).
    np.testing.assert_allclose(shares, 1 - np.array([0.5, 0.1, 0.01]) ** 0.25, atol=0.01)


def test_table_ii_by_hand():
    # sigma_x is 1 and 3 (mean 2), sigma_y always 1; the errors are 1.5 and -1.5 along x, 0 and 2 along y.
    error = [[1.5, 0.0], [-1.5, 2.0]]
    covariance = [[[1.0, 0.0], [0.0, 1.0]], [[9.0, 0.0], [0.0, 1.0]]]
    proportions = table_ii_proportions(error, covariance)
    assert {name: float(share) for name, share in proportions.items()} == {
        "ex_below_mean_sigma_x": 1.0,  # 1.5 < 2 twice
        "ey_below_mean_sigma_y": 0.5,
        "ex_below_sigma_x": 0.5,  # 1.5 > 1, 1.5 < 3
        "ey_below_sigma_y": 0.5,
        "e_below_sigma": 0.5,  # 1.5 > sqrt(2), 2.5 < sqrt(10)
    }


def test_table_ii_leaves_missing_steps_out():
    error = [[1.5, 0.0], [-1.5, 2.0], [math.nan, math.nan]]
    covariance = np.array([[[1.0, 0.0], [0.0, 1.0]], [[9.0, 0.0], [0.0, 1.0]], [[1e6, 0.0], [0.0, 1e6]]])
    with_gap, without = table_ii_proportions(error, covariance), table_ii_proportions(error[:2], covariance[:2])
    assert with_gap == without
    assert all(math.isnan(share) for share in table_ii_proportions(error[2:], covariance[2:]).values())


def test_round_gaussian_gives_the_proportions_of_the_normal_law():
    error = np.random.default_rng(2).normal(size=(40_000, 2)) * 5.0
    proportions = table_ii_proportions(error, np.broadcast_to(25.0 * np.eye(2), (40_000, 2, 2)))
    axis, plane = math.erf(1 / math.sqrt(2)), 1 - math.exp(-1)  # 68.3 %; e^2 < 2 sigma_x^2: 63.2 %
    for name in TABLE_II:
        expected = plane if name == "e_below_sigma" else axis
        assert proportions[name] == pytest.approx(expected, abs=0.01), name  # four standard errors


def test_the_papers_own_proportions_allow_our_reading_of_sigma():
    assert TABLE_II["e_below_sigma"] <= TABLE_II["ex_below_sigma_x"] + TABLE_II["ey_below_sigma_y"]


def test_summary_of_an_honest_belief_holds_its_nominal_values():
    error = gaussian_errors((60, 100), seed=3)
    figures = summarize_consistency(error, np.broadcast_to(COVARIANCE, (60, 100, 2, 2)))
    nominal = {"normalized_error_squared": 2.0, "inside_50": 0.5, "inside_90": 0.9, "inside_99": 0.99}
    assert set(figures) == {*nominal, "median_normalized_error_squared", *TABLE_II}
    for name, value in nominal.items():
        margin = figures[name].high - figures[name].low  # twice what 95 % leave: no seed hunting
        assert figures[name].value == pytest.approx(value, abs=margin), name


def test_summary_refuses_an_episode_without_steps():
    error = np.zeros((2, 3, 2))
    error[1] = math.nan
    with pytest.raises(ValueError, match="episode 1 has no step"):
        summarize_consistency(error, np.broadcast_to(COVARIANCE, (2, 3, 2, 2)))
