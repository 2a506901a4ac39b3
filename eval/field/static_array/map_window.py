"""MAP-M: maximum a posteriori over a window of pings, older ones marginalized (Masmitja et al. 2020, Fig. 2; Eqs. 7-11).

The oldest state leaves the window as a Gaussian on the next (the Schur complement of the Hessian), linearized where it was last
estimated. The paper gives no window. Each position comes from its own ping and those before, as for an animal tracked live.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.eval.field.static_array.block_tridiagonal import diagonal_of_inverse
from tagtrack.eval.field.static_array.likelihood import Likelihood, make_likelihood
from tagtrack.eval.field.static_array.map_track import TrackPosterior, descend_robustly, make_track
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions

WINDOW = 15  # pings
MOST_REWEIGHTINGS = 5  # for each new ping


def map_marginal(
    pings: Pings,
    receivers: ArrayLike,
    setting: ArraySetting,
    *,
    information: Floats | None = None,
    robust: bool = False,
    window: int = WINDOW,
) -> Positions:
    """The newest position of each window, with its covariance: causal, and a fixed effort for each ping.

    Args, Returns, Raises: as ``maximum_a_posteriori``.
        window: how many pings are estimated together; 1 is an iterated extended Kalman filter.
    """
    if window < 1:
        raise ValueError(f"window must be at least 1 ping, got {window}")
    likelihood = make_likelihood(pings, receivers, setting, information)
    count = likelihood.dimensions
    position = np.empty((len(likelihood), count))
    covariance = np.empty((len(likelihood), count, count))
    if not len(likelihood):
        return Positions(position=position, covariance=covariance)
    fixes = wls_ml(pings, receivers, setting, information=information).position
    first = np.where(np.isfinite(fixes[0]), fixes[0], likelihood.centre)
    whole = make_track(likelihood, np.diff(pings.time), setting, first)
    oldest, state = 0, np.empty((0, 2 * count))
    prior = _Gaussian(whole.first, _inverse(whole.first_precision))  # of the oldest
    ahead = prior  # of the newest, before its ping
    for newest in range(len(likelihood)):
        state = np.concatenate([state, _start(ahead, fixes[newest], likelihood.take(slice(newest, newest + 1)))[None]])
        part = _window(whole, oldest, newest, prior)
        state = part.descend(state)
        if robust:
            part, state = descend_robustly(part, state, MOST_REWEIGHTINGS)
        spread = diagonal_of_inverse(part.diagonal(part.likelihood.derivatives(state[:, :count])), part.above)[-1]
        position[newest], covariance[newest] = state[-1, :count], spread[:count, :count]
        if newest + 1 < len(likelihood):
            ahead = _predict(whole, newest, state[-1], spread)
        if len(state) == window and newest + 1 < len(likelihood):
            prior = _marginalize(part, whole, oldest, state[0])
            oldest, state = oldest + 1, state[1:]
    return Positions(position=position, covariance=covariance)


class _Gaussian(NamedTuple):
    """What is known of a state."""

    mean: Floats  # (2n,)
    covariance: Floats  # (2n, 2n)


def _inverse(matrix: Floats) -> Floats:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _window(whole: TrackPosterior, oldest: int, newest: int, prior: _Gaussian) -> TrackPosterior:
    """The track from one ping to another, with what the older ones tell as the prior of its first state."""
    return replace(
        whole,
        likelihood=whole.likelihood.take(slice(oldest, newest + 1)),
        transition=whole.transition[oldest:newest],
        precision=whole.precision[oldest:newest],
        first=prior.mean,
        first_precision=_inverse(prior.covariance),
    )


def _start(ahead: _Gaussian, fix: Floats, ping: Likelihood) -> Floats:
    """Where the newest state (2n,) starts: as predicted, or at the fix of its ping where motion and ping together prefer that."""
    mean, covariance = ahead
    count = len(fix)
    if not np.isfinite(fix).all():
        return mean
    jump = np.concatenate([fix - mean[:count], np.zeros(count)])
    moved = 0.5 * jump[:count] @ np.linalg.solve(covariance[:count, :count], jump[:count])
    better = moved + ping.cost(fix[None])[0] < ping.cost(mean[None, :count])[0]
    return mean + jump if better else mean


def _predict(whole: TrackPosterior, index: int, mean: Floats, covariance: Floats) -> _Gaussian:
    """The state at the ping after ``index``, from a mean (2n,) and a covariance (2n, 2n) at that."""
    transition = whole.transition[index]
    noise = _inverse(whole.precision[index])
    return _Gaussian(transition @ mean, transition @ covariance @ transition.T + noise)


def _marginalize(part: TrackPosterior, whole: TrackPosterior, oldest: int, state: Floats) -> _Gaussian:
    """The oldest state (2n,) with its ping as a Gaussian on the next."""
    count = part.likelihood.dimensions
    ping = part.likelihood.take(slice(0, 1)).derivatives(state[None, :count])
    precision = part.first_precision.copy()
    precision[:count, :count] += ping.information[0]
    pull = part.first_precision @ (part.first - state)
    pull[:count] -= ping.gradient[0]
    covariance = _inverse(precision)
    return _predict(whole, oldest, state + covariance @ pull, covariance)
