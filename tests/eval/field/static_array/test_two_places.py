"""Where two places explain a ping alike both are told; where arrivals are to spare there is one."""

from __future__ import annotations

import numpy as np

from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Pings
from tagtrack.eval.field.static_array.two_places import other_places

SETTING = ArraySetting(sound_speed=1500.0, sigma=2e-4)


def located(receivers: np.ndarray, places: np.ndarray, noise: float = 2e-4) -> tuple[np.ndarray, np.ndarray]:
    """Estimates and other places (K, 2) of pings sent from places (K, 2)."""
    rng = np.random.default_rng(0)
    arrival = np.linalg.norm(places[:, None] - receivers, axis=2) / 1500.0
    pings = Pings(time=np.arange(len(places), dtype=float), arrival=arrival + rng.normal(0, noise, arrival.shape))
    found = wls_ml(pings, receivers, SETTING)
    return found.position, other_places(pings, receivers, SETTING, found.position, found.covariance)


def test_receivers_in_a_line_have_a_mirror() -> None:
    line = np.array([(0.0, 0.0), (150.0, 0.0), (300.0, 0.0), (450.0, 0.0)])
    places = np.column_stack([np.linspace(100, 350, 20), np.linspace(-60, -140, 20)])
    position, other = located(line, places)
    assert np.isfinite(other).all()
    nearest = np.minimum(np.linalg.norm(position - places, axis=1), np.linalg.norm(other - places, axis=1))
    assert np.quantile(nearest, 0.95) < 15.0


def test_three_receivers_are_ambiguous_beside_the_triangle_and_sure_within() -> None:
    triangle = np.array([(0.0, 0.0), (200.0, 0.0), (100.0, 170.0)])
    inside = np.random.default_rng(1).uniform((70, 30), (130, 90), (40, 2))
    position, other = located(triangle, inside)
    assert np.isnan(other).all() and np.linalg.norm(position - inside, axis=1).max() < 3.0
    behind = np.column_stack([np.full(20, -60.0) + np.linspace(0, 20, 20), np.linspace(-45, -20, 20)])  # a corner's far side
    position, other = located(triangle, behind, noise=0.0)
    nearest = np.fmin(np.linalg.norm(position - behind, axis=1), np.linalg.norm(other - behind, axis=1))
    assert np.isfinite(other).all(axis=1).mean() > 0.8 and np.quantile(nearest, 0.9) < 1.0


def test_arrivals_to_spare_leave_one_place() -> None:
    grid = np.array([(x, y) for x in (-100.0, 0.0, 100.0) for y in (-100.0, 100.0)])
    _, other = located(grid, np.random.default_rng(2).uniform(-90, 90, (50, 2)))
    assert np.isnan(other).all()


def test_whatever_lies_outside_its_ellipse_of_three_receivers_has_another_place() -> None:
    """The covariance of a ping of three receivers holds near its place alone; where it fails, a second place must say so."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-250, 450, (400, 2))
    triangle = np.array([(0.0, 0.0), (200.0, 0.0), (100.0, 170.0)])
    arrival = np.linalg.norm(places[:, None] - triangle, axis=2) / 1500.0
    pings = Pings(time=np.arange(400.0), arrival=arrival + rng.normal(0, 2e-4, arrival.shape))
    found = wls_ml(pings, triangle, SETTING)
    other = other_places(pings, triangle, SETTING, found.position, found.covariance)
    miss = found.position - places
    known = np.isfinite(found.covariance).all(axis=(1, 2))
    distance = np.full(400, np.nan)
    distance[known] = np.einsum("ki,kij,kj->k", miss[known], np.linalg.inv(found.covariance[known]), miss[known])
    outside, marked = distance > 13.8, np.isfinite(other).all(axis=1)  # chi-square with 2 degrees of freedom, 99.9 %
    assert outside.sum() > 20 and marked.sum() < 250
    assert (outside & ~marked).sum() <= 2  # one in a thousand lies outside by chance
