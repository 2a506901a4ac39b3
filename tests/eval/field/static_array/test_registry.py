"""All estimators by name, under one call."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tagtrack.eval.field.static_array.bound import cramer_rao_bound, root_trace
from tagtrack.eval.field.static_array.model import Pings
from tagtrack.eval.field.static_array.registry import METHODS, locate
from tests.eval.field.static_array.scene import EPOCH, SETTING, SPACE, SQUARE, hear, rmse

TIME = EPOCH + 60.0 * np.arange(60)
TRUTH = np.stack([np.linspace(-60, 60, 60), np.linspace(-20, 40, 60), np.linspace(-30, 30, 60)], axis=1)


@pytest.mark.parametrize("receivers", [SQUARE, SPACE], ids=["plane", "space"])
@pytest.mark.parametrize("method", ["wls", "ml", "wls_ml", "map", "map_m"])
def test_every_method_follows_a_swimmer_about_as_well_as_the_bound_of_a_ping(method, receivers):
    """60 draws know an rmse to 9 %; with a motion model it is smaller than the bound."""
    truth = TRUTH[:, : receivers.shape[1]]
    found = locate(method, hear(truth, receivers, sigma=1e-3, time=TIME), receivers, SETTING)
    bound = np.sqrt(np.mean(root_trace(cramer_rao_bound(truth, receivers, SETTING)) ** 2))
    assert found.covariance.shape == (60, receivers.shape[1], receivers.shape[1])
    assert rmse(found.position, truth) < 1.3 * bound


@pytest.mark.parametrize("method", ["wls", "ml", "wls_ml", "map", "map_m"])
def test_positions_move_with_the_coordinates(method):
    """UTM northings are in millions of metres; a double still resolves a nanometre of them."""
    utm = np.array([544000.0, 4651400.0])
    pings = hear(TRUTH[::6, :2], SQUARE, sigma=1e-3, time=TIME[::6])
    here, there = locate(method, pings, SQUARE, SETTING), locate(method, pings, SQUARE + utm, SETTING)
    np.testing.assert_allclose(there.position - utm, here.position, atol=1e-3)
    np.testing.assert_allclose(there.covariance, here.covariance, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_no_pings_have_no_positions(method):
    found = locate(method, Pings(time=np.empty(0), arrival=np.empty((0, 4))), SQUARE, SETTING)
    assert found.position.shape == (0, 2) and found.covariance.shape == (0, 2, 2)


def test_unknown_methods_and_misshapen_pings_are_named():
    pings = hear(TRUTH[:, :2], SQUARE, time=TIME)
    with pytest.raises(ValueError, match="unknown method 'mle'; known: wls, ml, wls_ml, map, map_m"):
        locate("mle", pings, SQUARE, SETTING)
    with pytest.raises(ValueError, match=re.escape("arrival must be (K, 3), one column for each receiver, got shape (60, 4)")):
        locate("ml", pings, SQUARE[:3], SETTING)
    with pytest.raises(ValueError, match=re.escape("time must be (60,), one for each ping, got shape (59,)")):
        locate("ml", Pings(time=TIME[1:], arrival=pings.arrival), SQUARE, SETTING)
    with pytest.raises(ValueError, match="pings must be in order of time"):
        locate("map", Pings(time=TIME[::-1], arrival=pings.arrival), SQUARE, SETTING)
    with pytest.raises(ValueError, match="at least 3 receivers, got 2"):
        locate("ml", pings, SQUARE[:2], SETTING)
    with pytest.raises(ValueError, match="all 4 receivers stand in one place"):
        locate("ml", pings, np.zeros((4, 2)), SETTING)
