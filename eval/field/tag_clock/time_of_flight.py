"""Range from one-way travel time: the tag's clock is known, so an arrival tells how long the sound was under way.

Lin et al. 2013, IV.B.3 (correction of the first ping), IV.C.1 (range) and IV.C.2 (outliers). The clock comes from a
calibration; how it drifts afterwards is seen here only as a range that is off.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

LARGEST_JUMP = 50.0  # Delta d_max of Alg. 1 [m]


@dataclass(frozen=True, kw_only=True)
class TagClock:
    """When a code is sent, on the receiver's clock: at first_ping + k * period."""

    period: float | Floats  # T_c (..., T) [s]
    first_ping: float | Floats  # t_0 (..., T) [s]

    def __post_init__(self) -> None:
        period = np.asarray(self.period, dtype=np.float64)
        if not ((period > 0) & np.isfinite(period)).all():
            raise ValueError(f"tag period must be positive, got {period[~((period > 0) & np.isfinite(period))].flat[0]} s")


def transmission_count(arrival: ArrayLike, clock: TagClock) -> Floats:
    """Number k of the ping that was sent nearest in time (Lin et al. 2013, Eq. 5).

    Args:
        arrival: (..., V, T) time of arrival on the receiver's clock [s]; NaN where nothing was heard.
        clock: period and first ping (..., T) [s].
    Returns:
        (..., V, T) whole numbers; NaN stays NaN.
    """
    period, first_ping = _per_vehicle(clock)
    return np.floor((np.asarray(arrival, dtype=np.float64) - first_ping) / period + 0.5)


def time_of_flight_range(arrival: ArrayLike, clock: TagClock, sound_speed: float) -> Floats:
    """Slant range from one-way travel time, taking the ping nearest in time (Lin et al. 2013, Eqs. 5-7).

    Args:
        arrival: (..., V, T) time of arrival on the receiver's clock [s]; NaN where nothing was heard.
        clock: period and first ping (..., T) [s].
        sound_speed: v [m/s].
    Returns:
        (..., V, T) range [m] within +-v*T_c/2; negative: clock drift, or a tag beyond that reach; NaN stays NaN.
    Raises:
        ValueError: if the speed of sound is not positive.

    Of two arrivals one comes 0.1 s after a ping and one 0.01 s before the next, for its tag is beyond v*T_c/2 or its clock late:

    >>> clock = TagClock(period=2.0, first_ping=10.0)
    >>> time_of_flight_range([14.1, 15.99, float("nan")], clock, sound_speed=1500.0).round(6)
    array([150., -15.,  nan])
    """
    _require_speed(sound_speed)
    period, first_ping = _per_vehicle(clock)
    transmitted = first_ping + transmission_count(arrival, clock) * period
    return (np.asarray(arrival, dtype=np.float64) - transmitted) * sound_speed


def aliasing_range(clock: TagClock, sound_speed: float) -> Floats:
    """Range v*T_c/2 (..., T) [m] beyond which a tag seems to be nearer by v*T_c (Lin et al. 2013, IV.C.1)."""
    _require_speed(sound_speed)
    return np.asarray(clock.period, dtype=np.float64) * sound_speed / 2


def correct_first_ping(clock: TagClock, range_: ArrayLike, known_range: ArrayLike, sound_speed: float) -> TagClock:
    """Clock with t_0 put right after a power cycle or a drift (Lin et al. 2013, Eq. 4).

    Args:
        clock: period and first ping (..., T) [s].
        range_: d (..., T), by ``time_of_flight_range`` with that clock [m].
        known_range: d_m (..., T) at the same time [m]: measured, 0 with the tag held to the hydrophone, or the distance from
            the vehicle to the filter's own estimate, whose error the clock then keeps.
        sound_speed: v [m/s].
    Returns:
        The clock by which that arrival has the known range. Where either range is NaN t_0 is left alone.
    """
    _require_speed(sound_speed)
    late = (np.asarray(range_, dtype=np.float64) - np.asarray(known_range, dtype=np.float64)) / sound_speed
    first_ping = np.asarray(clock.first_ping, dtype=np.float64) + np.where(np.isnan(late), 0.0, late)
    return dataclasses.replace(clock, first_ping=first_ping)


def gate_range(range_: ArrayLike, previous: ArrayLike, largest_jump: float = LARGEST_JUMP) -> tuple[Floats, Floats]:
    """Reject a range that jumps from the one before (Lin et al. 2013, Alg. 1).

    The one before may itself have been rejected, so a single outlier costs two measurements, and a true jump one.

    Args:
        range_: (...,) [m]; NaN where nothing was heard.
        previous: (...,) range heard last [m]; NaN before the first, which passes.
        largest_jump: between the two [m].
    Returns:
        The range, NaN where it failed or nothing was heard; and the ``previous`` of the next call, which silence leaves as it is.
    """
    range_, previous = np.asarray(range_, dtype=np.float64), np.asarray(previous, dtype=np.float64)
    failed = np.abs(previous - range_) > largest_jump
    return np.where(failed, np.nan, range_), np.where(np.isnan(range_), previous, range_)


def _per_vehicle(clock: TagClock) -> tuple[Floats, Floats]:
    """Period and first ping with an axis for the vehicles, (..., 1, T); scalars stay scalars."""
    period, first_ping = np.broadcast_arrays(
        np.asarray(clock.period, dtype=np.float64), np.asarray(clock.first_ping, dtype=np.float64)
    )
    return (period, first_ping) if period.ndim == 0 else (period[..., None, :], first_ping[..., None, :])


def _require_speed(sound_speed: float) -> None:
    if not 0 < sound_speed < np.inf:
        raise ValueError(f"speed of sound must be positive, got {sound_speed:g} m/s")
