"""How well a position can be known at best: the Cramér-Rao bound (Masmitja et al. 2020, Eqs. 14-16, Figs. 2A and S1).

It takes receivers, sound speed and noise as known, and errors as Gaussian without bias; multipath and clocks come on top.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.eval.field.static_array.likelihood import SMALLEST_RANGE, inverse_or_nan
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, arrival_information, check_receivers


def cramer_rao_bound(
    position: ArrayLike, receivers: ArrayLike, setting: ArraySetting, information: Floats | None = None
) -> Floats:
    """The least covariance (..., n, n) [m^2] that an unbiased estimate from one ping can have (Eq. 14).

    Args:
        position: (..., n) [m]; NaN gives NaN.
        receivers: (R, n) [m].
        information: (..., R, R) [1/s^2] that broadcasts over the positions; by default every receiver hears the ping with an
            independent error of ``setting.sigma``. The paper's R = sigma^2 I is ``arrival_information`` with ``full_pairs``.
    Returns:
        inf where the ping does not determine the position: too few receivers, or at one of them.
    Raises:
        ValueError: if the shapes disagree.
    """
    places = check_receivers(receivers)
    where = np.asarray(position, dtype=np.float64)
    if where.shape[-1:] != places.shape[1:]:
        raise ValueError(f"position must be (..., {places.shape[1]}) as the receivers are, got shape {where.shape}")
    matrix = arrival_information(np.ones(len(places), dtype=bool), setting.sigma) if information is None else information
    covariance = inverse_or_nan(fisher_information(where, places, setting.sound_speed, matrix))
    known = np.isfinite(np.linalg.norm(where, axis=-1))[..., None, None]
    return np.where(known & np.isnan(covariance), np.inf, covariance)


def fisher_information(position: Floats, receivers: Floats, sound_speed: float, information: Floats) -> Floats:
    """(..., n, n) [1/m^2] of an error-free ping at positions (..., n): Eq. 15 in arrivals; 0 at a receiver."""
    offset = position[..., None, :] - receivers
    distance = np.linalg.norm(offset, axis=-1, keepdims=True)
    slope = offset / (sound_speed * np.maximum(distance, SMALLEST_RANGE))
    value = slope.swapaxes(-1, -2) @ information @ slope
    return np.where((distance > SMALLEST_RANGE).all(axis=-2, keepdims=True), value, 0.0)


def root_trace(covariance: Floats) -> Floats:
    """Root-mean-square distance (...) [m] from the truth that goes with a covariance (..., n, n) (Eq. 16)."""
    return np.sqrt(np.trace(covariance, axis1=-2, axis2=-1))
