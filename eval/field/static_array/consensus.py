"""Arrivals that disagree with the others are left out where enough agree; else the misfit says how little a position is worth.

Multipath makes arrivals late (Masmitja et al. 2020, "5 % of outliers" in Fig. 2D), and least squares spreads the harm over a
position without a word. A ping with m arrivals has m - n - 1 to spare: with two or more one that is wrong can be told from the
rest, as the only one without which they fit; with one to spare it is known only that something is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from tagtrack.eval.field.static_array.likelihood import make_likelihood
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, level_places

IMPLAUSIBLE = 1e-4  # chance of so bad a fit by noise alone
CLEARER = 4.0  # by which the fit without the wrong arrival must be better than without any other [cost]


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """K pings as far as their arrivals agree."""

    pings: Pings
    misfit: Floats  # (K,) root of the cost per spare arrival, 1 as expected; NaN where none is to spare
    dropped: int  # arrivals that were left out


def agree(pings: Pings, receivers: ArrayLike, setting: ArraySetting) -> Agreement:
    """Leave out arrivals that no position explains together with the others.

    Args:
        pings: arrivals (K, R) [s], NaN where not heard. receivers: (R, n) [m]. setting: sound speed, and sigma of an arrival.
    """
    arrival = np.array(pings.arrival, dtype=np.float64)
    cost, spare = _fit(pings, receivers, setting)
    wrong = np.flatnonzero(_is_poor(cost, spare) & (spare >= 2))
    dropped = 0
    while wrong.size:
        worst, better, sure = _find_odd_one(replace(pings, arrival=arrival).take(wrong), receivers, setting)
        arrival[wrong[sure], worst[sure]] = np.nan
        dropped += int(sure.sum())
        cost[wrong[sure]] = better[sure]
        spare[wrong[sure]] -= 1
        rows = wrong[sure]
        wrong = rows[_is_poor(cost[rows], spare[rows]) & (spare[rows] >= 2)]
    with np.errstate(divide="ignore", invalid="ignore"):
        misfit = np.where(spare > 0, np.sqrt(2.0 * cost / np.maximum(spare, 1)), np.nan)
    return Agreement(pings=replace(pings, arrival=arrival), misfit=misfit, dropped=dropped)


def _fit(pings: Pings, receivers: ArrayLike, setting: ArraySetting) -> tuple[Floats, NDArray[np.intp]]:
    """Least cost (K,) of each ping, and its arrivals to spare."""
    likelihood = make_likelihood(pings, receivers, setting)
    position = wls_ml(pings, receivers, setting).position
    return likelihood.cost(position), np.maximum(likelihood.known_differences - likelihood.dimensions, 0)


def _is_poor(cost: Floats, spare: NDArray[np.intp]) -> NDArray[np.bool_]:
    return np.asarray((spare > 0) & (cost > 0.5 * chdtri(np.maximum(spare, 1), IMPLAUSIBLE)))


def _find_odd_one(
    pings: Pings, receivers: ArrayLike, setting: ArraySetting
) -> tuple[NDArray[np.intp], Floats, NDArray[np.bool_]]:
    """The arrival (K,) without which the others of a ping fit best, the cost (K,) then, and whether it is surely that one."""
    arrival = pings.arrival
    costs = np.full(arrival.shape, np.inf)
    for receiver in range(arrival.shape[1]):
        rows = np.flatnonzero(np.isfinite(arrival[:, receiver]))
        if rows.size:
            others = pings.take(rows)
            others.arrival[:, receiver] = np.nan
            found, _ = _fit(others, receivers, setting)
            costs[rows, receiver] = np.where(np.isfinite(found), found, np.inf)
    order = np.sort(costs, axis=1)
    heard = np.isfinite(arrival).sum(axis=1)
    spare = heard - level_places(pings, receivers)[0].shape[1] - 2  # that are left without it
    best = order[:, 0]
    # Many to spare: whatever is left out helps, for more than one is wrong, and one after the other goes.
    sure = np.isfinite(best) & ((order[:, 1] - best > CLEARER) | (spare >= 3))
    return costs.argmin(axis=1), best, sure
