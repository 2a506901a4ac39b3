"""How exact arrivals are, from the pings themselves: what a position leaves unexplained where more was heard than it takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from tagtrack.eval.field.static_array.likelihood import make_likelihood
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings

ROUNDING = float(1.0 / np.sqrt(12.0))  # standard deviation of what rounding adds, in steps
LEAST_PINGS = 20  # with a spare arrival, to tell anything
MOST_PINGS = 4000
NEAR, OFTEN = 2.0, 0.2  # sigma times the speed of sound from a receiver; share of the pings so near that makes them a case apart
MOST_SIMULATED, PASSES = 400, 3


def estimate_sigma(
    pings: Pings, receivers: ArrayLike, setting: ArraySetting, information: Floats | None = None, *, step: float = 0.0
) -> float | None:
    """Standard deviation of an arrival time [s], robust against multipath; None where too few pings say anything.

    From the median of the least cost of pings with at least one difference more than a position takes: at the right sigma it is
    half the median of chi-square. For a tag that hangs beside a receiver it is more, for no place explains an arrival there that
    is too early; it is then that of simulated pings that leave as much.

    Args:
        pings, receivers, setting, information: as the estimators take them; the sigma of ``setting`` is where it begins, and with
            ``information`` the result is by how much that is out, times ``setting.sigma``.
        step: to which times were rounded [s]. Pings of a tag at rest then leave the same few errors again and again, whose median
            may be anything; as much noise again as rounding made, taken off at the end, spreads them.
    """
    likelihood = make_likelihood(pings, receivers, setting, information)
    spare = likelihood.known_differences - likelihood.dimensions
    rows = np.flatnonzero(spare > 0)
    if rows.size < LEAST_PINGS:
        return None
    rows = rows[:: -(-rows.size // MOST_PINGS)]
    part = _spread(pings.take(rows), step)
    likelihood = make_likelihood(part, receivers, setting, None if information is None else information[rows])
    position = wls_ml(part, receivers, setting, information=None if information is None else information[rows]).position
    cost = likelihood.cost(position)
    ratio = 2.0 * cost / chdtri(spare[rows], 0.5)
    known = np.isfinite(ratio)
    if known.sum() < LEAST_PINGS:
        return None
    median = max(float(np.median(ratio[known])), 1e-6)
    sigma = float(setting.sigma * np.sqrt(median))
    if information is None:
        sigma = _beside_receivers(part.take(known), receivers, setting, position[known], median, sigma)
    return float(np.sqrt(max(sigma**2 - (step * ROUNDING) ** 2, (step * ROUNDING) ** 2, 1e-6 * setting.sigma**2)))


def _spread(pings: Pings, step: float) -> Pings:
    """Pings whose arrivals lie anywhere in the step to which they were rounded."""
    if not step:
        return pings
    within = np.random.default_rng(0).uniform(-0.5 * step, 0.5 * step, pings.arrival.shape)
    return replace(pings, arrival=pings.arrival + within)


def _beside_receivers(
    pings: Pings, receivers: ArrayLike, setting: ArraySetting, position: Floats, median: float, sigma: float
) -> float:
    """The sigma itself, or, where many positions (K, n) are as near to a receiver as noise reaches, one that allows for it.

    At it pings simulated from where those beside a receiver lie in the middle leave as much unexplained as these: ``median`` of
    the ratio to chi-square.
    """
    rows = np.arange(0, len(position), -(-len(position) // MOST_SIMULATED))
    part = pings.take(rows)
    likelihood = make_likelihood(part, receivers, setting)
    away = np.linalg.norm(position[rows, None] - likelihood.receivers, axis=2)
    if likelihood.rise is not None:
        away = np.hypot(away, likelihood.rise)
    beside = away.min(axis=1) < NEAR * setting.sound_speed * sigma
    if beside.mean() < OFTEN:
        return sigma
    place = position[rows]
    for receiver in np.unique(away.argmin(axis=1)[beside]):
        own = beside & (away.argmin(axis=1) == receiver)
        place[own] = np.median(place[own], axis=0)
    typical = chdtri(likelihood.known_differences - likelihood.dimensions, 0.5)
    travel = np.where(part.heard, likelihood.arrival - likelihood.errors(place), np.nan)
    noise = np.random.default_rng(0).normal(size=travel.shape)
    for _ in range(PASSES):
        simulated = replace(part, arrival=travel + sigma * noise)
        found = wls_ml(simulated, receivers, setting).position
        ratio = 2.0 * make_likelihood(simulated, receivers, setting).cost(found) / typical
        if not np.isfinite(ratio).any():
            break
        sigma *= float(np.sqrt(median / max(np.median(ratio[np.isfinite(ratio)]), 1e-6)))
    return sigma
