"""A figure, its standard errors to either side, and the interval that they claim.

A bootstrap over fish gives ends that need not lie evenly about the figure; training runs, of which there are few, add a variance
with few degrees of freedom. Both are kept as standard errors to either side, on the logarithm where the figure is positive, so
that they add up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A figure and its interval; NaN where it is not defined."""

    value: float
    low: float
    high: float

    def to_json(self) -> dict[str, float | None]:
        """The three numbers as JSON has them, null for what is not finite."""
        numbers = {"value": self.value, "low": self.low, "high": self.high}
        return {key: float(number) if math.isfinite(number) else None for key, number in numbers.items()}


UNDEFINED = Interval(value=math.nan, low=math.nan, high=math.nan)


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A figure with its standard error below and above it, relative ones (of its logarithm) where ``relative``."""

    value: float
    below: float  # NaN: nobody knows
    above: float
    relative: bool
    freedom: float = math.inf  # degrees of freedom of Student's t; infinite for the normal distribution

    def interval(self, level: float = 0.95) -> Interval:
        """The interval that holds the truth with a probability of ``level``."""
        reach = stats.t.ppf(0.5 + level / 2, self.freedom)
        if self.relative:
            low, high = self.value * math.exp(-reach * self.below), self.value * math.exp(reach * self.above)
        else:
            low, high = self.value - reach * self.below, self.value + reach * self.above
        return Interval(value=self.value, low=low, high=high)

    def p_value(self, truth: float = 1.0) -> float:
        """Two-sided: how often a figure would lie so far from ``truth``, in its standard errors, if that were true."""
        distance = math.log(self.value / truth) if self.relative else self.value - truth
        error = self.below if distance > 0 else self.above
        if not error > 0:
            return math.nan if math.isnan(error) else float(distance == 0)
        return float(2 * stats.t.sf(abs(distance) / error, self.freedom))

    def over_runs(self, values: ArrayLike, fish: float, draws: ArrayLike | None = None) -> Estimate:
        """The same figure as one of training runs, drawn like the fish from all that might have been.

        Variances of fish and of runs add up; their degrees of freedom follow Satterthwaite (1946, Biometrics Bulletin 2, 110).
        The runs met the same fish, so that what the fish do to all of them does not count twice. What they do to each run alone
        would, once among the fish and once as if the runs differed: by as much as the runs differ more in draws of fish than they
        did, it is taken off (the bootstrap's correction of bias, Efron and Tibshirani 1993, 10.2).

        Args:
            values: (R,) the figure of each run alone.
            fish: number of episodes (or of independent clusters of them) behind the standard errors.
            draws: (R, B) the figure of each run alone in each draw of fish; without them nothing is taken off.
        """
        values = np.asarray(values, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.log(values) if self.relative else values
        if values.size < 2 or not np.isfinite(scale).all():
            return replace(self, below=math.nan, above=math.nan)
        apart = float(scale.var(ddof=1))
        own = apart if draws is None else max(apart - self._by_chance(np.asarray(draws, dtype=np.float64), apart), 0.0)
        of_runs, uncertain = own / values.size, apart / values.size
        sides = [math.hypot(side, math.sqrt(of_runs)) for side in (self.below, self.above)]
        of_fish = (self.below**2 + self.above**2) / 2
        if uncertain == of_fish == 0:
            return self
        parts = uncertain**2 / (values.size - 1) + of_fish**2 / max(min(fish - 1, self.freedom), 1)
        freedom = max((of_runs + of_fish) ** 2 / parts, 1.0)
        return replace(self, below=sides[0], above=sides[1], freedom=freedom)

    def _by_chance(self, draws: Floats, apart: float) -> float:
        """By how much the variance between runs is larger in draws of fish (R, B) than it was: what the fish add to it."""
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = (np.log(draws) if self.relative else draws).var(axis=0, ddof=1)
        spread = spread[np.isfinite(spread)]
        return max(float(spread.mean()) - apart, 0.0) if spread.size else 0.0
