"""Places from distances, and their placing on reference points (Masmitja et al. 2020: "using these distances and trigonometry",
"adjusted using a rotation matrix and a translation matrix").

A start by multidimensional scaling (Torgerson 1952), least squares from there, and the best rotation after Kabsch 1976.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import orthogonal_procrustes
from scipy.optimize import least_squares
from scipy.sparse.csgraph import connected_components, shortest_path

from tagtrack.eval.field.static_array.model import Floats

SMALLEST_SD = 0.01  # of a distance [m]; keeps one that happens to repeat itself from carrying all the weight


@dataclass(frozen=True, kw_only=True)
class Places:
    """R places in the plane, with an unknown position, bearing and mirror image of the whole."""

    position: Floats  # (R, 2) [m], about their mean
    covariance: Floats  # (2R, 2R) [m^2], x and y of each place in turn, of the shape alone
    residual: Floats  # (M,) measured less fitted distance [m]

    @property
    def sd(self) -> Floats:
        """(R, 2) of x and y [m]."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).reshape(-1, 2)


@dataclass(frozen=True, kw_only=True)
class Placing:
    """place -> rotation @ place + translation."""

    rotation: Floats  # (2, 2), with a determinant of -1 where it mirrors
    translation: Floats  # (2,) [m]
    residual: Floats  # (P, 2) of reference points, less the placed ones [m]

    def move(self, position: Floats) -> Floats:
        """Points (P, 2) where they belong."""
        return np.asarray(position @ self.rotation.T + self.translation)

    def place(self, places: Places) -> Places:
        """The places where they belong; the error of the reference points is not added."""
        count = len(places.position)
        turn = np.kron(np.eye(count), self.rotation)
        return Places(position=self.move(places.position), covariance=turn @ places.covariance @ turn.T, residual=places.residual)


def places_from_distances(pairs: ArrayLike, distance: ArrayLike, sd: ArrayLike, start: ArrayLike | None = None) -> Places:
    """Places of R points from M distances between them.

    Args:
        pairs: (M, 2) indices 0..R-1. distance: (M,) [m]. sd: (M,) of them [m]; NaN where unknown (taken as the largest known).
        start: (R, 2) rough places [m], which tell apart the two sides on which a point with two distances can lie. Without
            them multidimensional scaling gives a start.
    Raises:
        ValueError: if the distances leave a shape open (fewer than 2R - 3 of them, or points that hang by too few), or are
            not positive.
    """
    ends = np.asarray(pairs, dtype=np.intp)
    measured, spread = np.asarray(distance, dtype=np.float64), np.asarray(sd, dtype=np.float64)
    if not (np.isfinite(measured) & (measured > 0)).all():
        raise ValueError(f"distances must be positive, got {float(measured[~(measured > 0)][0])} m; are the clocks corrected?")
    count = int(ends.max()) + 1
    known = spread[np.isfinite(spread)]
    spread = np.maximum(np.where(np.isfinite(spread), spread, known.max(initial=1.0)), SMALLEST_SD)
    if count < 3 or len(measured) < 2 * count - 3:
        needed = max(2 * count - 3, 3)
        raise ValueError(f"the shape of {count} receivers takes {needed} distances (and 3 receivers), got {len(measured)}")
    rough = scaled_start(ends, measured, count) if start is None else np.asarray(start, dtype=np.float64)
    position = place_freely(rough).move(rough).ravel()
    shape = np.setdiff1d(np.arange(2 * count), (0, 1, 3))  # the first stays at the origin, the second on the x-axis

    def misfit(free: Floats) -> Floats:
        position[shape] = free
        return (np.hypot(*_steps(position, ends).T) - measured) / spread

    fit = least_squares(misfit, position[shape], method="lm", xtol=1e-12, ftol=1e-12)
    residual = misfit(fit.x)
    step = _steps(position, ends)
    direction = step / np.hypot(*step.T)[:, None] / spread[:, None]
    jacobian = np.zeros((len(measured), count, 2))
    np.put_along_axis(jacobian, ends[:, :1, None], direction[:, None], axis=1)
    np.put_along_axis(jacobian, ends[:, 1:, None], -direction[:, None], axis=1)
    flat = jacobian.reshape(len(measured), -1)
    eigenvalue, vector = np.linalg.eigh(flat.T @ flat)
    if eigenvalue[3] <= 1e-8 * eigenvalue[-1]:  # three are zero: position and bearing
        raise ValueError("the distances leave the shape open: a receiver can swing; more pairs must hear each other")
    freedom = len(measured) - (2 * count - 3)
    excess = max(2 * fit.cost / freedom, 1.0) if freedom else 1.0  # distances that disagree by more than their errors
    covariance = (vector[:, 3:] / eigenvalue[3:]) @ vector[:, 3:].T * excess
    points = position.reshape(-1, 2)
    return Places(position=points - points.mean(axis=0), covariance=covariance, residual=-residual * spread)


def _steps(flat: Floats, ends: NDArray[np.intp]) -> Floats:
    """(M, 2) from the second to the first point of each pair."""
    return np.asarray(flat.reshape(-1, 2)[ends[:, 0]] - flat.reshape(-1, 2)[ends[:, 1]])


def scaled_start(pairs: NDArray[np.intp], distance: Floats, count: int) -> Floats:
    """Places (R, 2) by classical multidimensional scaling; a distance that is missing is the shortest way over others."""
    table = np.zeros((count, count))
    table[pairs[:, 0], pairs[:, 1]] = distance
    if connected_components(table, directed=False)[0] > 1:
        raise ValueError("the distances fall into groups of receivers that do not hear each other; survey each group alone")
    squared = shortest_path(table, directed=False) ** 2
    centring = np.eye(count) - 1 / count
    eigenvalue, vector = np.linalg.eigh(-0.5 * centring @ squared @ centring)
    return np.asarray(vector[:, -2:] * np.sqrt(np.maximum(eigenvalue[-2:], 1e-6)))


def place_on(position: ArrayLike, reference: ArrayLike) -> Placing:
    """The rotation, mirrored where that fits better, and translation that bring places nearest to reference points.

    Args:
        position, reference: (P, 2) [m], P >= 3; with 2 nothing tells a mirror image, and it is not mirrored.
    Raises:
        ValueError: for fewer than two points.
    """
    own, target = np.asarray(position, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    if len(own) < 2:
        raise ValueError(f"placing takes two reference points at least, got {len(own)}")
    rotation = orthogonal_procrustes(own - own.mean(axis=0), target - target.mean(axis=0))[0].T
    if len(own) == 2 and np.linalg.det(rotation) < 0:  # the points lie on a line: mirrored in it they fit as well
        along = (target[1] - target[0]) / np.linalg.norm(target[1] - target[0])
        rotation = (2.0 * np.outer(along, along) - np.eye(2)) @ rotation
    translation = target.mean(axis=0) - rotation @ own.mean(axis=0)
    return Placing(rotation=rotation, translation=translation, residual=target - (own @ rotation.T + translation))


def place_freely(position: ArrayLike) -> Placing:
    """The first point at the origin, the second to the east of it, the third not south."""
    own = np.asarray(position, dtype=np.float64)
    east = (own[1] - own[0]) / np.hypot(*(own[1] - own[0]))
    rotation = np.array([east, [-east[1], east[0]]])
    if len(own) > 2 and rotation[1] @ (own[2] - own[0]) < 0:
        rotation[1] *= -1
    return Placing(rotation=rotation, translation=-rotation @ own[0], residual=np.empty((0, 2)))
