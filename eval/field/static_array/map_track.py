"""The whole track at once: maximum a posteriori under random acceleration (Masmitja et al. 2020, Eqs. 7-11).

A state is position and velocity, [q, v] for each ping; the paper interleaves them axis by axis. Between pings, at their actual
times, acceleration is white noise. A ping that no receiver or one receiver heard still has a position, from its neighbours, and
two arrivals count as the one difference they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import median_filter

from tagtrack.eval.field.static_array.block_tridiagonal import diagonal_of_inverse, solve
from tagtrack.eval.field.static_array.likelihood import Derivatives, Likelihood, make_likelihood
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions
from tagtrack.eval.field.static_array.robust import reweigh

MOST_STEPS = 60
SHORTEST_STEP = 1e-3  # [m]
FIRST_DAMPING = 1e-3
SHORTEST_INTERVAL = 1e-3  # [s]: pings at one time would have no process noise between them
FIRST_SPANS = 10.0  # spans of the array: standard deviation of the prior of the first position
SMOOTHED = 5  # pings whose median position begins the descent, so that one wild fix does not
REWEIGHTINGS = 20
SETTLED = 0.01  # [m] that reweighting still moves a position


def maximum_a_posteriori(
    pings: Pings,
    receivers: ArrayLike,
    setting: ArraySetting,
    *,
    information: Floats | None = None,
    robust: bool = False,
) -> Positions:
    """The most probable track, each position from all pings before and after, with its covariance.

    Args:
        pings: arrivals (K, R) [s], in order of time.
        receivers: (R, n) [m].
        information: (K, R, R) [1/s^2]; by default independent arrival errors of ``setting.sigma``.
        robust: weigh arrivals that disagree with others and the track less (Student's t).
    Returns:
        A position for every ping; far from any fix its covariance says how little is known.
    Raises:
        ValueError: if the shapes disagree or pings are not in order.
    """
    likelihood = make_likelihood(pings, receivers, setting, information)
    count = likelihood.dimensions
    if not len(likelihood):
        return Positions(position=np.empty((0, count)), covariance=np.empty((0, count, count)))
    fixes = wls_ml(pings, receivers, setting, information=information).position
    start = _interpolate(np.asarray(pings.time, dtype=np.float64), fixes, likelihood.centre)
    track = make_track(likelihood, np.diff(pings.time), setting, first=start[0])
    state = track.descend(np.concatenate([start, np.zeros_like(start)], axis=1))
    if robust:
        track, state = descend_robustly(track, state)
    hessian = track.diagonal(track.likelihood.derivatives(state[:, :count]))
    covariance = diagonal_of_inverse(hessian, track.above)
    return Positions(position=state[:, :count], covariance=covariance[:, :count, :count])


@dataclass(frozen=True, kw_only=True)
class TrackPosterior:
    """The cost of K states (K, 2n) (Eq. 11): a Gaussian prior on the first, motion between them, and the pings."""

    likelihood: Likelihood
    transition: Floats  # (K - 1, 2n, 2n) Phi (Eq. 9)
    precision: Floats  # (K - 1, 2n, 2n) inverse of Q
    first: Floats  # (2n,) mean of the prior
    first_precision: Floats  # (2n, 2n) its inverse covariance

    @property
    def above(self) -> Floats:
        """(K - 1, 2n, 2n): the Hessian's blocks above the diagonal."""
        return -self.transition.swapaxes(1, 2) @ self.precision

    def diagonal(self, pings: Derivatives) -> Floats:
        """(K, 2n, 2n): its blocks on the diagonal, Gauss-Newton."""
        count = self.likelihood.dimensions
        blocks = np.zeros((len(self.likelihood), 2 * count, 2 * count))
        blocks[:, :count, :count] = pings.information
        blocks[0] += self.first_precision
        blocks[1:] += self.precision
        blocks[:-1] -= self.above @ self.transition
        return blocks

    def gradient(self, state: Floats, pings: Derivatives) -> Floats:
        """(K, 2n)."""
        value = np.zeros_like(state)
        value[:, : self.likelihood.dimensions] = pings.gradient
        pull = np.einsum("kab,kb->ka", self.precision, self._surprise(state))
        value[1:] += pull
        value[:-1] -= np.einsum("kba,kb->ka", self.transition, pull)
        value[0] += self.first_precision @ (state[0] - self.first)
        return value

    def cost(self, state: Floats, pings: Derivatives) -> float:
        """Eq. 11."""
        surprise, start = self._surprise(state), state[0] - self.first
        motion = np.sum(surprise * np.einsum("kab,kb->ka", self.precision, surprise))
        return float(pings.cost.sum() + 0.5 * motion + 0.5 * start @ self.first_precision @ start)

    def descend(self, state: Floats, most_steps: int = MOST_STEPS) -> Floats:
        """States (K, 2n) of least cost by Gauss-Newton steps (Levenberg), from given ones."""
        count, above, damping = self.likelihood.dimensions, self.above, 0.0
        pings = self.likelihood.derivatives(state[:, :count])
        cost = self.cost(state, pings)
        for _ in range(most_steps):
            mean = np.trace(pings.information, axis1=1, axis2=2) / count
            blocks = self.diagonal(pings)
            blocks[:, range(count), range(count)] += damping * mean[:, None]
            step = -solve(blocks, above, self.gradient(state, pings))
            trial = self.likelihood.derivatives((state + step)[:, :count])
            new = self.cost(state + step, trial)
            if new <= cost:
                state, pings, cost = state + step, trial, new
                damping = damping / 10 if damping > FIRST_DAMPING else 0.0
            else:
                damping = max(10 * damping, FIRST_DAMPING)
            if np.abs(step[:, :count]).max() < SHORTEST_STEP:
                break
        return state

    def _surprise(self, state: Floats) -> Floats:
        """What acceleration added to each state but the first (K - 1, 2n)."""
        return state[1:] - np.einsum("kab,kb->ka", self.transition, state[:-1])


def make_track(likelihood: Likelihood, interval: Floats, setting: ArraySetting, first: Floats) -> TrackPosterior:
    """The cost of a track of K pings, ``interval`` (K - 1,) [s] apart, whose first position is about ``first`` (n,) [m]."""
    count = likelihood.dimensions
    transition, precision = white_acceleration(interval, setting.acceleration_sigma, count)
    spread = np.repeat([FIRST_SPANS * likelihood.span, setting.first_speed_sigma], count)
    return TrackPosterior(
        likelihood=likelihood,
        transition=transition,
        precision=precision,
        first=np.concatenate([first, np.zeros(count)]),
        first_precision=np.diag(spread**-2.0),
    )


def white_acceleration(interval: Floats, sigma: float, dimensions: int) -> tuple[Floats, Floats]:
    """Phi (Eq. 9) and the inverse of Q (K, 2n, 2n) of states [q, v] for intervals (K,) [s]; ``sigma`` in m/s^1.5.

    Q = sigma^2 [[dt^3 / 3, dt^2 / 2], [dt^2 / 2, dt]] on each axis.
    """
    step = np.maximum(interval, SHORTEST_INTERVAL)[:, None, None] * np.eye(dimensions)
    one = np.broadcast_to(np.eye(dimensions), step.shape)
    inverse = np.where(one > 0, 1.0 / np.where(one > 0, step, 1.0), 0.0)
    transition = np.block([[one, step], [0 * one, one]])
    precision = np.block([[12 * inverse**3, -6 * inverse**2], [-6 * inverse**2, 4 * inverse]]) / sigma**2
    return transition, precision


def descend_robustly(
    track: TrackPosterior, state: Floats, most_reweightings: int = REWEIGHTINGS
) -> tuple[TrackPosterior, Floats]:
    """The track under Student's t from one under Gaussian errors, and the cost that it minimizes at last."""
    count, nominal = track.likelihood.dimensions, track.likelihood
    variance = np.zeros_like(nominal.arrival)
    for _ in range(most_reweightings):
        likelihood, variance = reweigh(nominal, track.likelihood, variance, state[:, :count])
        track = replace(track, likelihood=likelihood)
        state, before = track.descend(state), state
        if np.abs(state - before)[:, :count].max() < SETTLED:
            break
    return track, state


def _interpolate(time: Floats, fixes: Floats, centre: Floats) -> Floats:
    """Positions (K, n) to start from: fixes without the wild ones, in between by time, the centre where there is no fix."""
    known = np.isfinite(fixes).all(axis=1)
    if not known.any():
        return np.tile(centre, (len(fixes), 1))
    smooth = median_filter(fixes[known], size=(SMOOTHED, 1), mode="nearest")
    return np.stack([np.interp(time, time[known], axis) for axis in smooth.T], axis=1)
