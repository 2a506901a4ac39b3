"""Particle filter on the arrivals at moored receivers: a causal track, position after position (Masmitja et al. 2020, PF).

The target's velocity changes by white acceleration (Eqs. 8-9, with the time that really passed between two pings). Particles are
paths of positions; of each the velocity is normal in closed form and need not be drawn (Schoen et al. 2005). One ping pins a
position down to a metre where the particles stand tens of metres apart, at the first ping hundreds: where too few would survive,
its likelihood is let in by stages, each followed by Metropolis moves that leave the posterior as it is (Del Moral et al. 2006).
The paper's errors are Gaussian; here a share of pings may by default be far off, else one outlier carries the track away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.eval.field.static_array.likelihood import check_pings
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions, arrival_information, level_places
from tagtrack.eval.field.static_array.stages import condition, effective_share, normalized, resample

PARTICLES = 6000
RESAMPLE_BELOW = 0.5  # effective share of the particles
STRAY_SHARE, STRAY_SCALE = 0.1, 100.0  # share of pings with an outlier, and their errors in sigma
LOST_AFTER = 3  # strays in a row
SMALLEST_EIGENVALUE = 1e-9  # of the largest; below it is rounding
SHORTEST_INTERVAL = 1e-3  # [s]; two rows of one time still have a motion between them


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
        stray_share: of pings taken to have errors a hundred times as large and passed over where that is more probable.
            After three such in a row the track is lost and starts anew. 0: all errors Gaussian of ``sigma``, as in the paper.
        seed: of the random numbers; the same seed gives the same track.
    Returns:
        position (K, n) and covariance (K, n, n); NaN before the first.
    Raises:
        ValueError: if the shapes disagree, receivers cannot locate, times are out of order, or there are no two particles.
    """
    places, rise = level_places(pings, receivers)
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
            above = None if rise is None else rise[k]
            misfit = Misfit(pings.arrival[k], known[k], places, setting.sound_speed, above)
            if begins:
                cloud, strays = _first_cloud(misfit, places, setting, particles, rng), 0
            else:
                interval = max(float(pings.time[k] - pings.time[k - 1]), SHORTEST_INTERVAL)
                cloud, stray = _next_cloud(cloud, misfit, interval, setting, stray_share, rng)
                strays = strays + 1 if stray else 0
            position[k], covariance[k] = cloud.summarize()
    return Positions(position=position, covariance=covariance)


class Misfit:
    """Of positions (n, N), minus the log likelihood of a ping: half the quadratic form of its residuals (model.py)."""

    def __init__(
        self, arrival: Floats, information: Floats, places: Floats, sound_speed: float, rise: Floats | None = None
    ) -> None:
        heard = np.isfinite(arrival)
        value, vector = np.linalg.eigh(information[np.ix_(heard, heard)])
        tells = value > SMALLEST_EIGENVALUE * value.max(initial=1.0)  # a common shift of all arrivals tells nothing
        self.root = (np.sqrt(0.5 * value[tells]) * vector[:, tells]).T
        self.measured = arrival[heard, None] - arrival[heard].mean() if heard.any() else np.zeros((0, 1))
        self.where, self.sound_speed = places[heard], sound_speed
        self.rise = np.zeros((int(heard.sum()), 1)) if rise is None else rise[heard, None]

    def __call__(self, position: Floats) -> Floats:
        square = (position[0] - self.where[:, 0, None]) ** 2
        for coordinate, place in zip(position[1:], self.where.T[1:], strict=True):
            square += (coordinate - place[:, None]) ** 2
        square += self.rise**2
        residual = self.root @ (self.measured - np.sqrt(square) / self.sound_speed)
        return np.einsum("ij,ij->j", residual, residual)

    def least_evidence(self, stray_share: float) -> float:
        """The log of the mean likelihood below which the ping is more probably a stray, its errors as good as unbounded."""
        if not stray_share or not len(self.root):
            return -np.inf
        return float(np.log(stray_share) - np.log1p(-stray_share) - len(self.root) * np.log(STRAY_SCALE))


@dataclass
class _Cloud:
    """N weighted particles: where each is, and how fast given where it has been."""

    position: Floats  # (n, N) [m]
    velocity: Floats  # (n, N) mean [m/s]
    velocity_variance: float  # of each axis, the same for all: it depends on the times alone [m^2/s^2]
    log_weight: Floats  # (N,), up to a constant

    def summarize(self) -> tuple[Floats, Floats]:
        """Mean (n,) and covariance (n, n) of the position."""
        weight = normalized(self.log_weight)
        mean = self.position @ weight
        offset = self.position - mean[:, None]
        return mean, (offset * weight) @ offset.T


def _first_cloud(
    misfit: Misfit, places: Floats, setting: ArraySetting, particles: int, rng: np.random.Generator
) -> _Cloud:
    low, high = grown_box(places)

    def prior(position: Floats, ancestor: Floats) -> Floats:
        return np.where(np.all((position >= low) & (position <= high), axis=0), 0.0, np.inf)

    start = rng.uniform(low, high, (len(low), particles))
    met = condition(start, np.zeros((0, particles)), np.zeros(particles), misfit, prior, rng)
    assert met is not None
    position, _, log_weight = met
    return _Cloud(position, np.zeros_like(position), setting.first_speed_sigma**2, log_weight)


def grown_box(places: Floats) -> tuple[Floats, Floats]:
    """Least and largest coordinates (n, 1) [m] of the array's box, grown on every side by its longest side."""
    low, high = places.min(axis=0), places.max(axis=0)
    margin = float((high - low).max())
    return (low - margin)[:, None], (high + margin)[:, None]


def _next_cloud(
    cloud: _Cloud, misfit: Misfit, interval: float, setting: ArraySetting, stray_share: float, rng: np.random.Generator
) -> tuple[_Cloud, bool]:
    """Move by velocity and white acceleration (Eq. 8), weigh, and learn each velocity from the way its particle went.

    Returns:
        The particles, and whether the ping was a stray and left them as predicted.
    """
    log_weight = cloud.log_weight
    ancestor = np.concatenate([cloud.position + interval * cloud.velocity, cloud.velocity])
    if effective_share(log_weight) < RESAMPLE_BELOW:
        ancestor = ancestor[:, resample(log_weight, rng)]
        log_weight = np.zeros_like(log_weight)
    dimensions = len(cloud.position)
    acceleration, speed = setting.acceleration_sigma**2, cloud.velocity_variance
    variance = interval**2 * speed + acceleration * interval**3 / 3  # of the way
    spread = np.sqrt(variance)

    def prior(position: Floats, ancestor: Floats) -> Floats:
        offset = (position - ancestor[:dimensions]) / spread
        return 0.5 * np.einsum("ij,ij->j", offset, offset)

    position = ancestor[:dimensions] + spread * rng.standard_normal(cloud.position.shape)
    met = condition(position, ancestor, log_weight, misfit, prior, rng, misfit.least_evidence(stray_share))
    if met is not None:
        position, ancestor, log_weight = met
    together = interval * speed + acceleration * interval**2 / 2  # covariance of the way and the velocity at its end
    gain = together / variance
    velocity = ancestor[dimensions:] + gain * (position - ancestor[:dimensions])
    return _Cloud(position, velocity, speed + acceleration * interval - gain * together, log_weight), met is None
