"""YAPS, yet another positioning solver: a track and its transmission times from arrivals at once (Baktoft et al. 2017).

Positions are a random walk, the intervals of a regular tag too; how far they walk and how wrong arrivals are is estimated by
maximizing the marginal likelihood, its integral over track and times by Laplace's approximation about the most likely ones. Where
YAPS takes the exact second derivatives by automatic differentiation, the curvature here is that of Gauss and Newton, and an
outlier counts by its weight. Left out: the speed of sound as a state, and estimating the shape of the errors' tails.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

from tagtrack.eval.field.static_array.arrival_model import SHORTEST_INTERVAL, ArrivalModel, Rows, Scales, invert_blocks, lay_out
from tagtrack.eval.field.static_array.likelihood import check_pings
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions, level_places

REGULAR = 0.02  # of the interval: how far the intervals of a regular tag, motion included, lie from whole multiples of it
MOST_STRAYS = 0.1  # share of intervals that may lie farther: outliers
FEWEST_INTERVALS = 5
FEWEST_PINGS = 10  # located ones, to estimate scales from; fewer keep the setting's
FIRST_INTERVAL_SIGMA = 1e-3  # [s]
REACH = np.log(1e3)  # how far from their start the scales are sought
COARSENESS = (30.0, 5.0)  # the first fits take arrivals for that many times worse: outliers show before they attract
SMOOTHING = 5  # located pings whose median is the start
TOLERANCE, MOST_EVALUATIONS = 0.05, 150  # of the search, in minus the log likelihood: scales that fit alike are alike


@dataclass(frozen=True, kw_only=True)
class ArrivalTrack:
    """A track by YAPS of K pings."""

    positions: Positions
    transmission: Floats  # (K,) when each was sent [s, on the receivers' clock]
    transmission_sigma: Floats  # (K,) [s]
    scales: Scales
    interval: float | None  # of a regular tag [s]
    missed: int  # pings of a regular tag that nobody heard between the first and the last


def yaps(
    pings: Pings, receivers: ArrayLike, setting: ArraySetting, *, information: Floats | None = None
) -> Positions:
    """Positions by YAPS, all pings at once; whether the tag is regular is found from the pings.

    Args, errors: as of ``track_arrivals``; and ValueError for an ``information`` of the arrivals, which YAPS estimates itself.
    """
    if information is not None:
        raise ValueError("yaps takes arrival times and finds out how good they are; for differences (TDOA) use another method")
    return track_arrivals(pings, receivers, setting, interval=regular_interval(pings.time)).positions


def regular_interval(time: ArrayLike) -> float | None:
    """The interval of a regular tag [s] from when its pings were heard (K,), some perhaps missed; None where it is random."""
    gap = np.diff(np.asarray(time, dtype=np.float64))
    gap = gap[gap > 0]
    if gap.size < FEWEST_INTERVALS:
        return None
    interval = float(np.quantile(gap, 0.1))
    for _ in range(3):  # the shortest gaps are a little too short: the one that all gaps agree on
        count = np.maximum(np.round(gap / interval), 1)
        fitting = np.abs(gap - count * interval) < 2 * REGULAR * interval
        if not fitting.any():
            return None
        interval = float(np.median(gap[fitting] / count[fitting]))
    count = np.maximum(np.round(gap / interval), 1)
    near = np.abs(gap - count * interval) < REGULAR * interval
    return interval if np.mean(near) >= 1 - MOST_STRAYS else None


def track_arrivals(
    pings: Pings, receivers: ArrayLike, setting: ArraySetting, *, interval: float | None, robust: bool = True
) -> ArrivalTrack:
    """The most likely positions and transmission times, and the scales that make the arrivals most likely.

    Args:
        pings: K pings in order of time; those that one or two receivers heard count too. receivers: (R, n) [m].
        setting: of it the speed of sound, and ``sigma`` and ``first_speed_sigma`` to start from; with fewer than 10 located
            pings the scales stay there.
        interval: of a regular tag [s]; None for random intervals (YAPS's ``sbi`` and ``rbi``). Missed pings are counted by it,
            up to 200 in a row: over the longest gap it must not be wrong by half an interval.
        robust: errors are a normal distribution and 5 % Student's t of ten times its width; else normal alone.
    Returns:
        The track. NaN throughout where no ping was heard by n + 1 receivers. The covariance is the inverse curvature.
    Raises:
        ValueError: if the shapes disagree, receivers cannot locate, times are out of order, or the interval is not positive.
    """
    places, rise = level_places(pings, receivers)
    dimensions = places.shape[1]
    check_pings(pings, places)
    if interval is not None and not (np.isfinite(interval) and interval > 0):
        raise ValueError(f"interval must be positive, got {interval!r} s; None is for random intervals")
    located = pings.heard.sum(axis=1) > dimensions
    if not located.any():
        return _no_track(pings, dimensions, setting, interval)
    rows = lay_out(pings, interval, rise)
    model = ArrivalModel(rows, places, setting.sound_speed, robust=robust)
    scales = _first_scales(rows, setting)
    starts = _first_positions(model, rows.heard_row[located], setting), _ping_by_ping(pings, receivers, setting, rows, robust)
    state = min((_approach(model, start, scales) for start in starts if start is not None), key=lambda each: each[1])[0]
    if located.sum() >= FEWEST_PINGS:
        scales, state = _estimate_scales(model, scales, state)
    state, _, factor = model.minimize(state, scales)
    covariance = invert_blocks(factor, dimensions + 1)[rows.heard_row]
    kept = state[rows.heard_row]
    return ArrivalTrack(
        positions=Positions(position=kept[:, :-1], covariance=covariance[:, :-1, :-1]),
        transmission=pings.time + kept[:, -1] / setting.sound_speed,
        transmission_sigma=np.sqrt(covariance[:, -1, -1]) / setting.sound_speed,
        scales=scales,
        interval=interval,
        missed=len(rows.time) - len(pings.time),
    )


def _first_scales(rows: Rows, setting: ArraySetting) -> Scales:
    """A random walk that goes as far in an interval as the setting's first speed does."""
    usual = float(np.median(np.diff(rows.time))) if len(rows.time) > 1 else 1.0
    diffusivity = 0.5 * setting.first_speed_sigma**2 * max(usual, SHORTEST_INTERVAL)
    return Scales(diffusivity=diffusivity, sigma=setting.sigma, interval_sigma=FIRST_INTERVAL_SIGMA)


def _approach(model: ArrivalModel, position: Floats, scales: Scales) -> tuple[Floats, float]:
    """The states that a start (N, n) leads to, arrivals coarse at first, and minus the log of their density."""
    state = model.start(position)
    for coarseness in COARSENESS:
        state, _, _ = model.minimize(state, Scales(**(vars(scales) | {"sigma": coarseness * scales.sigma})))
    state, cost, _ = model.minimize(state, scales)
    return state, cost


def _ping_by_ping(pings: Pings, receivers: ArrayLike, setting: ArraySetting, rows: Rows, robust: bool) -> Floats | None:
    """(N, n): each ping where it is likeliest by itself, then lines; None where no ping tells. Few pings have no usual place."""
    found = wls_ml(pings, receivers, setting, robust=robust).position
    known = np.flatnonzero(np.isfinite(found).all(axis=1))
    if not known.size:
        return None
    row = np.arange(len(rows.time))
    return np.stack([np.interp(row, rows.heard_row[known], coordinate) for coordinate in found[known].T], axis=1)


def _first_positions(model: ArrivalModel, located: NDArray[np.intp], setting: ArraySetting) -> Floats:
    """(N, n): each located ping alone, from the array's middle and with coarse arrivals, then a running median, then lines."""
    rows = model.rows
    alone = Rows(
        time=rows.time[located],
        arrival=rows.arrival[located],
        heard_row=np.arange(len(located)),
        chained=np.zeros(len(located), dtype=bool),
        rise=None if rows.rise is None else rows.rise[located],
    )
    single = ArrivalModel(alone, model.places, model.sound_speed, robust=model.robust)
    middle = np.tile(model.places.mean(axis=0), (len(located), 1))
    extent = float(np.ptp(model.places, axis=0).max())
    loose = Scales(diffusivity=extent**2 / SHORTEST_INTERVAL, sigma=COARSENESS[0] * setting.sigma, interval_sigma=1.0)
    position = single.minimize(single.start(middle), loose)[0][:, :-1]
    padded = np.pad(position, ((SMOOTHING // 2, SMOOTHING // 2), (0, 0)), mode="edge")
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(padded, SMOOTHING, axis=0), axis=-1)
    row = np.arange(len(rows.time))
    return np.stack([np.interp(row, located, coordinate) for coordinate in smooth.T], axis=1)


def _estimate_scales(model: ArrivalModel, first: Scales, state: Floats) -> tuple[Scales, Floats]:
    """Nelder and Mead over the logs of the scales. Returns the best and the states there."""
    names = ["diffusivity", "sigma", *(["interval_sigma"] if model.second_row.size else [])]
    start = np.log([getattr(first, name) for name in names])

    def scales_at(log_scales: Floats) -> Scales:
        return Scales(**(vars(first) | dict(zip(names, np.exp(log_scales).tolist(), strict=True))))

    least, best = np.inf, first

    def minus_log_likelihood(log_scales: Floats) -> float:
        nonlocal least, best, state
        scales = scales_at(log_scales)
        found, cost, factor = model.minimize(state, scales)
        value = cost + float(np.sum(np.log(factor[0])))  # half the log of the determinant
        if value < least:
            least, best, state = value, scales, found
        return value

    simplex = np.vstack([start, start + np.diag(np.full(len(names), -1.0))])
    minimize(
        minus_log_likelihood,
        start,
        method="Nelder-Mead",
        bounds=[(value - REACH, value + REACH) for value in start],
        options={"initial_simplex": simplex, "xatol": 1.0, "fatol": TOLERANCE, "maxfev": MOST_EVALUATIONS},
    )
    return best, state


def _no_track(pings: Pings, dimensions: int, setting: ArraySetting, interval: float | None) -> ArrivalTrack:
    count = len(pings.time)
    nothing = Positions(
        position=np.full((count, dimensions), np.nan), covariance=np.full((count, dimensions, dimensions), np.nan)
    )
    scales = Scales(diffusivity=np.nan, sigma=setting.sigma, interval_sigma=np.nan)
    unknown = np.full(count, np.nan)
    return ArrivalTrack(
        positions=nothing, transmission=unknown, transmission_sigma=unknown, scales=scales, interval=interval, missed=0
    )
