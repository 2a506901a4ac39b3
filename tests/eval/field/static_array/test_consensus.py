"""An arrival that comes late is left out where enough others agree, and never makes a position sure of itself."""

from __future__ import annotations

import numpy as np

from tagtrack.eval.field.array.chain import widen
from tagtrack.eval.field.static_array.consensus import agree
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Pings

SETTING = ArraySetting(sound_speed=1500.0, sigma=2e-4)
GRID = np.array([(x, y) for x in (-100.0, 0.0, 100.0) for y in (-100.0, 0.0, 100.0)])


def pings_of(count: int, receivers: int, late: float, seed: int = 0) -> tuple[Pings, np.ndarray]:
    """Pings heard by so many receivers, the first of them late; and where the tag was."""
    rng = np.random.default_rng(seed)
    place = rng.uniform(-60, 60, (count, 2))
    arrival = np.linalg.norm(place[:, None] - GRID, axis=2) / 1500.0 + rng.normal(0, 2e-4, (count, len(GRID)))
    for k in range(count):
        order = rng.permutation(len(GRID))
        arrival[k, order[0]] += late
        arrival[k, order[receivers:]] = np.nan
    return Pings(time=np.arange(count, dtype=float), arrival=arrival), place


def test_a_late_arrival_among_seven_is_left_out() -> None:
    pings, place = pings_of(200, 7, 0.02)
    found = agree(pings, GRID, SETTING)
    error = np.linalg.norm(wls_ml(found.pings, GRID, SETTING).position - place, axis=1)
    assert 195 <= found.dropped <= 210
    assert np.quantile(error, 0.99) < 1.5 < 2.0 < np.median(np.linalg.norm(wls_ml(pings, GRID, SETTING).position - place, axis=1))


def test_of_four_arrivals_none_is_left_out_and_the_misfit_tells() -> None:
    pings, place = pings_of(200, 4, 0.02)
    found = agree(pings, GRID, SETTING)
    positions = widen(wls_ml(found.pings, GRID, SETTING), found.misfit)
    error = np.linalg.norm(positions.position - place, axis=1)
    sd = np.sqrt(np.trace(positions.covariance, axis1=1, axis2=2))
    assert found.dropped == 0
    confident = (error > 5.0) & (sd < 1.0)
    assert confident.sum() <= 6 and (error > 5.0).sum() > 50


def test_arrivals_that_agree_stay() -> None:
    pings, _ = pings_of(1000, 7, 0.0)
    found = agree(pings, GRID, SETTING)
    assert found.dropped <= 2
    assert 0.9 < np.sqrt(np.mean(found.misfit**2)) < 1.1
    three, _ = pings_of(50, 3, 0.0)
    assert np.isnan(agree(three, GRID, SETTING).misfit).all()
