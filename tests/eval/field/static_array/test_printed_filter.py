"""The particle filter that the paper prints: what it can, and that it lacks what ours has."""

from __future__ import annotations

import numpy as np
import pytest

from tagtrack.eval.field.array.simulate import CONTESTANTS
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings
from tagtrack.eval.field.static_array.particle_track import particle_filter
from tagtrack.eval.field.static_array.printed_filter import _move, printed_particle_filter

SQUARE = np.array([[0.0, 0.0], [200.0, 0.0], [200.0, 200.0], [0.0, 200.0]])
SETTING = ArraySetting(sigma=1e-3, acceleration_sigma=2e-2, first_speed_sigma=0.2)


def rest(count: int, place: tuple[float, float], seed: int = 0) -> Pings:
    flight = np.linalg.norm(np.array(place) - SQUARE, axis=-1) / 1500
    sent = 60.0 * np.arange(count)[:, None]
    arrival = sent + flight + 1e-3 * np.random.default_rng(seed).standard_normal((count, 4))
    return Pings(time=sent[:, 0], arrival=arrival)


def off(position: Floats, place: tuple[float, float]) -> Floats:
    return np.linalg.norm(position - np.array(place), axis=-1)


def test_particles_gather_within_a_few_pings_among_the_receivers() -> None:
    found = printed_particle_filter(rest(20, (70.0, 120.0)), SQUARE, SETTING)
    error = off(found.position, (70.0, 120.0))
    assert error[5:].max() < 6.0 and np.median(error[5:]) < 2.5  # one ping alone: 1.5 m
    assert found.covariance.shape == (20, 2, 2)


def test_one_ping_weighs_the_full_set_of_differences_as_if_independent() -> None:
    """Six differences of four arrivals tell 4 / sigma^2 of each arrival about their mean, where the arrivals tell 1 / sigma^2."""
    pings, many, vague = rest(1, (100.0, 100.0)), 400_000, ArraySetting(sigma=5e-3)
    spread = [
        np.sqrt(np.trace(locate(pings, SQUARE, vague, particles=many, **how).covariance[0]))
        for locate, how in ((printed_particle_filter, {}), (particle_filter, {"stray_share": 0.0}))
    ]
    assert spread[1] / spread[0] == pytest.approx(2.0, rel=0.15)  # of some 200 effective particles: 5 %


def test_particles_move_by_equation_8() -> None:
    """In 100 s: the way has sigma^2 dt^3 / 3 about the mean velocity's, the velocity sigma^2 dt, together sigma^2 dt^2 / 2."""
    state = np.repeat([[5.0], [6.0], [0.1], [-0.2]], 100_000, axis=1)
    moved = _move(state, 100.0, SETTING, np.random.default_rng(0))
    np.testing.assert_allclose(moved.mean(axis=1), [15.0, -14.0, 0.1, -0.2], atol=0.15)  # 4 of sqrt(133 / 100,000)
    spread = np.cov(moved)
    np.testing.assert_allclose(spread[[0, 2, 0], [0, 2, 2]], 4e-4 * np.array([1e6 / 3, 100, 1e4 / 2]), rtol=0.02)
    assert abs(spread[0, 1]) < 2.0  # the axes know nothing of each other


def test_one_late_arrival_carries_it_away_and_not_ours() -> None:
    pings = rest(20, (70.0, 120.0))
    pings.arrival[10, 1] += 0.1
    printed, ours = (method(pings, SQUARE, SETTING) for method in (printed_particle_filter, particle_filter))
    assert off(printed.position, (70.0, 120.0))[10:].max() > 20.0
    assert off(ours.position, (70.0, 120.0))[10:].max() < 5.0


def test_it_waits_for_the_first_ping_that_three_receivers_heard() -> None:
    pings = rest(6, (70.0, 120.0))
    pings.arrival[:2, 2:] = np.nan
    found = printed_particle_filter(pings, SQUARE, SETTING, particles=500)
    assert np.isnan(found.position[:2]).all() and np.isfinite(found.position[2:]).all()


def test_it_is_a_contestant_of_the_simulation() -> None:
    assert CONTESTANTS["pf_printed"] is printed_particle_filter
