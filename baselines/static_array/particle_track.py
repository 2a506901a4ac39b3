"""Particle filter on the arrivals at moored receivers: a causal track, position after position (Masmitja et al. 2020, PF).

The target's velocity changes by white acceleration (Eqs. 8-9, with the time that really passed between two pings). Particles are
paths of positions; of each the velocity is normal in closed form and need not be drawn (Schoen et al. 2005). One ping pins a
position down to a metre where the particles stand tens of metres apart, at the first ping hundreds: where too few would survive,
its likelihood is let in by stages, each followed by Metropolis moves that leave the posterior as it is (Del Moral et al. 2006).
The paper's errors are Gaussian; here a share of pings may by default be far off, else one outlier carries the track away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
FEWEST_EFFECTIVE = 60  # particles that one update may leave: they know a mean to an eighth of its deviation
STAGE_SHARE = 0.25  # effective share that a stage leaves
MOVES = 2  # Metropolis moves after a stage
SMALLEST_MOVE, LARGEST_MOVE = 0.05, 2.0  # of the particles' own spread, drawn log-uniform: modes of any width are explored
STRAY_SHARE, STRAY_SCALE = 0.1, 100.0  # share of pings with an outlier, and their errors in sigma
LOST_AFTER, EVERY = 3, 20  # strays in a row; one particle in so many shows them
SMALLEST_EIGENVALUE = 1e-9  # of the largest; below it is rounding
SHORTEST_INTERVAL = 1e-3  # [s]; two rows of one time still have a motion between them

Misfit = Callable[[Floats], Floats]
Prior = Callable[[Floats, Floats], Floats]


def particle_filter(
    pings: Pings,
    receivers: ArrayLike,
    setting: ArraySetting,
    *,
    information: Floats | None = None,
    particles: int = PARTICLES,
    stray_share: float = STRAY_SHARE,
    seed: int = 0,
) -> Positions:
    """Mean and covariance of the particles after each ping, from it and those before.

    The first position comes with the first ping that n + 1 receivers heard: its particles start evenly over the array's box,
    grown on every side by its longest side, at velocities of ``setting.first_speed_sigma``. Later pings may be heard by fewer.

    Args:
        pings: K pings in order of time. receivers: (R, n) [m].
        setting: of it the speed of sound, ``sigma`` of an arrival, ``acceleration_sigma`` and ``first_speed_sigma``.
        information: (K, R, R) [1/s^2] of the arrivals; by default independent errors of ``setting.sigma``.
        particles: how many.
        stray_share: of pings taken to have errors a hundred times as large, so that one outlier does not carry the track away.
            After three such in a row the track is lost and starts anew. 0: all errors Gaussian of ``sigma``, as in the paper.
        seed: of the random numbers; the same seed gives the same track.
    Returns:
        position (K, n) and covariance (K, n, n); NaN before the first.
    Raises:
        ValueError: if the shapes disagree, receivers cannot locate, times are out of order, or there are no two particles.
    """
    places = check_receivers(receivers)
    check_pings(pings, places)
    if not 0 <= stray_share < 1:
        raise ValueError(f"stray_share must be in [0, 1), got {stray_share!r}")
    if particles < 2:
        raise ValueError(f"particles must be at least 2, got {particles}")
    dimensions = places.shape[1]
    known = arrival_information(pings.heard, setting.sigma) if information is None else information
    position = np.full((len(pings.time), dimensions), np.nan)
    covariance = np.full((len(pings.time), dimensions, dimensions), np.nan)
    located = np.flatnonzero(pings.heard.sum(axis=1) > dimensions)
    if located.size:
        rng = np.random.default_rng(seed)
        strays = LOST_AFTER
        for k in range(int(located[0]), len(pings.time)):
            begins = strays >= LOST_AFTER and k in located  # with a ping that is taken at its word
            misfit = _Misfit(pings.arrival[k], known[k], places, setting.sound_speed, 0.0 if begins else stray_share)
            if begins:
                cloud, strays = _first_cloud(misfit, places, setting, particles, rng), 0
            else:
                interval = max(float(pings.time[k] - pings.time[k - 1]), SHORTEST_INTERVAL)
                cloud = _next_cloud(cloud, misfit, interval, setting, rng)
                strays = strays + 1 if misfit(cloud.position[:, ::EVERY]).min() > misfit.astray else 0
            position[k], covariance[k] = cloud.summarize()
    return Positions(position=position, covariance=covariance)


class _Misfit:
    """Of positions (n, N), minus the log likelihood of a ping: half the quadratic form of its residuals (model.py), or astray."""

    def __init__(self, arrival: Floats, information: Floats, places: Floats, sound_speed: float, stray_share: float) -> None:
        heard = np.isfinite(arrival)
        value, vector = np.linalg.eigh(information[np.ix_(heard, heard)])
        tells = value > SMALLEST_EIGENVALUE * value.max(initial=1.0)  # a common shift of all arrivals tells nothing
        self.root = (np.sqrt(0.5 * value[tells]) * vector[:, tells]).T
        self.measured = arrival[heard, None] - arrival[heard].mean() if heard.any() else np.zeros((0, 1))
        self.where, self.sound_speed = places[heard], sound_speed
        self.astray = np.inf  # the cost that makes it as likely a stray
        if stray_share:
            self.astray = np.log1p(-stray_share) - np.log(stray_share) + tells.sum() * np.log(STRAY_SCALE)

    def __call__(self, position: Floats) -> Floats:
        square = (position[0] - self.where[:, 0, None]) ** 2
        for coordinate, place in zip(position[1:], self.where.T[1:], strict=True):
            square += (coordinate - place[:, None]) ** 2
        residual = self.root @ (self.measured - np.sqrt(square) / self.sound_speed)
        cost = np.einsum("ij,ij->j", residual, residual)
        return cost if np.isinf(self.astray) else -np.logaddexp(-cost, -self.astray - cost / STRAY_SCALE**2)


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
    position: Floats, ancestor: Floats, log_weight: Floats, misfit: Misfit, prior: Prior, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Let in a ping, by stages where it would leave too few particles.

    Args:
        position: (n, N) drawn from the prior. ancestor: (d, N), what the prior of each is conditioned on, carried along.
        misfit, prior: minus the log of likelihood and prior density.
    Returns:
        position, ancestor and log weight after it.
    """
    let_in, cost = 0.0, misfit(position)
    fewest = min(FEWEST_EFFECTIVE / log_weight.size, STAGE_SHARE)
    while _effective_share(log_weight - (1 - let_in) * cost) < fewest:
        step = _next_stage(log_weight, cost, 1 - let_in)
        chosen = _resample(log_weight - step * cost, rng)
        let_in += step
        position, ancestor, cost = position[:, chosen], ancestor[:, chosen], cost[chosen]
        log_weight = np.zeros_like(log_weight)
        for _ in range(MOVES):
            position, cost = _move(position, ancestor, cost, let_in, misfit, prior, rng)
    return position, ancestor, log_weight - (1 - let_in) * cost


def _move(
    position: Floats, ancestor: Floats, cost: Floats, let_in: float, misfit: Misfit, prior: Prior, rng: np.random.Generator
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


def _resample(log_weight: Floats, rng: np.random.Generator) -> NDArray[np.intp]:
    """Ancestors (N,) by systematic resampling."""
    total = np.cumsum(_normalized(log_weight))
    passed = np.ceil(total / total[-1] * total.size - rng.random()).astype(np.intp)  # pointers below the end of each share
    return np.repeat(np.arange(total.size), np.diff(passed, prepend=0))
