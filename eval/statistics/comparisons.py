"""What several comparisons may claim: who is better how often, corrections for having looked often, one figure over tasks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from tagtrack.eval.statistics.estimate import Estimate, Floats


def wins(first: Floats, other: Floats) -> Floats:
    """(E,) 1 where ``other`` has the smaller error on the same fish, 1/2 where both are equal; its mean is the probability of
    improvement (Agarwal et al. 2021, NeurIPS, 4.3, there of unpaired runs)."""
    return np.where(other < first, 1.0, np.where(other == first, 0.5, 0.0))


def holm(p_values: ArrayLike) -> Floats:
    """p-values (M,) corrected for being M (Holm 1979, Scand. J. Stat. 6, 65): those below 0.05 err in 5 % of
    cases at most, all together.

    NaN, where nothing was tested, stays and does not count.

    >>> holm([0.01, 0.04, 0.03]).tolist()
    [0.03, 0.06, 0.06]
    """
    p = np.asarray(p_values, dtype=np.float64)
    known = np.flatnonzero(~np.isnan(p))
    corrected = np.full(p.shape, np.nan)
    order = known[np.argsort(p[known], kind="stable")]
    stepped = np.maximum.accumulate(p[order] * np.arange(order.size, 0, -1)) if order.size else p[order]
    corrected[order] = np.minimum(stepped, 1.0)
    return corrected


def geometric_mean(estimates: Sequence[Estimate]) -> Estimate:
    """One figure over K tasks that have no fish and no training run in common: the geometric mean of their ratios.

    Raises:
        ValueError: for no task, or for a ratio that is not positive.
    """
    if not estimates:
        raise ValueError("a mean over tasks needs at least one task")
    if bad := [each.value for each in estimates if not (each.relative and each.value > 0)]:
        raise ValueError(f"a geometric mean takes positive ratios, got {bad[0]}")
    number = len(estimates)
    variances = np.array([[each.below**2, each.above**2] for each in estimates]) / number**2
    total, middle = variances.sum(axis=0), variances.mean(axis=1)
    freedom = math.inf
    finite = np.array([each.freedom for each in estimates])
    if middle.sum() > 0 and np.isfinite(finite).any():
        freedom = middle.sum() ** 2 / (middle**2 / finite).sum()
    value = math.exp(np.mean([math.log(each.value) for each in estimates]))
    return Estimate(value=value, below=math.sqrt(total[0]), above=math.sqrt(total[1]), relative=True, freedom=freedom)


def estimate_of(value: float, low: float, high: float, freedom: float | None, level: float = 0.95) -> Estimate:
    """The estimate behind a positive figure and its interval, as a file holds them (no freedom: infinite)."""
    freedom = math.inf if freedom is None else freedom
    reach = stats.t.ppf(0.5 + level / 2, freedom)
    return Estimate(value=value, below=math.log(value / low) / reach, above=math.log(high / value) / reach, relative=True,
                    freedom=freedom)
