"""Pings that two places explain alike: of three receivers two hyperbolas cross twice, and receivers in a line have a mirror."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import minimum_filter

from tagtrack.eval.field.static_array.likelihood import Likelihood, make_likelihood
from tagtrack.eval.field.static_array.maximum_likelihood import descend, start_places
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings

MARGIN = {2: 6.9, 3: 8.1}  # of the cost, by which another place may fit worse and still be true: half of chi2's 99.9 % quantile
APART = 3.0  # standard deviations of the estimate, nearer than which another minimum is the same place
LEAST_APART = 2.0  # [m]
BEYOND = 4.5  # standard deviations, farther than which a place in the same valley is another one: its ellipse is too short
FIRST_STEPS = 4  # of a descent; where two have come near each other by then, one goes on
GRID = 5  # places along each axis of a square twice as wide as the array
VALLEY_STEPS = 60  # at most, each way
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
    breadth, margin = _breadths(likelihood.receivers, np.isfinite(np.asarray(pings.arrival))), MARGIN[likelihood.dimensions]
    rows = np.flatnonzero(np.isfinite(position).all(axis=1) & ((spare <= 1) | (breadth < FLAT)))
    if not rows.size:
        return others
    part, own = likelihood.take(rows), position[rows]
    cost = part.cost(own)
    sd = np.sqrt(np.linalg.eigvalsh(covariance[rows])[:, -1])
    near = np.maximum(APART * sd, LEAST_APART)
    best = np.full(rows.size, np.inf)
    starts = [np.tile(place, (rows.size, 1)) for place in start_places(part)]
    starts += [_mirrored(part, own), *_hollows(part)]
    for row, place in _descend_apart(part, own, near, starts):
        value = part.take(row).cost(place)
        away = np.linalg.norm(place - own[row], axis=1)
        better = (away > near[row]) & (value <= cost[row] + margin) & (value < best[row])
        best[row[better]] = value[better]
        others[rows[row[better]]] = place[better]
    for way in (-1.0, 1.0):
        end = _follow_valley(part, own, sd, way)
        far = (np.linalg.norm(end - own, axis=1) > np.maximum(BEYOND * sd, LEAST_APART)) & np.isinf(best)
        others[rows[far]] = end[far]
    return others


def _descend_apart(
    likelihood: Likelihood, own: Floats, near: Floats, starts: Sequence[Floats]
) -> Iterator[tuple[NDArray[np.intp], Floats]]:
    """Minima (M, n) of rows (M,) from starts (K, n), without those whose first steps lead to the estimate or to one another."""
    on_the_way = [own]
    for start in starts:
        begun = descend(likelihood, start, FIRST_STEPS)
        apart = [np.linalg.norm(begun - other, axis=1) for other in on_the_way]
        alone = np.isfinite(begun).all(axis=1) & ~np.any([each <= near for each in apart], axis=0)
        on_the_way.append(np.where(alone[:, None], begun, np.nan))
        row = np.flatnonzero(alone)
        yield row, descend(likelihood.take(row), begun[row])


def _hollows(likelihood: Likelihood) -> list[Floats]:
    """Places (K, n) all about the array from which descents may begin: where a coarse grid has none lower beside it, else NaN."""
    shape = (GRID,) * likelihood.dimensions
    reach = np.linspace(-likelihood.span, likelihood.span, GRID)
    grid = likelihood.centre + np.stack(np.meshgrid(*[reach] * likelihood.dimensions, indexing="ij"), axis=-1)
    places = grid.reshape(-1, likelihood.dimensions)
    cost = np.stack([likelihood.cost(np.tile(place, (len(likelihood), 1))) for place in places])
    about = minimum_filter(cost.reshape(*shape, -1), size=(*[3] * likelihood.dimensions, 1), mode="nearest")
    lowest = cost <= about.reshape(len(places), -1)
    return [np.where(low[:, None], place, np.nan) for low, place in zip(lowest, places, strict=True)]


def _follow_valley(likelihood: Likelihood, position: Floats, sd: Floats, way: float) -> Floats:
    """Where the valley of the cost through minima (K, n) has risen by MARGIN, one way along it: where the ping may as well be.

    Where receivers are few the cost is a bent and narrow valley, which an ellipse about its bottom follows for a short way only.
    """
    place, cost = position.copy(), likelihood.cost(position)
    course = np.zeros_like(position)
    going = np.isfinite(sd)
    for _ in range(VALLEY_STEPS):
        rows = np.flatnonzero(going)
        if not rows.size:
            break
        part, here = likelihood.take(rows), place[rows]
        along = _softest(part.derivatives(here).information)
        turned = np.einsum("kn,kn->k", along, course[rows])
        along *= np.where(turned == 0.0, way, np.sign(turned))[:, None]
        trial = here + np.minimum(sd[rows], likelihood.span / 20.0)[:, None] * along
        for _ in range(2):  # back to the bottom, across the valley
            now = part.derivatives(trial)
            across = now.gradient - np.einsum("kn,kn->k", now.gradient, along)[:, None] * along
            stiff = np.linalg.eigvalsh(now.information)[:, -1]
            trial = trial - across / np.maximum(stiff, 1e-12)[:, None]
        within = np.isfinite(trial).all(axis=1) & (part.cost(trial) <= cost[rows] + MARGIN[likelihood.dimensions])
        place[rows[within]], course[rows] = trial[within], along
        going[rows[~within]] = False
    return place


def _softest(information: Floats) -> Floats:
    """(K, n) the direction in which least is known."""
    return np.asarray(np.linalg.eigh(information)[1][:, :, 0])


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
