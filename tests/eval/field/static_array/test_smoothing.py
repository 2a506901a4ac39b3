"""Tracks from located pings: the walk, its choice, and the smoother."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from tagtrack.eval.field.static_array.smoothing import GATE, Walk, choose_walk, smooth


def simulate(walk: Walk, count: int, sigma: float, seed: int, step: float = 100.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (K,), true positions (K, 2) and pings (K, 2) of an animal that moves as ``walk``."""
    generator = np.random.default_rng(seed)
    time = np.cumsum(generator.uniform(0.6, 1.4, count) * step)
    state = generator.normal(size=4) * [0, walk.speed, 0, walk.speed]
    true = np.empty((count, 2))
    for k in range(count):
        if k:
            matrix, noise = walk.transition(time[k] - time[k - 1])
            state = generator.multivariate_normal(matrix @ state, noise, method="cholesky")
        true[k] = state[::2]
    return time, true, true + sigma * generator.normal(size=true.shape)


@pytest.mark.parametrize(("memory", "step"), [(300.0, 60.0), (30.0, 120.0), (3e4, 100.0), (3e4, 1.0)])
def test_transition_is_that_of_the_stochastic_differential_equation(memory: float, step: float) -> None:
    # Van Loan (1978): exp of [[-A, G], [0, A^T]] holds Phi and Q of dx = A x dt + noise.
    speed = 0.7
    drift = np.array([[0.0, 1.0], [0.0, -1.0 / memory]])
    power = np.diag([0.0, 2.0 * speed**2 / memory])
    loan = expm(step * np.block([[-drift, power], [np.zeros((2, 2)), drift.T]]))
    phi = loan[2:, 2:].T
    matrix, noise = Walk(speed=speed, memory=memory).transition(step)
    np.testing.assert_allclose(matrix[:2, :2], phi, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(noise[:2, :2], phi @ loan[:2, 2:], rtol=1e-6)
    np.testing.assert_allclose(noise[2:, 2:], noise[:2, :2])
    assert not noise[:2, 2:].any()


def test_smoother_is_the_exact_posterior_mean_of_a_gaussian_process() -> None:
    # Independent oracle: the joint covariance of all positions under the walk, conditioned on the pings by linear algebra.
    walk, count, sigma = Walk(speed=0.05, memory=500.0), 40, 2.0
    time, _, ping = simulate(walk, count, sigma, seed=1)
    covariance = np.tile(sigma**2 * np.eye(2), (count, 1, 1))
    track = smooth(time, ping, covariance, walk)
    assert not track.refused.any()
    lag = np.abs(time[:, None] - time)
    early = np.minimum(time[:, None], time) - time[0]
    tau, left = walk.memory, lambda t: np.exp(-t / walk.memory)
    # Covariance of the integral of a stationary Ornstein-Uhlenbeck velocity from the first ping to two times.
    moved = walk.speed**2 * tau * (
        2 * early - tau * (1 - left(time[:, None] - time[0]) - left(time - time[0]) + left(lag))
    )
    first = ping[:10]
    scatter = np.median(np.abs(first - np.median(first, axis=0)), axis=0) + sigma
    for axis in range(2):
        prior = moved + (2 * scatter[axis]) ** 2
        gain = prior @ np.linalg.inv(prior + sigma**2 * np.eye(count))
        middle = np.median(first[:, axis])
        np.testing.assert_allclose(track.position[:, axis], middle + gain @ (ping[:, axis] - middle), atol=1e-6)
        np.testing.assert_allclose(track.covariance[:, axis, axis], np.diag(prior - gain @ prior), rtol=1e-6)


def test_walk_is_recovered_from_its_pings() -> None:
    for walk in (Walk(speed=0.01, memory=3000.0), Walk(speed=0.1, memory=300.0)):
        time, _, ping = simulate(walk, 2000, 3.0, seed=2)
        assert choose_walk(time, ping, np.tile(9.0 * np.eye(2), (2000, 1, 1))) == walk


def test_smoothing_is_honest_about_its_error() -> None:
    walk = Walk(speed=0.02, memory=300.0)
    time, true, ping = simulate(walk, 2000, 5.0, seed=3)
    track = smooth(time, ping, np.tile(25.0 * np.eye(2), (2000, 1, 1)), walk)
    miss = track.position - true
    squared = np.einsum("ki,kij,kj->k", miss, np.linalg.inv(track.covariance), miss)
    assert squared.mean() == pytest.approx(2.0, abs=0.35)  # some 400 independent values of chi-square 2
    assert np.linalg.norm(miss, axis=1).mean() < 0.7 * np.linalg.norm(ping - true, axis=1).mean()


def test_ping_that_the_walk_cannot_explain_is_left_out() -> None:
    walk = Walk(speed=0.01, memory=300.0)
    time, _, ping = simulate(walk, 200, 2.0, seed=4)
    covariance = np.tile(4.0 * np.eye(2), (200, 1, 1))
    clean = smooth(time, ping, covariance, walk)
    wild = ping.copy()
    wild[[3, 100]] += 300.0
    track = smooth(time, wild, covariance, walk)
    assert track.refused[[3, 100]].all()
    assert np.linalg.norm(track.position - clean.position, axis=1).max() < 2.0  # what two of two hundred pings weigh
    assert clean.refused.mean() <= 0.02  # GATE refuses one in a thousand
    assert pytest.approx(0.001, rel=0.02) == np.exp(-GATE[2] / 2)


def test_track_can_be_given_at_other_times_than_the_pings() -> None:
    walk = Walk(speed=0.01, memory=300.0)
    time, _, ping = simulate(walk, 50, 2.0, seed=5)
    covariance = np.tile(4.0 * np.eye(2), (50, 1, 1))
    track = smooth(time, ping, covariance, walk)
    both = np.sort(np.concatenate([time, 0.5 * (time[1:] + time[:-1])]))
    dense = smooth(time, ping, covariance, walk, at=both)
    np.testing.assert_allclose(dense.position[::2], track.position, atol=1e-8)
    np.testing.assert_allclose(dense.covariance[::2], track.covariance, rtol=1e-6)
