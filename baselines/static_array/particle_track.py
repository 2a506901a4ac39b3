"""Particle filter on the arrivals at moored receivers: a causal track, position after position (Masmitja et al. 2020, PF).

The target's velocity changes by white acceleration (Eqs. 8-9, with the time that really passed between two pings). Particles are
paths of positions; of each the velocity is normal in closed form and need not be drawn (Schoen et al. 2005). One ping pins a
position down to a metre where the particles stand tens of metres apart, at the first ping hundreds: where too few would survive,
its likelihood is let in by stages, each followed by Metropolis moves that leave the posterior as it is (Del Moral et al. 2006).
The errors are Gaussian as in the paper: outliers drag the track.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.baselines.static_array.likelihood import check_pings
from tagtrack.baselines.static_array.model import (
    ArraySetting,
    Floats,
    Pings,
    Positions,
    arrival_information,
    check_receivers,
)

PARTICLES = 6000
RESAMPLE_BELOW = 0.5  # effective share of the particles
TEMPER_BELOW = 0.02  # effective share that one update may leave: 120 of 6000 know a mean to a tenth of its deviation
STAGE_SHARE = 0.25  # effective share that a stage leaves
MOVES = 2  # Metropolis moves after a stage
SMALLEST_MOVE, LARGEST_MOVE = 0.05, 2.0  # of the particles' own spread, drawn log-uniform: modes of any width are explored
SMALLEST_EIGENVALUE = 1e-9  # of the largest; below it is rounding
SHORTEST_INTERVAL = 1e-3  # [s]; two rows of one time still have a motion between them

Misfit = Callable[[Floats], Floats]


def particle_filter(
    pings: Pings,
    receivers: ArrayLike,
    setting: ArraySetting,
    *,
    information: Floats | None = None,
    particles: int = PARTICLES,
    seed: int = 0,
) -> Positions:
    """Mean and covariance of the particles after each ping, from it and those before.

    The first position comes with the first ping that n + 1 receivers heard: its particles start evenly over the array's box,
    grown on every side by its longest side, at velocities of ``setting.first_speed_sigma``. Later pings may be heard by fewer.

    Args:
        pings: K pings in order of time. receivers: (R, n) [m].
        setting: of it the speed of sound, ``sigma`` of an arrival, ``acceleration_sigma`` and ``first_speed_sigma``.
        information: (K, R, R) [1/s^2] of the arrivals; by default independent errors of ``setting.sigma``.
        particles: how many. seed: of their random numbers; the same seed gives the same track.
    Returns:
        position (K, n) and covariance (K, n, n); NaN before the first.
    Raises:
        ValueError: if the shapes disagree, receivers cannot locate, times are out of order, or there are no two particles.
    """
    places = check_receivers(receivers)
    check_pings(pings, places)
    if particles < 2:
        raise ValueError(f"particles must be at least 2, got {particles}")
    dimensions = places.shape[1]
    known = arrival_information(pings.heard, setting.sigma) if information is None else information
    position = np.full((len(pings.time), dimensions), np.nan)
    covariance = np.full((len(pings.time), dimensions, dimensions), np.nan)
    located = np.flatnonzero(pings.heard.sum(axis=1) > dimensions)
    if located.size:
        rng = np.random.default_rng(seed)
        misfits = [_misfit_of(*ping, places, setting.sound_speed) for ping in zip(pings.arrival, known, strict=True)]
        first = int(located[0])
        cloud = _first_cloud(misfits[first], places, setting, particles, rng)
        position[first], covariance[first] = cloud.summarize()
        for k in range(first + 1, len(pings.time)):
            interval = max(float(pings.time[k] - pings.time[k - 1]), SHORTEST_INTERVAL)
            cloud = _next_cloud(cloud, misfits[k], interval, setting, rng)
            position[k], covariance[k] = cloud.summarize()
    return Positions(position=position, covariance=covariance)


@dataclass
class _Cloud:
    """N weighted particles: where each is, and how fast given where it has been."""

    position: Floats  # (n, N) [m]
    velocity: Floats  # (n, N) mean [m/s]
    velocity_variance: float  # of each axis, the same for all: it depends on the times alone [m^2/s^2]
    log_weight: Floats  # (N,), up to a constant

    def summarize(self) -> tuple[Floats, Floats]:
        """Mean (n,) and covariance (n, n) of the position."""
        weight = _normalized(self.log_weight)
        mean = self.position @ weight
        offset = self.position - mean[:, None]
        return mean, (offset * weight) @ offset.T


def _first_cloud(
    misfit: Misfit, places: Floats, setting: ArraySetting, particles: int, rng: np.random.Generator
) -> _Cloud:
    low, high = places.min(axis=0), places.max(axis=0)
    margin = float((high - low).max())
    low, high = (low - margin)[:, None], (high + margin)[:, None]

    def prior(position: Floats, ancestor: Floats) -> Floats:
        return np.where(np.all((position >= low) & (position <= high), axis=0), 0.0, np.inf)

    start = rng.uniform(low, high, (len(low), particles))
    position, _, log_weight = _condition(start, np.zeros((0, particles)), np.zeros(particles), misfit, prior, rng)
    return _Cloud(position, np.zeros_like(position), setting.first_speed_sigma**2, log_weight)


def _next_cloud(
    cloud: _Cloud, misfit: Misfit, interval: float, setting: ArraySetting, rng: np.random.Generator
) -> _Cloud:
    """Move by velocity and white acceleration (Eq. 8), weigh, and learn each velocity from the way its particle went."""
    log_weight = cloud.log_weight
    ancestor = np.concatenate([cloud.position + interval * cloud.velocity, cloud.velocity])
    if _effective_share(log_weight) < RESAMPLE_BELOW:
        ancestor = ancestor[:, _resample(log_weight, rng)]
        log_weight = np.zeros_like(log_weight)
    dimensions = len(cloud.position)
    acceleration, speed = setting.acceleration_sigma**2, cloud.velocity_variance
    variance = interval**2 * speed + acceleration * interval**3 / 3  # of the way
    spread = np.sqrt(variance)

    def prior(position: Floats, ancestor: Floats) -> Floats:
        offset = (position - ancestor[:dimensions]) / spread
        return 0.5 * np.einsum("ij,ij->j", offset, offset)

    predicted = ancestor[:dimensions] + spread * rng.standard_normal(cloud.position.shape)
    position, ancestor, log_weight = _condition(predicted, ancestor, log_weight, misfit, prior, rng)
    together = interval * speed + acceleration * interval**2 / 2  # covariance of the way and the velocity at its end
    gain = together / variance
    velocity = ancestor[dimensions:] + gain * (position - ancestor[:dimensions])
    return _Cloud(position, velocity, speed + acceleration * interval - gain * together, log_weight)


def _condition(
    position: Floats,
    ancestor: Floats,
    log_weight: Floats,
    misfit: Misfit,
    prior: Callable[[Floats, Floats], Floats],
    rng: np.random.Generator,
) -> tuple[Floats, Floats, Floats]:
    """Let in a ping, by stages where it would leave too few particles.

    Args:
        position: (n, N) drawn from the prior. ancestor: (d, N), what the prior of each is conditioned on, carried along.
        misfit, prior: minus the log of likelihood and prior density.
    Returns:
        position, ancestor and log weight after it.
    """
    let_in, cost = 0.0, misfit(position)
    while _effective_share(log_weight - (1 - let_in) * cost) < TEMPER_BELOW:
        step = _next_stage(log_weight, cost, 1 - let_in)
        chosen = _resample(log_weight - step * cost, rng)
        let_in += step
        position, ancestor, cost = position[:, chosen], ancestor[:, chosen], cost[chosen]
        log_weight = np.zeros_like(log_weight)
        for _ in range(MOVES):
            position, cost = _move(position, ancestor, cost, let_in, misfit, prior, rng)
    return position, ancestor, log_weight - (1 - let_in) * cost


def _move(
    position: Floats,
    ancestor: Floats,
    cost: Floats,
    let_in: float,
    misfit: Misfit,
    prior: Callable[[Floats, Floats], Floats],
    rng: np.random.Generator,
) -> tuple[Floats, Floats]:
    """One Metropolis move of every particle. Returns position and misfit."""
    covariance = np.cov(position)
    floor = 1e-12 * max(float(np.trace(covariance)), 1e-6)
    shape = np.linalg.cholesky(covariance + floor * np.eye(len(position)))
    size = np.exp(rng.uniform(np.log(SMALLEST_MOVE), np.log(LARGEST_MOVE), position.shape[1]))
    proposed = position + size * (shape @ rng.standard_normal(position.shape))
    new_cost = misfit(proposed)
    gain = prior(position, ancestor) - prior(proposed, ancestor) + let_in * (cost - new_cost)
    accepted = rng.standard_exponential(gain.size) > -gain
    return np.where(accepted, proposed, position), np.where(accepted, new_cost, cost)


def _misfit_of(arrival: Floats, information: Floats, places: Floats, sound_speed: float) -> Misfit:
    """Of positions (n, N), half the quadratic form of their arrival residuals (model.py)."""
    heard = np.isfinite(arrival)
    value, vector = np.linalg.eigh(information[np.ix_(heard, heard)])
    tells = value > SMALLEST_EIGENVALUE * value.max(initial=1.0)  # a common shift of all arrivals tells nothing
    if not tells.any():
        return lambda position: np.zeros(position.shape[1])
    root = (np.sqrt(0.5 * value[tells]) * vector[:, tells]).T
    measured = arrival[heard] - arrival[heard].mean()
    where = places[heard]

    def misfit(position: Floats) -> Floats:
        square = (position[0] - where[:, 0, None]) ** 2
        for coordinate, place in zip(position[1:], where.T[1:], strict=True):
            square += (coordinate - place[:, None]) ** 2
        residual = root @ (measured[:, None] - np.sqrt(square) / sound_speed)
        return np.einsum("ij,ij->j", residual, residual)

    return misfit


def _next_stage(log_weight: Floats, cost: Floats, most: float) -> float:
    """The share of the likelihood, below ``most``, that leaves ``STAGE_SHARE`` of the particles effective; by bisection."""
    low, high = np.log(most) - 40.0, np.log(most)
    for _ in range(10):
        middle = 0.5 * (low + high)
        if _effective_share(log_weight - np.exp(middle) * cost) < STAGE_SHARE:
            high = middle
        else:
            low = middle
    return float(np.exp(high))


def _normalized(log_weight: Floats) -> Floats:
    weight = np.exp(log_weight - log_weight.max())
    return weight / weight.sum()


def _effective_share(log_weight: Floats) -> float:
    weight = np.exp(log_weight - log_weight.max())
    return float(weight.sum() ** 2 / (weight @ weight)) / weight.size


def _resample(log_weight: Floats, rng: np.random.Generator) -> np.ndarray:
    """Ancestors (N,) by systematic resampling."""
    total = np.cumsum(_normalized(log_weight))
    passed = np.ceil(total / total[-1] * total.size - rng.random()).astype(np.intp)  # pointers below the end of each share
    return np.repeat(np.arange(total.size), np.diff(passed, prepend=0))
