"""How far off a belief was, and how sure that figure is, from the episodes of ``EpisodeRecord``.

Every figure carries a percentile bootstrap interval
in which whole episodes are drawn anew: the steps of one episode depend on each other, the episodes do not. Policies
that met the same fish (paired episodes) are compared by a ratio drawn in pairs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tagtrack.eval.episode_record import EpisodeRecord, Floats

# Range of the receiver (Clark et al. 2013, 4.1): a belief that is further off than this tells nobody where to listen.
LOST_ERROR = 100.0


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A figure and its bootstrap interval; NaN where it is not defined."""

    value: float
    low: float
    high: float

    def to_json(self) -> dict[str, float | None]:
        """The three numbers as JSON has them, null for what is not finite."""
        numbers = {"value": self.value, "low": self.low, "high": self.high}
        return {key: float(number) if math.isfinite(number) else None for key, number in numbers.items()}


UNDEFINED = Interval(value=math.nan, low=math.nan, high=math.nan)


@dataclass(frozen=True, kw_only=True)
class Bootstrap:
    """Percentile bootstrap over episodes (Efron and Tibshirani 1993, ch. 13).

    The seed is fixed, so that the same records always give the same table, and so that all policies of a benchmark are
    drawn with the same episodes.
    """

    resamples: int = 2000
    level: float = 0.95
    seed: int = 0

    def __post_init__(self) -> None:
        if self.resamples < 1:
            raise ValueError(f"resamples must be at least 1, got {self.resamples}")
        if not 0 < self.level < 1:
            raise ValueError(f"level must lie between 0 and 1, got {self.level}")

    def counts(self, episodes: int) -> Floats:
        """How often each episode is drawn: (R, E), rows sum to E; floats, because they go into matrix products."""
        drawn = np.random.default_rng(self.seed).integers(episodes, size=(self.resamples, episodes))
        cells = drawn + episodes * np.arange(self.resamples)[:, None]
        counts = np.bincount(cells.ravel(), minlength=self.resamples * episodes)
        return counts.reshape(self.resamples, episodes).astype(np.float64)

    def interval(self, value: float | Floats, replicates: Floats) -> Interval:
        """The middle `level` of the replicates (R,) about a figure."""
        tail = (1 - self.level) / 2
        low, high = np.quantile(replicates, (tail, 1 - tail))
        return Interval(value=float(value), low=float(low), high=float(high))

    def mean(self, values: ArrayLike) -> Interval:
        """Mean of one value per episode (E,); a single episode has no interval, an undefined value no figure."""
        values = np.asarray(values, dtype=np.float64)
        counts = self.counts(values.size)
        return _unless_single(values.size, self.interval(values.mean(), counts @ values / values.size))


def summarize(
    record: EpisodeRecord,
    *,
    perimeter: float = math.nan,
    lost_error: float = LOST_ERROR,
    bootstrap: Bootstrap | None = None,
) -> dict[str, Interval]:
    """The figures of one policy.

    Means (error, squared error, lost, range, inside) are taken over the steps of an episode first and then over
    episodes, so each episode weighs the same. Median and 95th percentile are those of all steps pooled, which is what
    the words promise. The interquartile mean (Agarwal et al. 2021) drops the best and the worst quarter of episodes.

    Args:
        perimeter: distance that the vehicle should keep from the fish [m]; NaN where none is set.
        lost_error: a step is lost where the error exceeds this [m].
    Returns:
        `mean_error_m`, `median_error_m`, `rmse_m`, `p95_error_m`, `iqm_error_m`, `lost_fraction`, `mean_range_m`,
        `inside_perimeter`, each with its interval; NaN where a figure is not defined or, for the ends, E = 1. Of a fleet
        also those of `eval.fleet_metrics.summarize_fleet`.
    """
    bootstrap = bootstrap or Bootstrap()
    episodes, error = record.episodes, record.error
    counts = bootstrap.counts(episodes)
    mean_error = np.nanmean(error, axis=1)
    mean_square = np.nanmean(error**2, axis=1)
    median, p95 = np.nanquantile(error, (0.5, 0.95))
    median_replicates, p95_replicates = pooled_quantile_replicates(error, counts, (0.5, 0.95))
    figures = {
        "mean_error_m": bootstrap.mean(mean_error),
        "median_error_m": bootstrap.interval(median, median_replicates),
        "rmse_m": bootstrap.interval(math.sqrt(mean_square.mean()), np.sqrt(counts @ mean_square / episodes)),
        "p95_error_m": bootstrap.interval(p95, p95_replicates),
        "iqm_error_m": bootstrap.interval(interquartile_mean(mean_error), interquartile_mean(mean_error, counts)),
        "lost_fraction": bootstrap.mean(_share_of_steps(error > lost_error, error)),
        "mean_range_m": UNDEFINED,
        "inside_perimeter": UNDEFINED,
    }
    if record.range is not None:
        figures["mean_range_m"] = bootstrap.mean(np.nanmean(record.range, axis=1))
    if record.range is not None and not math.isnan(perimeter):
        figures["inside_perimeter"] = bootstrap.mean(_share_of_steps(record.range < perimeter, error))
    return {name: _unless_single(episodes, figure) for name, figure in figures.items()}


def paired_ratio(first: EpisodeRecord, other: EpisodeRecord, *, bootstrap: Bootstrap | None = None) -> Interval:
    """Mean error of `first` over that of `other`, whose episode i met the same fish; above 1, `other` is better.

    Both are drawn with the same episodes, so that a fish that is hard for both cancels. Raises ValueError if the
    records differ in their number of episodes.
    """
    if first.episodes != other.episodes:
        raise ValueError(f"paired records need the same episodes, got {first.episodes} and {other.episodes}")
    bootstrap = bootstrap or Bootstrap()
    above, below = np.nanmean(first.error, axis=1), np.nanmean(other.error, axis=1)
    if not below.any():
        return UNDEFINED
    counts = bootstrap.counts(first.episodes)
    with np.errstate(divide="ignore", invalid="ignore"):  # a draw of only perfect episodes
        replicates = (counts @ above) / (counts @ below)
    return _unless_single(first.episodes, bootstrap.interval(above.mean() / below.mean(), replicates))


def ratios_to_first(records: Mapping[str, EpisodeRecord], *, bootstrap: Bootstrap | None = None) -> dict[str, Interval]:
    """`paired_ratio` of the first record named over every other one, keyed `FIRST/NAME`."""
    first, *others = records
    return {f"{first}/{name}": paired_ratio(records[first], records[name], bootstrap=bootstrap) for name in others}


def interquartile_mean(values: Floats, counts: Floats | None = None) -> Floats:
    """Mean of (E,) values without the lowest and the highest quarter (each rounded down to whole episodes).

    Args:
        counts: (R, E) how often each value is drawn; without it every value counts once.
    Returns: (R,), or a number without counts.

    >>> float(interquartile_mean(np.array([3.0, 1000.0, 5.0, 1.0])))
    4.0
    """
    order = np.argsort(values)
    drawn = np.ones(values.size) if counts is None else counts[:, order]
    cut = values.size // 4
    # Of the copies of a value, those whose rank lies between the two cuts are kept: no resample needs sorting.
    kept = np.diff(np.clip(np.cumsum(drawn, axis=-1), cut, values.size - cut), axis=-1, prepend=cut)
    return kept @ values[order] / (values.size - 2 * cut)


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


def _share_of_steps(flag: NDArray[np.bool_], error: Floats) -> Floats:
    return flag.sum(axis=1) / (~np.isnan(error)).sum(axis=1)


def _unless_single(episodes: int, figure: Interval) -> Interval:
    return figure if episodes > 1 else Interval(value=figure.value, low=math.nan, high=math.nan)
