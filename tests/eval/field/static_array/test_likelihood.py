"""The cost of Eq. 6 in arrivals: it is the one in differences, and its derivatives are right."""

from __future__ import annotations

import numpy as np
import pytest

from tagtrack.eval.field.static_array.likelihood import make_likelihood
from tagtrack.eval.field.static_array.model import Pings, arrival_information, full_pairs
from tests.eval.field.static_array.scene import EPOCH, SETTING, SPACE, SQUARE, Floats, deafen, hear


def differences(arrival: Floats, pairs: Floats) -> Floats:
    """mu^ij = arrival_i - arrival_j (Eq. 1)."""
    return arrival[..., pairs[:, 0]] - arrival[..., pairs[:, 1]]


def tdoa_cost(pings: Pings, pairs: Floats, covariance: Floats, position: Floats) -> Floats:
    """Eq. 6 as printed."""
    predicted = np.linalg.norm(position[:, None] - SQUARE, axis=2) / SETTING.sound_speed
    error = differences(pings.arrival - EPOCH, pairs) - differences(predicted, pairs)
    return 0.5 * np.einsum("km,ml,kl->k", error, np.linalg.inv(covariance), error)


@pytest.mark.parametrize("reference", [0, 2])
def test_cost_in_arrivals_is_that_of_spanning_differences_with_shared_errors(reference):
    position = np.random.default_rng(1).uniform(-150, 150, (20, 2))
    pings = hear(np.zeros((20, 2)), SQUARE, sigma=1e-3)
    covariance = SETTING.sigma**2 * (np.eye(3) + np.ones((3, 3)))
    pairs = np.array([(other, reference) for other in range(4) if other != reference])
    expected = tdoa_cost(pings, pairs, covariance, position)
    np.testing.assert_allclose(make_likelihood(pings, SQUARE, SETTING).cost(position), expected, rtol=1e-5)


def test_cost_of_the_full_set_with_independent_errors_is_the_papers():
    position = np.random.default_rng(1).uniform(-150, 150, (20, 2))
    pings = hear(np.zeros((20, 2)), SQUARE, sigma=1e-3)
    pairs = full_pairs(4)
    information = arrival_information(pings.heard, SETTING.sigma, pairs)
    expected = tdoa_cost(pings, pairs, SETTING.sigma**2 * np.eye(6), position)
    np.testing.assert_allclose(make_likelihood(pings, SQUARE, SETTING, information).cost(position), expected, rtol=1e-5)


@pytest.mark.parametrize("receivers", [SQUARE, SPACE])
def test_gradient_and_hessian_are_those_of_finite_differences(receivers):
    count = receivers.shape[1]
    position = np.random.default_rng(2).uniform(-150, 150, (10, count))
    likelihood = make_likelihood(deafen(hear(0.7 * position, receivers, sigma=1e-3), [1]), receivers, SETTING)
    found = likelihood.derivatives(position)
    for axis in range(count):
        step = 1e-3 * np.eye(count)[axis]
        slope = (likelihood.cost(position + step) - likelihood.cost(position - step)) / 2e-3
        np.testing.assert_allclose(found.gradient[:, axis], slope, rtol=1e-5, atol=1e-5)
        bend = (likelihood.derivatives(position + step).gradient - likelihood.derivatives(position - step).gradient) / 2e-3
        np.testing.assert_allclose((found.information + found.bending)[:, axis], bend, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found.cost, likelihood.cost(position))


def test_a_receiver_that_heard_nothing_may_not_have_information():
    pings = deafen(hear(np.zeros((1, 2)), SQUARE), [3])
    with pytest.raises(ValueError, match="did not hear"):
        make_likelihood(pings, SQUARE, SETTING, arrival_information(np.ones((1, 4)), 1e-3))
    with pytest.raises(ValueError, match=r"information must be \(1, 4, 4\), got shape \(4, 4\)"):
        make_likelihood(pings, SQUARE, SETTING, np.eye(4))
