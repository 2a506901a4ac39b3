"""What every estimator of a moored array shares: the measurement of Masmitja et al. 2020 (Eq. 1), and how well it is known.

A ping is a row of arrival times, one for each receiver and NaN where it was not heard. What a ping tells of a position is a
quadratic form in the arrival residuals (R, R): whatever differences (TDOA) are taken from the arrivals, and whatever their
covariance, their likelihood is that of the arrivals under one such matrix (``arrival_information``). A common shift of all
arrivals, the unknown transmission time, costs nothing: its rows sum to zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Pairs = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class ArraySetting:
    """What the estimators assume. Those that take one ping at a time use only the first two."""

    sound_speed: float = 1500.0  # c [m/s]
    sigma: float = 1e-3  # of an arrival time [s]
    acceleration_sigma: float = 1e-3  # of the target's random acceleration [m/s^1.5], MAP and PF (Eq. 8, Q)
    first_speed_sigma: float = 0.2  # of each axis of its first velocity [m/s], MAP and PF (Eq. 10, P_0)

    def __post_init__(self) -> None:
        for name in ("sound_speed", "sigma", "acceleration_sigma", "first_speed_sigma"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive, got {value!r}")


@dataclass(frozen=True, kw_only=True)
class Pings:
    """K pings of one tag, in order of time.

    ``time`` (K,) [s]: when the first receiver heard it. ``arrival`` (K, R) [s]: on the same clock; NaN where not heard.
    ``height`` (K,) [m]: of the tag, where that is known: receivers are then (R, 3), and positions are horizontal.
    """

    time: Floats
    arrival: Floats
    height: Floats | None = None

    @property
    def heard(self) -> NDArray[np.bool_]:
        """(K, R): which receivers heard it."""
        return np.isfinite(self.arrival)

    def take(self, kept: NDArray[np.intp] | NDArray[np.bool_]) -> Pings:
        """Some of them."""
        height = None if self.height is None else self.height[kept]
        return Pings(time=self.time[kept], arrival=self.arrival[kept], height=height)


@dataclass(frozen=True, kw_only=True)
class Positions:
    """Where an estimator puts each of K pings: NaN where it cannot.

    ``position`` (K, n) [m]; ``covariance`` (K, n, n) [m^2] of it, from the curvature at the estimate.
    """

    position: Floats
    covariance: Floats


def full_pairs(receivers: int) -> Pairs:
    """All m = L(L-1)/2 pairs of receivers (m, 2), lower index first."""
    return np.stack(np.triu_indices(receivers, 1), axis=1)


def arrival_information(heard: ArrayLike, sigma: float, pairs: Pairs | None = None) -> Floats:
    """Information (..., R, R) [1/s^2] that pings carry about the differences of their arrivals.

    Args:
        heard: (..., R) bool.
        sigma: of one arrival time, or, with ``pairs``, of one difference [s].
        pairs: (m, 2) differences to use, with independent errors as in Eq. 6 (R = sigma^2 I). By default all that the
            arrivals tell: any L - 1 spanning differences with the covariance that a shared arrival gives them.
    """
    mask = np.asarray(heard, dtype=np.float64)
    count = mask.shape[-1]
    if pairs is None:
        number = np.maximum(mask.sum(axis=-1), 1.0)[..., None, None]
        return (np.eye(count) * mask[..., None] - mask[..., :, None] * mask[..., None, :] / number) / sigma**2
    incidence = _incidence(pairs, count)
    both = mask[..., pairs[:, 0]] * mask[..., pairs[:, 1]]
    return np.einsum("ma,...m,mb->...ab", incidence, both, incidence) / sigma**2


def _incidence(pairs: Pairs, receivers: int) -> Floats:
    """D (m, R) with D arrival = differences."""
    matrix = np.zeros((len(pairs), receivers))
    matrix[np.arange(len(pairs)), pairs[:, 0]] += 1.0
    matrix[np.arange(len(pairs)), pairs[:, 1]] -= 1.0
    return matrix


def check_receivers(receivers: ArrayLike) -> Floats:
    """Places of the receivers (R, n) [m], n = 2 or 3.

    Raises:
        ValueError: for another shape, a value that is not finite, fewer than n + 1 receivers, or all in one place.
    """
    places = np.asarray(receivers, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] not in (2, 3):
        raise ValueError(f"receivers must be (R, 2) or (R, 3), got shape {places.shape}")
    if not np.isfinite(places).all():
        raise ValueError(f"receivers must be finite, got {places[~np.isfinite(places).all(axis=1)][0]}")
    if len(places) <= places.shape[1]:
        least = places.shape[1] + 1
        raise ValueError(f"a position in {places.shape[1]} dimensions takes at least {least} receivers, got {len(places)}")
    if not np.ptp(places, axis=0).any():
        raise ValueError(f"all {len(places)} receivers stand in one place, which tells no direction; correct their places")
    return places


def level_places(pings: Pings, receivers: ArrayLike) -> tuple[Floats, Floats | None]:
    """Among which places a position is sought.

    Args:
        pings: K of them. receivers: (R, 2) or (R, 3) [m].
    Returns:
        The places of the receivers (R, n), and None; or, where the pings tell the tag's height, their horizontal places (R, 2)
        and by how much the tag is above each (K, R) [m].
    Raises:
        ValueError: as ``check_receivers``; if there is not a finite height for each ping, or receivers have none.
    """
    if pings.height is None:
        return check_receivers(receivers), None
    places, height = np.asarray(receivers, dtype=np.float64), np.asarray(pings.height, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3:
        raise ValueError(f"where a tag's height is known receivers must be (R, 3), got shape {places.shape}")
    if height.shape != pings.time.shape or not np.isfinite(height).all():
        raise ValueError(f"height must be finite, one for each of {len(pings.time)} pings, got shape {height.shape}")
    if not np.isfinite(places[:, 2]).all():
        raise ValueError(f"receivers must be finite, got {places[~np.isfinite(places[:, 2])][0]}")
    return check_receivers(places[:, :2]), height[:, None] - places[:, 2]
