"""The bootstrap over episodes: the steps of one episode depend on each other, the episodes do not.

Means of errors with rare losses are skewed: with one episode in a hundred lost, percentile intervals of 512 episodes hold the
truth in 91 of 100 cases. Means and their ratios are therefore studentized, on the logarithm (bootstrap-t, Efron and Tibshirani
1993, 12.5), which holds it in 95. Episodes of recorded tracks are drawn by clusters (``clusters``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from tagtrack.eval.statistics.clusters import Clusters
from tagtrack.eval.statistics.estimate import UNDEFINED, Estimate, Floats, Interval

FEWEST_STUDENTIZED = 20  # episodes; of fewer, many draws hardly spread
Studentized = tuple[float, Floats]  # the standard error of a figure, and (R,) those of its replicates


@dataclass(frozen=True, kw_only=True)
class Bootstrap:
    """Draws episodes anew.

    The seed is fixed, so that the same records always give the same table, and so that all policies of a benchmark are drawn with
    the same episodes.
    """

    resamples: int = 2000
    level: float = 0.95
    seed: int = 0
    clusters: Clusters | None = None  # of episodes that are drawn together; without them each stands for itself

    def __post_init__(self) -> None:
        if self.resamples < 1:
            raise ValueError(f"resamples must be at least 1, got {self.resamples}")
        if not 0 < self.level < 1:
            raise ValueError(f"level must lie between 0 and 1, got {self.level}")

    def counts(self, episodes: int) -> Floats:
        """How often each episode is drawn: (R, E); floats, because they go into matrix products."""
        drawn = _draw(self.clusters.count if self.clusters else episodes, self.resamples, self.seed)
        return drawn if self.clusters is None else drawn[:, self.clusters.label]

    def independent(self, episodes: int) -> int:
        """How many of so many episodes stand for themselves: their clusters, where they have any."""
        return episodes if self.clusters is None else self.clusters.count

    def estimate(
        self, value: float | Floats, replicates: Floats, studentized: Studentized | None = None, *, episodes: int
    ) -> Estimate:
        """A figure with its standard errors, from its replicates (R,); relative where all are positive.

        Args:
            studentized: standard errors of the figure and of its replicates; without them the ends are plain percentiles.
            episodes: E; a single one has no interval, nor have too few clusters.
        """
        value = float(value)
        if episodes < 2 or (self.clusters is not None and not self.clusters.suffices) or not math.isfinite(value):
            return Estimate(value=value, below=math.nan, above=math.nan, relative=value > 0)
        tails = ((1 - self.level) / 2, (1 + self.level) / 2)
        relative = bool(value > 0 and replicates.min() > 0)
        if relative and studentized is not None and self.clusters is None and episodes >= FEWEST_STUDENTIZED:
            error, errors = studentized
            floor = max(0.1 * error, 1e-12)  # a draw of equal episodes must not stretch the interval without end
            far_below, far_above = np.quantile(np.log(replicates / value) / np.maximum(errors, floor), tails)
            below, above = far_above * error, -far_below * error
        else:
            low, high = np.quantile(replicates, tails)
            below, above = (math.log(value / low), math.log(high / value)) if relative else (value - low, high - value)
        reach = stats.norm.ppf(tails[1]) / (1.0 if self.clusters is None else self.clusters.reach(self.level))
        return Estimate(value=value, below=max(below, 0.0) / reach, above=max(above, 0.0) / reach, relative=relative)

    def draws_of_mean(self, values: ArrayLike) -> Floats:
        """Mean over episodes in each draw: (..., R) of values (..., E)."""
        values = np.asarray(values, dtype=np.float64)
        counts = self.counts(values.shape[-1])
        return values @ counts.T / counts.sum(axis=1)

    def mean(self, values: ArrayLike) -> Interval:
        """Mean of one value per episode (E,); a single episode has no interval, an undefined value no figure."""
        return self.interval(self.mean_estimate(values))

    def mean_estimate(self, values: ArrayLike) -> Estimate:
        """As ``mean``, with its standard errors."""
        values = np.asarray(values, dtype=np.float64)
        counts = self.counts(values.size)
        return self.estimate(
            values.mean(), (counts @ values) / counts.sum(axis=1), _relative_errors(counts, values), episodes=values.size
        )

    def share(self, values: ArrayLike) -> Interval:
        """As ``mean`` of shares from 0 to 1: none in E episodes may still be some in others, and the same for all.

        With 0 of E the interval ends at 1 - 0.025^(1 / E) (Clopper and Pearson 1934), 0.7 % for 512.
        """
        values = np.asarray(values, dtype=np.float64)
        figure, number = self.interval(self.share_estimate(values)), self.independent(values.size)
        if math.isnan(figure.low) or 0 < figure.value < 1:
            return figure
        unseen = 1 - ((1 - self.level) / 2) ** (1 / number)
        return Interval(value=figure.value, low=max(figure.value - unseen, 0.0), high=min(figure.value + unseen, 1.0))

    def share_estimate(self, values: ArrayLike) -> Estimate:
        """As ``mean_estimate`` of shares, by plain percentiles: where few episodes have any, a draw's own spread says nothing."""
        values = np.asarray(values, dtype=np.float64)
        counts = self.counts(values.size)
        return self.estimate(values.mean(), (counts @ values) / counts.sum(axis=1), episodes=values.size)

    def ratio_estimate(self, above: Floats, below: Floats) -> Estimate | None:
        """Mean of ``above`` over that of ``below``, each (E,), drawn in pairs; None where that of ``below`` is 0."""
        if not below.any():
            return None
        counts = self.counts(above.size)
        with np.errstate(divide="ignore", invalid="ignore"):  # a draw of only perfect episodes
            replicates = (counts @ above) / (counts @ below)
        errors = _relative_errors(counts, above, below)
        return self.estimate(above.mean() / below.mean(), replicates, errors, episodes=above.size)

    def interval(self, estimate: Estimate | None) -> Interval:
        """At this bootstrap's level; undefined for None."""
        return UNDEFINED if estimate is None else estimate.interval(self.level)


@lru_cache(maxsize=2)  # all figures of a table are drawn alike
def _draw(things: int, resamples: int, seed: int) -> Floats:
    """How often each of so many things is drawn (R, C); rows sum to C."""
    drawn = np.random.default_rng(seed).integers(things, size=(resamples, things))
    cells = drawn + things * np.arange(resamples)[:, None]
    counts = np.bincount(cells.ravel(), minlength=resamples * things).reshape(resamples, things).astype(np.float64)
    counts.setflags(write=False)
    return counts


def _relative_errors(counts: Floats, above: Floats, below: Floats | None = None) -> Studentized:
    """Standard error of the logarithm of a mean of (E,) values, or of a ratio of two, and (R,) those of its replicates.

    To first order an episode adds above / mean(above) - below / mean(below) to the logarithm.
    """
    rows = np.concatenate([np.ones((1, above.size)), counts])  # what happened is one more draw
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = rows @ above / above.size
        square = rows @ above**2 / above.size / scaled**2 - 1.0
        if below is not None:
            other = rows @ below / below.size
            square = square + rows @ below**2 / below.size / other**2 - 1.0
            square -= 2.0 * (rows @ (above * below) / below.size / (scaled * other) - 1.0)
        errors = np.sqrt(np.maximum(np.nan_to_num(square), 0.0) / above.size)
    return float(errors[0]), errors[1:]


def interquartile_mean(values: Floats, counts: Floats | None = None) -> Floats:
    """Mean of (E,) values without the lowest and the highest quarter (each rounded down to whole ones as drawn).

    Args:
        counts: (R, E) how often each value is drawn; without it every value counts once.
    Returns: (R,), or a number without counts.

    >>> float(interquartile_mean(np.array([3.0, 1000.0, 5.0, 1.0])))
    4.0
    """
    order = np.argsort(values)
    drawn = np.ones(values.size) if counts is None else counts[:, order]
    total = drawn.sum(axis=-1, keepdims=True)
    cut = total // 4
    # Of the copies of a value, those whose rank lies between the two cuts are kept: no resample needs sorting.
    ranks = np.clip(np.cumsum(drawn, axis=-1), cut, total - cut)
    kept = np.diff(np.concatenate([cut, ranks], axis=-1), axis=-1)
    return kept @ values[order] / (total - 2 * cut)[..., 0]


def pooled_quantile_replicates(error: Floats, counts: Floats, probabilities: Sequence[float]) -> Floats:
    """Quantiles of the pooled steps of each resample, exactly as `np.quantile` on the steps themselves would give them.

    The steps are sorted once and cut into blocks. How many steps of a resample fall into each block is one matrix
    product; only the block that holds the wanted rank is then counted step by step.

    Args:
        error: (E, K), NaN where there is no step.
        counts: (R, E) how often each episode is drawn.
    Returns: (P, R), one row per probability.
    """
    episode, step = np.nonzero(~np.isnan(error))
    value = error[episode, step]
    order = np.argsort(value)
    value, episode = value[order], episode[order]
    size = math.ceil(math.sqrt(value.size))
    blocks = math.ceil(value.size / size)
    members = np.bincount(episode * blocks + np.arange(value.size) // size, minlength=counts.shape[1] * blocks)
    up_to = np.cumsum(counts @ members.reshape(-1, blocks), axis=1)  # (R, blocks) steps in this block or before it

    def at_rank(rank: Floats) -> Floats:
        found = np.empty(rank.size)
        block = (up_to <= rank[:, None]).sum(axis=1)
        for b in np.unique(block):
            rows = np.flatnonzero(block == b)
            before = up_to[rows, b - 1] if b else np.zeros(rows.size)
            here = slice(b * size, (b + 1) * size)
            within = np.cumsum(counts[np.ix_(rows, episode[here])], axis=1)
            found[rows] = value[here][(within <= (rank[rows] - before)[:, None]).sum(axis=1)]
        return found

    last = up_to[:, -1] - 1
    quantiles = []
    for probability in probabilities:
        position = probability * last
        below, above = at_rank(np.floor(position)), at_rank(np.minimum(np.floor(position) + 1, last))
        quantiles.append(below + (position % 1) * (above - below))
    return np.array(quantiles)
