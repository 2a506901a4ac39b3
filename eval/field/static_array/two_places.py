"""Pings that two places explain alike: of three receivers two hyperbolas cross twice, and receivers in a line have a mirror."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.eval.field.static_array.likelihood import Likelihood, make_likelihood
from tagtrack.eval.field.static_array.maximum_likelihood import descend, start_places
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings

MARGIN = 4.5  # of the cost, by which another place may fit worse and still be the true one: three standard deviations
APART = 3.0  # standard deviations of the estimate, nearer than which another minimum is the same place
LEAST_APART = 2.0  # [m]
FLAT = 0.1  # breadth of the receivers that heard a ping over their length, below which they stand in a line


def other_places(pings: Pings, receivers: ArrayLike, setting: ArraySetting, position: Floats, covariance: Floats) -> Floats:
    """Another place (K, n) [m] that explains a ping as well as its estimate, as far as noise allows; NaN where there is none.

    Looked for where no more than one arrival is to spare, or the receivers that heard it stand nearly in a line.

    Args:
        position, covariance: (K, n) and (K, n, n) of the estimates.
    """
    likelihood = make_likelihood(pings, receivers, setting)
    others = np.full_like(position, np.nan)
    spare = likelihood.known_differences - likelihood.dimensions
    breadth = _breadths(np.asarray(receivers, np.float64), np.isfinite(np.asarray(pings.arrival)))
    rows = np.flatnonzero(np.isfinite(position).all(axis=1) & ((spare <= 1) | (breadth < FLAT)))
    if not rows.size:
        return others
    part, own = likelihood.take(rows), position[rows]
    cost = part.cost(own)
    sd = np.sqrt(np.linalg.eigvalsh(covariance[rows])[:, -1])
    best = np.full(rows.size, np.inf)
    starts = [np.tile(place, (rows.size, 1)) for place in start_places(part)]
    starts.append(_mirrored(part, own))
    for start in starts:
        found = descend(part, start)
        away = np.linalg.norm(found - own, axis=1)
        value = part.cost(found)
        better = (away > np.maximum(APART * sd, LEAST_APART)) & (value <= cost + MARGIN) & (value < best)
        best[better] = value[better]
        others[rows[better]] = found[better]
    return others


def _mirrored(likelihood: Likelihood, position: Floats) -> Floats:
    """Positions (K, n) mirrored in the line, or plane, along which the array is longest."""
    centred = likelihood.receivers - likelihood.centre
    normal = np.linalg.svd(centred, full_matrices=True)[2][-1]
    return np.asarray(position - 2.0 * ((position - likelihood.centre) @ normal)[:, None] * normal)


def _breadths(receivers: Floats, heard: np.ndarray) -> Floats:
    """(K,) smallest over largest spread of the receivers that heard each ping."""
    weight = heard / np.maximum(heard.sum(axis=1, keepdims=True), 1)
    mean = weight @ receivers
    second = np.einsum("kr,ra,rb->kab", weight, receivers, receivers) - mean[:, :, None] * mean[:, None, :]
    values = np.maximum(np.linalg.eigvalsh(second), 0.0)
    return np.asarray(np.sqrt(values[:, 0] / np.maximum(values[:, -1], 1e-12)))
