"""The particle filter of a moored array against an independent filter, against the bound, and where pings are missing."""

from __future__ import annotations

import numpy as np
import pytest

from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings
from tagtrack.eval.field.static_array.particle_track import particle_filter

SQUARE = np.array([[0.0, 0.0], [200.0, 0.0], [200.0, 200.0], [0.0, 200.0]])


def hear(position: Floats, receivers: Floats, sent: Floats, sigma: float, seed: int = 0) -> Pings:
    flight = np.linalg.norm(position[:, None] - receivers, axis=-1) / 1500
    arrival = 1.56e9 + sent[:, None] + flight + sigma * np.random.default_rng(seed).standard_normal(flight.shape)
    return Pings(time=arrival.min(axis=1), arrival=arrival)


def swim_randomly(count: int, interval: Floats, sigma: float, seed: int) -> Floats:
    """A track of exactly the filter's motion model, its integral over fine steps: an oracle for the model's closed form."""
    rng = np.random.default_rng(seed)
    position, velocity = np.array([80.0, 90.0]), 0.02 * rng.standard_normal(2)
    track = [position]
    for step in interval[: count - 1]:
        for _ in range(200):
            position = position + velocity * step / 200
            velocity = velocity + sigma * np.sqrt(step / 200) * rng.standard_normal(2)
        track.append(position)
    return np.array(track)


def kalman(pings: Pings, sent: Floats, truth: Floats, setting: ArraySetting) -> tuple[Floats, Floats]:
    """An extended Kalman filter linearized at the truth: exact to the curvature of the hyperbolas within a metre."""
    mean, covariance = np.concatenate([truth[0], [0, 0]]), np.diag([1e6, 1e6, 1, 1]) * setting.first_speed_sigma**2
    found = []
    for k in range(len(sent)):
        if k:
            dt = pings.time[k] - pings.time[k - 1]
            move = np.kron([[1, dt], [0, 1]], np.eye(2))
            noise = setting.acceleration_sigma**2 * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(2))
            mean, covariance = move @ mean, move @ covariance @ move.T + noise
        offset = truth[k] - SQUARE
        distance = np.linalg.norm(offset, axis=1)
        centring = np.eye(4) - 0.25
        slope = np.hstack([centring @ (offset / distance[:, None]) / 1500, np.zeros((4, 2))])
        measured = centring @ (pings.arrival[k] - pings.arrival[k].mean() - distance / 1500) + slope[:, :2] @ truth[k]
        information = slope.T @ slope / setting.sigma**2
        posterior = np.linalg.inv(np.linalg.inv(covariance) + information)
        mean = posterior @ (np.linalg.solve(covariance, mean) + slope.T @ measured / setting.sigma**2)
        covariance = posterior
        found.append((mean[:2], covariance[:2, :2]))
    return np.array([mean for mean, _ in found]), np.array([covariance for _, covariance in found])


@pytest.fixture(scope="module")
def passage() -> tuple[Pings, Floats, Floats, ArraySetting]:
    setting = ArraySetting(sigma=1e-3, acceleration_sigma=1e-4, first_speed_sigma=0.05)
    interval = np.random.default_rng(3).uniform(60, 90, 60)
    truth = swim_randomly(40, interval, setting.acceleration_sigma, seed=4)
    sent = np.concatenate([[0.0], np.cumsum(interval)])[:40]
    return hear(truth, SQUARE, sent, setting.sigma), sent, truth, setting


def test_filter_agrees_with_a_kalman_filter_where_the_problem_is_almost_linear(
    passage: tuple[Pings, Floats, Floats, ArraySetting],
) -> None:
    pings, sent, truth, setting = passage
    mean, covariance = kalman(pings, sent, truth, setting)
    found = particle_filter(pings, SQUARE, setting, stray_share=0.0)
    deviation = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    apart = np.linalg.norm(found.position - mean, axis=1) / deviation
    assert np.median(apart) < 0.1 and apart.max() < 0.35  # some 500 effective particles know a mean to 0.05 of its deviation
    ratio = np.trace(found.covariance, axis1=1, axis2=2) / np.trace(covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(np.median(ratio), 1.0, atol=0.07)


def test_filter_knows_more_than_each_ping_alone_tells(passage: tuple[Pings, Floats, Floats, ArraySetting]) -> None:
    pings, _, truth, setting = passage
    found = particle_filter(pings, SQUARE, setting)
    offset = truth[:, None] - SQUARE
    slope = offset / np.linalg.norm(offset, axis=-1, keepdims=True) / 1500
    slope -= slope.mean(axis=1, keepdims=True)
    alone = np.linalg.inv(slope.swapaxes(1, 2) @ slope / setting.sigma**2)
    late = slice(10, None)
    assert np.trace(found.covariance[late], axis1=1, axis2=2).mean() < 0.6 * np.trace(alone[late], axis1=1, axis2=2).mean()


def integrate(pings: Pings, receivers: Floats, sigma: float, axes: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Mean and covariance of one ping's likelihood over a fine grid: the answer without particles."""
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    residual = pings.arrival[0] - pings.arrival[0, 0] - np.linalg.norm(grid[..., None, :] - receivers, axis=-1) / 1500
    residual -= residual.mean(axis=-1, keepdims=True)
    density = np.exp(-0.5 * np.sum(residual**2, axis=-1) / sigma**2)
    density /= density.sum()
    mean = np.einsum("ij,ija->a", density, grid)
    return mean, np.einsum("ij,ija,ijb->ab", density, grid - mean, grid - mean)


def test_first_ping_alone_gives_mean_and_covariance_of_its_likelihood() -> None:
    setting = ArraySetting(sigma=1e-3)  # outside, where it is long and bent
    pings = hear(np.array([[330.0, 60.0]]), SQUARE, np.zeros(1), setting.sigma)
    mean, covariance = integrate(pings, SQUARE, setting.sigma, (np.arange(280, 400, 0.25), np.arange(30, 90, 0.1)))
    found = particle_filter(pings, SQUARE, setting)
    np.testing.assert_allclose(found.position[0], mean, atol=0.1 * np.sqrt(covariance.max()))
    np.testing.assert_allclose(found.covariance[0], covariance, rtol=0.12, atol=0.05)


def test_two_places_that_three_receivers_cannot_tell_apart_are_both_kept() -> None:
    # Behind a corner and just before it two points have the same differences: 20 m behind along each axis, and some 3 m before.
    triangle = np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 100.0]])
    pings = hear(np.array([[-20.0, -20.0]]), triangle, np.zeros(1), 0.0)
    axis = np.arange(-40, 20, 0.06)
    mean, covariance = integrate(pings, triangle, 5e-4, (axis, axis))
    assert np.sqrt(np.trace(covariance)) > 10  # both have a share
    found = particle_filter(pings, triangle, ArraySetting(sigma=5e-4))
    # Shares to 6 %: they settle at the first stages, with few particles.
    np.testing.assert_allclose(found.position[0], mean, atol=2.0)
    np.testing.assert_allclose(found.covariance[0], covariance, rtol=0.15)


def test_positions_begin_with_the_first_ping_that_three_receivers_heard(
    passage: tuple[Pings, Floats, Floats, ArraySetting],
) -> None:
    pings, _, truth, setting = passage
    arrival = pings.arrival.copy()
    arrival[:3, 2:] = np.nan
    arrival[10, 1:] = np.nan  # says nothing; the track goes on
    found = particle_filter(Pings(time=pings.time, arrival=arrival), SQUARE, setting)
    assert np.isnan(found.position[:3]).all() and np.isfinite(found.position[3:]).all()
    assert np.trace(found.covariance[10]) > np.trace(found.covariance[9])
    assert np.linalg.norm(found.position[10] - truth[10]) < 3 * np.sqrt(np.trace(found.covariance[10]))


def test_estimate_does_not_know_the_future(passage: tuple[Pings, Floats, Floats, ArraySetting]) -> None:
    pings, _, _, setting = passage
    whole = particle_filter(pings, SQUARE, setting, particles=500)
    part = particle_filter(Pings(time=pings.time[:15], arrival=pings.arrival[:15]), SQUARE, setting, particles=500)
    np.testing.assert_array_equal(whole.position[:15], part.position)


def test_one_arrival_far_off_does_not_carry_the_track_away(passage: tuple[Pings, Floats, Floats, ArraySetting]) -> None:
    pings, _, truth, setting = passage
    arrival = pings.arrival.copy()
    arrival[20, 1] += 0.3
    spoilt = Pings(time=pings.time, arrival=arrival)
    usual, paper = particle_filter(spoilt, SQUARE, setting), particle_filter(spoilt, SQUARE, setting, stray_share=0.0)
    deviation = np.sqrt(np.trace(usual.covariance[20]))
    assert np.linalg.norm(usual.position[20] - truth[20]) < 3 * deviation
    assert np.linalg.norm(paper.position[20] - truth[20]) > 3 * deviation


def test_track_that_is_lost_starts_anew() -> None:
    truth = np.concatenate([np.tile([40.0, 60.0], (6, 1)), np.tile([150.0, 160.0], (8, 1))])  # carried off between two pings
    setting = ArraySetting(sigma=1e-3, acceleration_sigma=1e-4, first_speed_sigma=0.05)
    found = particle_filter(hear(truth, SQUARE, 60.0 * np.arange(14), setting.sigma), SQUARE, setting)
    error = np.linalg.norm(found.position - truth, axis=1)
    assert error[6:9].min() > 100  # three strays in a row
    assert error[9:].max() < 6  # four times the bound of 1.5 m


def test_three_dimensions_are_tracked() -> None:
    cube = np.array([[0, 0, 0], [200, 0, 60], [200, 200, 0], [0, 200, 60], [100, 100, 120.0]])
    truth = np.stack([np.linspace(60, 120, 15), np.full(15, 90.0), np.linspace(20, 40, 15)], axis=1)
    setting = ArraySetting(sigma=5e-4, acceleration_sigma=1e-3)
    found = particle_filter(hear(truth, cube, 60.0 * np.arange(15), setting.sigma), cube, setting)
    offset = found.position - truth
    distance = np.einsum("ka,kab,kb->k", offset, np.linalg.inv(found.covariance), offset)
    assert np.sqrt(np.mean(offset**2)) < 2.0
    assert distance.mean() < 6.0  # 3 expected; the mean of some 15, little dependent, deviates by 0.6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"particles": 1}, "at least 2"),
        ({"receivers": SQUARE[:2]}, "at least 3"),
        ({"receivers": SQUARE[:3]}, "one column for each receiver"),
    ],
)
def test_bad_input_is_refused(change: dict[str, object], message: str) -> None:
    pings = hear(np.array([[50.0, 50.0]]), SQUARE, np.zeros(1), 1e-3)
    arguments = {"pings": pings, "receivers": SQUARE, "setting": ArraySetting()} | change
    with pytest.raises(ValueError, match=message):
        particle_filter(**arguments)  # type: ignore[arg-type]


def test_few_particles_still_find_the_target(passage: tuple[Pings, Floats, Floats, ArraySetting]) -> None:
    pings, _, truth, setting = passage
    found = particle_filter(pings, SQUARE, setting, particles=200)
    assert np.linalg.norm(found.position - truth, axis=1).max() < 8  # a bound of 1.5 m, and 50 effective particles
