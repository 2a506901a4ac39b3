"""The cost of a position under the arrivals of its pings, with gradient and Hessian (Masmitja et al. 2020, Eq. 6).

With the information matrix M of ``arrival_information``, f(q) = e^T M e / 2 where e_i = arrival_i - |q - b_i| / c. The unknown
transmission time costs nothing under M, so the arrivals are kept relative to the first of their ping: at the size of a Unix
time a double resolves only 0.2 microseconds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tagtrack.eval.field.static_array.model import (
    ArraySetting,
    Floats,
    Pings,
    Positions,
    arrival_information,
    level_places,
)

SMALLEST_RANGE = 1e-6  # [m]: at a receiver the cost has a kink and no derivative
LEAST_CONDITION = 1e-12  # reciprocal condition number below which a matrix counts as singular
LEAST_SHARE = 1e-9  # of all information, below which a difference counts as unknown
SAME_COST = 1e-6  # two positions with costs this near fit alike


class Derivatives(NamedTuple):
    """Of the cost, for N positions."""

    cost: Floats  # (N,)
    gradient: Floats  # (N, n) [1/m]
    information: Floats  # (N, n, n) [1/m^2] Gauss-Newton part of the Hessian: Fisher information where the error is 0
    bending: Floats  # (N, n, n) [1/m^2] the rest of the Hessian, from second derivatives of the ranges


@dataclass(frozen=True, kw_only=True)
class Likelihood:
    """What K pings tell of their positions."""

    arrival: Floats  # (K, R) [s] since the first of each ping; 0 where not heard
    information: Floats  # (K, R, R) [1/s^2], 0 where not heard
    receivers: Floats  # (R, n) [m]
    sound_speed: float  # [m/s]
    rise: Floats | None = None  # (K, R) of the tag above each receiver, where positions are horizontal [m]

    def __len__(self) -> int:
        return len(self.arrival)

    @property
    def centre(self) -> Floats:
        """(n,) of the array [m]."""
        return self.receivers.mean(axis=0)

    @property
    def span(self) -> float:
        """Diagonal of the box around the array [m]."""
        return float(np.linalg.norm(np.ptp(self.receivers, axis=0)))

    @property
    def dimensions(self) -> int:
        return self.receivers.shape[1]

    def take(self, kept: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Likelihood:
        """Those of some pings, in any order and number."""
        information = np.moveaxis(pings_last(self.information)[..., kept], -1, 0)
        rise = None if self.rise is None else self.rise[kept]
        return replace(self, arrival=self.arrival[kept], information=information, rise=rise)

    @cached_property
    def known_differences(self) -> NDArray[np.intp]:
        """(K,): how many independent differences of arrival each ping gives; a position takes n of them."""
        scale = np.maximum(np.trace(self.information, axis1=1, axis2=2), np.finfo(float).tiny)
        return (np.linalg.eigvalsh(self.information / scale[:, None, None]) > LEAST_SHARE).sum(axis=1)

    def choose(self, candidates: Floats) -> Floats:
        """The candidate (S, K, n) of least cost for each ping (K, n); of those that fit alike, the one nearest the centre.

        Two hyperbolas may cross twice, and no measurement tells which crossing it is.
        """
        cost = np.stack([self.cost(candidate) for candidate in candidates])
        cost[~np.isfinite(cost)] = np.inf
        away = np.linalg.norm(candidates - self.centre, axis=-1)
        away[~(cost <= cost.min(axis=0) + SAME_COST)] = np.inf
        return np.take_along_axis(candidates, away.argmin(axis=0)[None, :, None], axis=0)[0]

    def positions(self, estimate: Floats) -> Positions:
        """Estimates (K, n) with their covariance, the inverse information there; NaN where it does not exist."""
        covariance = inverse_or_nan(self.derivatives(estimate).information)
        known = np.isfinite(covariance[:, :1, 0])
        return Positions(position=np.where(known, estimate, np.nan), covariance=covariance)

    def errors(self, position: Floats) -> Floats:
        """e (K, R) [s] at one position (K, n) for each ping."""
        return self.arrival - self._ranges(position)[1].T / self.sound_speed

    def cost(self, position: Floats) -> Floats:
        """f (K,) at one position (K, n) for each ping."""
        error = pings_last(self.errors(position))
        return 0.5 * np.einsum("ak,abk,bk->k", error, pings_last(self.information), error)

    def derivatives(self, position: Floats) -> Derivatives:
        """Cost, gradient and Hessian at one position (K, n) for each ping."""
        offset, distance = self._ranges(position)
        matrix = pings_last(self.information)
        error = pings_last(self.arrival) - distance / self.sound_speed
        weighted = np.einsum("abk,bk->ak", matrix, error)
        slope = offset / (-self.sound_speed * distance[:, None])
        bend = weighted / (-self.sound_speed * distance)
        information = np.einsum("amk,ank->mnk", slope, np.einsum("abk,bnk->ank", matrix, slope))
        outer = np.einsum("amk,ank->mnk", slope * bend[:, None], slope)
        bending = bend.sum(axis=0) * np.eye(self.dimensions)[..., None] - self.sound_speed**2 * outer
        return Derivatives(
            cost=0.5 * np.einsum("ak,ak->k", error, weighted),
            gradient=np.einsum("ank,ak->nk", slope, weighted).T,
            information=np.moveaxis(information, -1, 0),
            bending=np.moveaxis(bending, -1, 0),
        )

    def _ranges(self, position: Floats) -> tuple[Floats, Floats]:
        """From each receiver, pings last: offset (R, n, K) and distance (R, K) [m]."""
        offset = pings_last(position) - self.receivers[..., None]
        square = np.einsum("ank,ank->ak", offset, offset)
        if self.rise is not None:
            square += self.rise.T**2
        return offset, np.maximum(np.sqrt(square), SMALLEST_RANGE)


def make_likelihood(pings: Pings, receivers: ArrayLike, setting: ArraySetting, information: Floats | None = None) -> Likelihood:
    """The likelihood of K pings.

    Args:
        pings: arrivals (K, R) [s].
        receivers: (R, n) [m], n = 2 or 3; 3 where the pings tell the tag's height, and positions are horizontal then.
        information: (K, R, R) [1/s^2], positive semi-definite with rows that sum to zero; by default that of independent
            arrival errors of ``setting.sigma``.
    Raises:
        ValueError: as ``level_places`` and ``check_pings``; if ``information`` has another shape or counts a receiver that heard
            nothing.
    """
    places, rise = level_places(pings, receivers)
    check_pings(pings, places)
    arrival = np.asarray(pings.arrival, dtype=np.float64)
    heard = np.isfinite(arrival)
    if information is None:
        matrix = arrival_information(heard, setting.sigma)
    else:
        matrix = np.asarray(information, dtype=np.float64)
        if matrix.shape != (len(arrival), len(places), len(places)):
            raise ValueError(f"information must be {(len(arrival), len(places), len(places))}, got shape {matrix.shape}")
        if np.any(matrix[~heard]):
            raise ValueError("information must be zero for a receiver that did not hear the ping")
    first = np.min(arrival, axis=1, keepdims=True, where=heard, initial=np.inf)
    relative = np.where(heard, arrival - np.where(np.isfinite(first), first, 0.0), 0.0)
    matrix = np.moveaxis(pings_last(matrix), -1, 0)
    return Likelihood(arrival=relative, information=matrix, receivers=places, sound_speed=setting.sound_speed, rise=rise)


def check_pings(pings: Pings, receivers: Floats) -> None:
    """Raise ValueError unless there is a column of arrivals for each receiver (R, n) and a time, in order, for each ping."""
    arrival, time = np.asarray(pings.arrival, dtype=np.float64), np.asarray(pings.time, dtype=np.float64)
    if arrival.ndim != 2 or arrival.shape[1] != len(receivers):
        raise ValueError(f"arrival must be (K, {len(receivers)}), one column for each receiver, got shape {arrival.shape}")
    if np.isinf(arrival).any():
        raise ValueError(f"an arrival must be finite or NaN, got {arrival[np.isinf(arrival)][0]} s")
    if time.shape != arrival.shape[:1]:
        raise ValueError(f"time must be ({len(arrival)},), one for each ping, got shape {time.shape}")
    if not np.isfinite(time).all():
        raise ValueError(f"the time of a ping must be finite, got {time[~np.isfinite(time)][0]} s")
    if np.any(np.diff(time) < 0):
        index = int(np.argmax(np.diff(time) < 0))
        raise ValueError(f"pings must be in order of time, got {time[index + 1]} s after {time[index]} s")


def inverse_or_nan(matrix: Floats) -> Floats:
    """Inverses of symmetric matrices (..., n, n), NaN where one is singular or not positive definite."""
    finite = np.isfinite(matrix).all(axis=(-2, -1), keepdims=True)
    values = np.linalg.eigvalsh(np.where(finite, matrix, 0.0))
    regular = values[..., 0] > LEAST_CONDITION * np.maximum(values[..., -1], np.finfo(float).tiny)
    safe = np.where(regular[..., None, None], matrix, np.eye(matrix.shape[-1]))
    return np.where(regular[..., None, None], np.linalg.inv(safe), np.nan)


def pings_last(value: Floats) -> Floats:
    """(K, ...) as (..., K): sums over receivers and axes then run along the pings, ten times faster. Copies only if it must."""
    return np.ascontiguousarray(value.transpose(*range(1, value.ndim), 0))
