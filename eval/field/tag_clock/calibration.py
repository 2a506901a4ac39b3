"""Calibration of a tag's clock from arrivals while tag and hydrophone are side by side (Lin et al. 2013, IV.B).

A code is sent at t_0 + k*T_c. From a record of its arrivals come the period T_c, by the paper's mean of differences or by a
line through all arrivals, and the first ping t_0. Both hold on the receiver's clock, and only while neither drifts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tagtrack.eval.field.tag_clock.time_of_flight import TagClock

NOMINAL_PERIODS = (2.0, 4.0)  # of Lotek's codes [s] (IV.B.1)
TAU = 0.01  # a regular difference lies this near to the nominal period [s] (IV.B.2)
TICK = 1 / 4800  # Lotek's receiver counts arrivals in such ticks [s]: all differences of Table I are multiples


class Kind(IntEnum):
    """What a difference between consecutive arrivals of one code is."""

    REGULAR = 0  # one period
    MISSED = 1  # several periods: codes between were not heard
    NEIGHBOURING = 2  # to or from another code of the burst that was read as this one
    SHIFTED = 3  # none of these: the tag or the receiver was turned off between, or the gap is too long to count over


@dataclass(frozen=True)
class Differences:
    """Differences between consecutive arrivals: ``value`` (N-1,) [s], ``kind`` (N-1,) of ``Kind``, and ``nominal`` [s]."""

    value: NDArray[np.float64]
    kind: NDArray[np.int64]
    nominal: float

    def of_kind(self, kind: Kind) -> NDArray[np.float64]:
        """The differences of one kind [s], in order."""
        return self.value[self.kind == kind]


@dataclass(frozen=True, kw_only=True)
class PeriodEstimate:
    """A code's period, how well it is known, and how much what it was found from scatters."""

    period: float  # T_c [s]
    standard_error: float  # of the period [s]
    sigma: float  # of the regular differences (Table II) or of the arrivals about their line [s]


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """All that one record tells about the clock of one code."""

    clock: TagClock  # of the last stretch, which is the one that goes on
    by_line: PeriodEstimate  # the period of ``clock``
    by_differences: PeriodEstimate  # the paper's
    differences: Differences
    stretches: int  # between the shifts of the clock


def calibrate(
    arrival: ArrayLike, nominal_period: float | None = None, *, tau: float = TAU, resolution: float = TICK
) -> Calibration:
    """Clock of a code that was recorded beside the hydrophone.

    The paper averages the regular differences. In such a mean all arrivals cancel but the first and last of each unbroken run,
    so every outlier costs accuracy. The line takes every arrival at its number k, across missed codes, with one slope T_c and
    one t_0 for each stretch between shifts. The paper's t_0 is the first arrival alone; here it is the line's value there.

    Args:
        arrival: (N,) times at which one code arrived, rising [s].
        nominal_period: roughly, [s]; without it 2 or 4 s, whichever has more differences near.
        tau: how far a regular difference may lie from the nominal period [s].
        resolution: step in which the receiver can tell arrivals apart [s]; see ``fit_line``.
    Raises:
        ValueError: for fewer than three arrivals, times that do not rise, fewer than two regular differences, or more
            differences near half or a third of the nominal period than near it, which is then several periods. For a tau or
            a resolution that is not positive, or too large.
    """
    arrival = _require_rising(arrival)
    differences = sort_differences(arrival, nominal_period, tau=tau, resolution=resolution)
    by_differences = average_differences(differences, resolution=resolution)
    touched = differences.kind == Kind.REGULAR
    regular = arrival[np.append(touched, False) | np.append(False, touched)]
    count, stretch = number_pings(regular, by_differences, tau)
    by_line = fit_line(regular, count, stretch, resolution=resolution)
    last = stretch == stretch[-1]
    first_ping = np.mean(regular[last] - count[last] * by_line.period)
    return Calibration(
        clock=TagClock(period=by_line.period, first_ping=float(first_ping)),
        by_line=by_line,
        by_differences=by_differences,
        differences=differences,
        stretches=int(stretch[-1]) + 1,
    )


def sort_differences(
    arrival: ArrayLike, nominal_period: float | None = None, *, tau: float = TAU, resolution: float = TICK
) -> Differences:
    """Differences between consecutive arrivals, outliers told from regular ones and sorted by their cause (Table I).

    Regular is what lies within tau of the nominal period (IV.B.2). Args and Raises are those of ``calibrate``.
    """
    arrival = _require_rising(arrival)
    value = np.diff(arrival)
    nominal = _settle_nominal(value, nominal_period, tau)
    if not 0 < resolution <= tau:
        raise ValueError(f"the resolution must be positive and at most tau, {tau:g} s, got {resolution:g} s")
    regular = np.abs(value - nominal) <= tau
    if regular.sum() < 2:
        raise ValueError(
            f"{regular.sum()} of {value.size} differences lie within {tau:g} s of the nominal period {nominal:g} s, two are "
            f"needed; the median difference is {np.median(value):.5f} s: give a nominal period near the true one"
        )
    for parts in (2, 3):
        shorter = np.sum(np.abs(value - nominal / parts) <= tau)
        if shorter > regular.sum():
            raise ValueError(
                f"{shorter} of {value.size} differences lie near {nominal / parts:g} s and {regular.sum()} near the nominal "
                f"period {nominal:g} s, which is {parts} periods: give a nominal period of {nominal / parts:g} s"
            )
    kind = np.where(regular, Kind.REGULAR, Kind.SHIFTED)
    counted = _are_multiples(value, average_differences(Differences(value, kind, nominal), resolution=resolution), tau)
    touched = np.append(regular, False) | np.append(False, regular)
    stray = ~(touched[:-1] & touched[1:])
    kind[stray & ~regular] = Kind.NEIGHBOURING
    kind[counted & ~regular] = Kind.MISSED
    return Differences(value, kind, nominal)


def average_differences(differences: Differences, *, resolution: float = TICK) -> PeriodEstimate:
    """Period as the mean of the regular differences, as the paper has it (IV.B.1-2).

    Its standard error is sigma / sqrt(n), as if differences were independent. Neighbours share an arrival and cancel, so the
    mean of an unbroken record is far better than that, and of a broken one somewhat. It is at least one step of the resolution
    over all n, for a few differences may be equal by chance.
    """
    regular = differences.of_kind(Kind.REGULAR)
    sigma = float(np.std(regular, ddof=1))
    standard_error = max(sigma / regular.size**0.5, resolution / regular.size)
    return PeriodEstimate(period=float(np.mean(regular)), standard_error=standard_error, sigma=sigma)


def fit_line(
    arrival: NDArray[np.float64],
    count: NDArray[np.int64],
    stretch: NDArray[np.int64],
    *,
    resolution: float = TICK,
) -> PeriodEstimate:
    """Period as the slope of arrival time over ping number, by least squares.

    Args:
        arrival: (M,) [s]. count: (M,) number k of each ping within its stretch. stretch: (M,) rising from 0; each has a t_0
            of its own, the slope is common.
        resolution: the standard error is at least half of it over the longest stretch's number of periods. A clock that
            slips by less than a tick over the whole record shows no scatter and yet may be off by that much.
    Returns:
        ``sigma`` is that of the arrivals about the line. The standard error holds for the record: it knows of no later drift.
    """
    pings = np.bincount(stretch)
    guess = float(np.median(np.diff(arrival)))
    centred_count = count - (np.bincount(stretch, count) / pings)[stretch]
    late = arrival - arrival[0] - count * guess
    late -= (np.bincount(stretch, late) / pings)[stretch]
    leverage = centred_count @ centred_count
    slope = centred_count @ late / leverage
    residual = late - slope * centred_count
    freedom = arrival.size - pings.size - 1
    sigma = float(np.sqrt(residual @ residual / freedom)) if freedom > 0 else resolution / 12**0.5
    hidden = resolution / 2 / max(np.ptp(count[stretch == each]) for each in range(pings.size))
    return PeriodEstimate(
        period=guess + float(slope), standard_error=float(np.hypot(sigma / leverage**0.5, hidden)), sigma=sigma
    )


def number_pings(
    arrival: NDArray[np.float64], rough: PeriodEstimate, tau: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number of each ping within its stretch (M,), and the number of that stretch (M,).

    A new stretch begins where a step is no whole number of periods, or so long that the number is uncertain.
    """
    step = np.diff(arrival)
    shifted = ~_are_multiples(step, rough, tau)
    stretch = np.append(0, np.cumsum(shifted))
    total = np.append(0, np.cumsum(np.where(shifted, 0, np.round(step / rough.period)))).astype(np.int64)
    begins = np.append(True, shifted)
    return total - total[begins][stretch], stretch


def _are_multiples(value: NDArray[np.float64], rough: PeriodEstimate, tau: float) -> NDArray[np.bool_]:
    """Which differences are a whole number of periods, and so short that the number is certain."""
    count = np.round(value / rough.period)
    near = (count >= 1) & (np.abs(value - count * rough.period) <= tau)
    return near & ((count == 1) | (3 * count * rough.standard_error <= tau))


def _settle_nominal(value: NDArray[np.float64], nominal_period: float | None, tau: float) -> float:
    """The nominal period [s]: as given, or the usual one with most differences near."""
    choices: Sequence[float] = NOMINAL_PERIODS if nominal_period is None else (nominal_period,)
    for nominal in choices:
        if not 0 < nominal < np.inf:
            raise ValueError(f"the nominal period must be positive, got {nominal:g} s")
        if not 0 < tau < nominal / 4:
            raise ValueError(f"tau must be positive and below a quarter of the nominal period {nominal:g} s, got {tau:g} s")
    return max(choices, key=lambda nominal: int(np.sum(np.abs(value - nominal) <= tau)))


def _require_rising(arrival: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(arrival, dtype=np.float64)
    if array.ndim != 1:
        raise ValueError(f"expected the arrivals of one code, (N,), got shape {array.shape}")
    if array.size < 3:
        raise ValueError(f"a period needs at least three arrivals of a code, got {array.size}; record for longer")
    wrong = np.flatnonzero(~(np.diff(array) > 0))
    if wrong.size:
        before, after = array[wrong[0]], array[wrong[0] + 1]
        raise ValueError(f"arrivals must rise, got {after:.5f} s after {before:.5f} s; sort them and drop duplicates")
    return array
