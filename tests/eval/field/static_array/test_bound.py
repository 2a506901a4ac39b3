"""The Cramér-Rao bound (Eqs. 14-16) and Fig. 2A."""

from __future__ import annotations

import numpy as np
import pytest

from tagtrack.eval.field.static_array.bound import cramer_rao_bound, root_trace
from tagtrack.eval.field.static_array.model import arrival_information, full_pairs
from tests.eval.field.static_array.scene import SETTING, SPACE, SQUARE

EVERY_PAIR = arrival_information(np.ones(4), SETTING.sigma, full_pairs(4))
CIRCLE = np.linspace(0, 2 * np.pi, 72, endpoint=False)


def test_bound_in_the_middle_of_a_square_is_that_of_its_directions():
    """Slopes (+-1, +-1) / sqrt 2 that sum to zero: information 2 / (c sigma)^2 on each axis, so 1.5 m of rms distance."""
    bound = cramer_rao_bound([0.0, 0.0], SQUARE, SETTING)
    np.testing.assert_allclose(bound, 1.5**2 / 2 * np.eye(2), atol=1e-12)
    assert root_trace(bound) == pytest.approx(1.5)


def test_four_receivers_with_independent_errors_of_every_pair_know_twice_as_much():
    """Six differences of four arrivals with independent errors carry 4 times the information of the arrivals themselves."""
    where = np.random.default_rng(1).uniform(-300, 300, (50, 2))
    once, twice = (root_trace(cramer_rao_bound(where, SQUARE, SETTING, chosen)) for chosen in (None, EVERY_PAIR))
    np.testing.assert_allclose(once, 2 * twice, rtol=1e-9)


def test_bound_of_fig_2a_is_that_of_every_pair_with_independent_errors():
    """Printed: < 1 m inside, up to 7 m at 250 m off the centre. Independent errors of all 6 differences (R = sigma^2 I, Eq. 3)
    give 0.75 to 0.95 m inside and 5.9 to 7.5 m there; errors of the arrivals would give twice that, so they are not drawn."""
    inside = np.stack(np.meshgrid(*[np.linspace(-95, 95, 39)] * 2), axis=-1)
    rim = 250.0 * np.stack([np.cos(CIRCLE), np.sin(CIRCLE)], axis=1)
    assert root_trace(cramer_rao_bound(inside, SQUARE, SETTING, EVERY_PAIR)).max() < 1.0
    assert root_trace(cramer_rao_bound(inside, SQUARE, SETTING)).min() == pytest.approx(1.5, abs=0.01)
    off = root_trace(cramer_rao_bound(rim, SQUARE, SETTING, EVERY_PAIR))
    assert (off.min(), off.max()) == pytest.approx((5.86, 7.49), abs=0.01)


def test_bound_goes_with_the_square_of_noise_and_shrinks_with_a_fifth_receiver_or_a_longer_baseline():
    """Fig. S1: five receivers are better than four, three are worse, and a longer baseline is better."""
    at = [150.0, 60.0]
    four = root_trace(cramer_rao_bound(at, SQUARE, SETTING))
    assert root_trace(cramer_rao_bound(at, np.vstack([SQUARE, [[0, 0]]]), SETTING)) < four
    assert root_trace(cramer_rao_bound(at, SQUARE[:3], SETTING)) > four
    assert root_trace(cramer_rao_bound(at, 2 * SQUARE, SETTING)) < four


def test_no_bound_where_the_ping_does_not_determine_the_position():
    two = arrival_information([True, True, False, False], SETTING.sigma)
    assert np.isinf(cramer_rao_bound([10.0, 20.0], SQUARE, SETTING, two)).all()
    assert np.isinf(root_trace(cramer_rao_bound(SQUARE[0], SQUARE, SETTING)))
    assert np.isnan(cramer_rao_bound([np.nan, 0.0], SQUARE, SETTING)).all()
    assert cramer_rao_bound(np.zeros((4, 5, 3)), SPACE, SETTING).shape == (4, 5, 3, 3)
    with pytest.raises(ValueError, match=r"position must be \(..., 2\) as the receivers are, got shape \(3,\)"):
        cramer_rao_bound([0.0, 0.0, 0.0], SQUARE, SETTING)
