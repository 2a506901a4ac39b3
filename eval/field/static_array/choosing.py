"""Which of two places a tag was at, where a ping fits both: the one from which its neighbours are reached."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.model import Floats

DECIDED = 4.5  # of the cost, by which the way through one place must be better than that through the other
MOST_COST = 25.0  # of one step: an outlier must not decide over all that follows
LEAST_SPEED = 1e-3  # [m/s]


def choose_places(
    time: Floats, position: Floats, other: Floats, covariance: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The shortest way through one place of each ping (min-sum over a chain), and where two ways are as short.

    A step of d metres in t seconds costs d^2 / 2 over the variance of both places and of a walk at the animal's usual speed.

    Args:
        time: (K,) [s], rising. position, other: (K, n) [m]; ``other`` NaN where there is one place. covariance: (K, n, n) [m^2].
    Returns:
        (K,) bool, whether it was at the ``other`` place; and (K,) bool, whether neighbours do not tell.
    """
    count = len(time)
    places = np.stack([position, other], axis=1)  # (K, 2, n)
    closed = np.asarray(~np.isfinite(places).all(axis=2))  # what is no place
    variance = np.trace(covariance, axis1=1, axis2=2)
    ahead, back = np.zeros((count, 2)), np.zeros((count, 2))
    ahead[closed], back[closed] = np.inf, np.inf
    step = _steps(time, places, variance)
    for k in range(1, count):
        ahead[k] += (ahead[k - 1][:, None] + step[k - 1]).min(axis=0)
    for k in range(count - 2, -1, -1):
        back[k] += (back[k + 1][None, :] + step[k]).min(axis=1)
    total = ahead + back
    at_other = total[:, 1] < total[:, 0]
    undecided = ~closed[:, 1] & (np.abs(np.where(closed, 0.0, total) @ np.array([1.0, -1.0])) < DECIDED)
    return at_other, undecided


def _steps(time: Floats, places: Floats, variance: Floats) -> Floats:
    """(K - 1, 2, 2) cost of going from each place of a ping to each of the next; infinite from or to what is none."""
    apart = np.linalg.norm(places[:-1, :, None] - places[1:, None, :], axis=-1)
    elapsed = np.maximum(np.diff(time), 1e-3)
    shortest = np.nanmin(np.where(np.isfinite(apart), apart, np.nan), axis=(1, 2)) if len(apart) else np.empty(0)
    speed = max(float(np.median(shortest / elapsed)), LEAST_SPEED) if shortest.size else LEAST_SPEED
    spread = variance[:-1] + variance[1:] + (speed * elapsed) ** 2
    cost = np.minimum(0.5 * apart**2 / spread[:, None, None], MOST_COST)
    return np.where(np.isfinite(apart), cost, np.inf)
