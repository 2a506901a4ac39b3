"""How far off a belief was, and how sure that figure is, from the episodes of ``EpisodeRecord``.

Every figure carries an interval over episodes (``statistics.bootstrap``). Policies that met the same fish (paired episodes) are
compared by a ratio drawn in pairs; a group of training runs counts its runs, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.episode_record import EpisodeRecord, pool
from tagtrack.eval.statistics.bootstrap import Bootstrap, interquartile_mean, pooled_quantile_replicates
from tagtrack.eval.statistics.comparisons import wins
from tagtrack.eval.statistics.estimate import UNDEFINED, Estimate, Floats, Interval

# Range of the receiver (Clark et al. 2013, 4.1): a belief that is further off than this tells nobody where to listen.
LOST_ERROR = 100.0

SHARES = ("lost_fraction", "inside_perimeter")  # from 0 to 1

Metric = Callable[[EpisodeRecord], Floats]  # one number (E,) for each episode
Runs = Sequence[EpisodeRecord]  # one policy, or the runs of one training


def summarize(
    record: EpisodeRecord,
    *,
    perimeter: float = math.nan,
    lost_error: float = LOST_ERROR,
    metrics: Mapping[str, Metric] | None = None,
    bootstrap: Bootstrap | None = None,
) -> dict[str, Interval]:
    """The figures of one policy.

    Means (error, squared error, lost, range, inside) are taken over the steps of an episode first and then over
    episodes, so each episode weighs the same. Median and 95th percentile are those of all steps pooled, which is what
    the words promise, as is the error of the steps that are not lost. The trimmed mean drops the best and the worst quarter of
    episodes.

    Args:
        perimeter: distance that the vehicle should keep from the fish [m]; NaN where none is set.
        lost_error: a step is lost where the error exceeds this [m].
        metrics: further figures by name, the mean of what each says of every episode.
    Returns:
        `mean_error_m`, `median_error_m`, `rmse_m`, `p95_error_m`, `trimmed_mean_error_m`, `lost_fraction`,
        `error_if_not_lost_m`, `mean_range_m`, `inside_perimeter` and those of ``metrics``, each with its interval; NaN where a
        figure is not defined or, for the ends, E = 1. Of a fleet also those of `eval.fleet_metrics.summarize_fleet`.
    """
    bootstrap = bootstrap or Bootstrap()
    figures = _error_estimates(record, lost_error, bootstrap)
    intervals = {name: bootstrap.interval(estimate) for name, estimate in figures.items()}
    intervals |= {"mean_range_m": UNDEFINED, "inside_perimeter": UNDEFINED}
    for name, values in _episode_values(record, perimeter, lost_error, metrics or {}).items():
        intervals[name] = (bootstrap.share if name in SHARES else bootstrap.mean)(values)
    return intervals


def summarize_runs(
    runs: Runs,
    *,
    perimeter: float = math.nan,
    lost_error: float = LOST_ERROR,
    metrics: Mapping[str, Metric] | None = None,
    bootstrap: Bootstrap | None = None,
) -> dict[str, Interval]:
    """As ``summarize`` of several training runs as one: each weighs the same, and the intervals hold for other runs as well."""
    bootstrap = bootstrap or Bootstrap()
    together, metrics = pool(runs), metrics or {}
    fish = bootstrap.independent(together.episodes)
    figures = {"mean_range_m": UNDEFINED, "inside_perimeter": UNDEFINED}
    alone = [_error_values(run, lost_error) for run in runs]
    draws = [_error_draws(run, lost_error, bootstrap) for run in runs]
    for name, estimate in _error_estimates(together, lost_error, bootstrap).items():
        each = estimate.over_runs([run[name] for run in alone], fish, [drawn[name] for drawn in draws])
        figures[name] = bootstrap.interval(each)
    measured = [_episode_values(run, perimeter, lost_error, metrics) for run in runs]
    for name in measured[0]:
        values = np.array([run[name] for run in measured])
        if name in SHARES and not values.any():
            figures[name] = bootstrap.share(values.mean(axis=0))
            continue
        estimate = (bootstrap.share_estimate if name in SHARES else bootstrap.mean_estimate)(values.mean(axis=0))
        figure = bootstrap.interval(estimate.over_runs(values.mean(axis=1), fish, bootstrap.draws_of_mean(values)))
        figures[name] = _within_shares(figure) if name in SHARES else figure
    return figures


def _episode_values(
    record: EpisodeRecord, perimeter: float, lost_error: float, metrics: Mapping[str, Metric]
) -> dict[str, Floats]:
    """What is averaged over episodes, each (E,)."""
    values = {"lost_fraction": _share_of_steps(record.error > lost_error, record.error)}
    if record.range is not None:
        values["mean_range_m"] = np.nanmean(record.range, axis=1)
        if not math.isnan(perimeter):
            values["inside_perimeter"] = _share_of_steps(record.range < perimeter, record.error)
    return values | {name: measure(name, metric, record) for name, metric in metrics.items()}


def _error_values(record: EpisodeRecord, lost_error: float) -> dict[str, float]:
    """The figures of the error without their intervals."""
    error = record.error
    mean_error = np.nanmean(error, axis=1)
    median, p95 = np.nanquantile(error, (0.5, 0.95))
    kept = error[error <= lost_error]
    return {
        "mean_error_m": float(mean_error.mean()),
        "median_error_m": float(median),
        "rmse_m": math.sqrt(np.nanmean(error**2, axis=1).mean()),
        "p95_error_m": float(p95),
        "trimmed_mean_error_m": float(interquartile_mean(mean_error)),
        "error_if_not_lost_m": float(kept.mean()) if kept.size else math.nan,
    }


def _error_draws(record: EpisodeRecord, lost_error: float, bootstrap: Bootstrap) -> dict[str, Floats]:
    """The same in each draw of episodes (R,); not finite where all of a draw is lost."""
    error = record.error
    counts = bootstrap.counts(record.episodes)
    mean_error, mean_square = np.nanmean(error, axis=1), np.nanmean(error**2, axis=1)
    median, p95 = pooled_quantile_replicates(error, counts, (0.5, 0.95))
    kept = error <= lost_error
    with np.errstate(divide="ignore", invalid="ignore"):
        not_lost = (counts @ np.where(kept, error, 0.0).sum(axis=1)) / (counts @ kept.sum(axis=1))
    return {
        "mean_error_m": bootstrap.draws_of_mean(mean_error),
        "median_error_m": median,
        "rmse_m": np.sqrt(counts @ mean_square / counts.sum(axis=1)),
        "p95_error_m": p95,
        "trimmed_mean_error_m": interquartile_mean(mean_error, counts),
        "error_if_not_lost_m": not_lost,
    }


def _error_estimates(record: EpisodeRecord, lost_error: float, bootstrap: Bootstrap) -> dict[str, Estimate]:
    """The same with their standard errors."""
    values, draws = _error_values(record, lost_error), _error_draws(record, lost_error, bootstrap)
    mean = bootstrap.mean_estimate(np.nanmean(record.error, axis=1))
    return {
        name: mean if name == "mean_error_m"
        else bootstrap.estimate(values[name], drawn[np.isfinite(drawn)], episodes=record.episodes)
        for name, drawn in draws.items()
    }  # fmt: skip


def error_quantiles(runs: Runs, shares: Floats, bootstrap: Bootstrap) -> list[Interval]:
    """The error below which each share of the steps lies [m], of one policy or of the runs of a training."""
    together = pool(runs) if len(runs) > 1 else runs[0]
    values = np.nanquantile(together.error, shares)
    replicates = pooled_quantile_replicates(together.error, bootstrap.counts(together.episodes), shares.tolist())
    estimates = [
        bootstrap.estimate(value, drawn, episodes=together.episodes) for value, drawn in zip(values, replicates, strict=True)
    ]
    if len(runs) > 1:
        alone = np.array([np.nanquantile(run.error, shares) for run in runs])
        counts, fish = bootstrap.counts(together.episodes), bootstrap.independent(together.episodes)
        draws = np.array([pooled_quantile_replicates(run.error, counts, shares.tolist()) for run in runs])
        estimates = [
            estimate.over_runs(column, fish, drawn)
            for estimate, column, drawn in zip(estimates, alone.T, draws.swapaxes(0, 1), strict=True)
        ]
    return [bootstrap.interval(estimate) for estimate in estimates]


def measure(name: str, metric: Metric, record: EpisodeRecord) -> Floats:
    """What a metric says of each episode (E,). Raises ValueError where it says something else."""
    try:
        found = np.asarray(metric(record))
    except Exception as error:  # whatever a user's function may raise
        raise ValueError(f"the metric {name!r} failed on a record of errors {record.error.shape}: {error!r}") from error
    if found.shape != (record.episodes,) or found.dtype.kind not in "biuf":
        raise ValueError(
            f"the metric {name!r} must give one number for each episode, shape ({record.episodes},), got {found.dtype} of shape "
            f"{found.shape}"
        )
    return found.astype(np.float64)


def paired_ratio(first: EpisodeRecord, other: EpisodeRecord, *, bootstrap: Bootstrap | None = None) -> Interval:
    """Mean error of `first` over that of `other`, whose episode i met the same fish; above 1, `other` is better.

    Both are drawn with the same episodes, so that a fish that is hard for both cancels. Raises ValueError if the
    records differ in their number of episodes.
    """
    bootstrap = bootstrap or Bootstrap()
    return bootstrap.interval(ratio_estimate([first], [other], bootstrap))


def ratio_estimate(first: Runs, other: Runs, bootstrap: Bootstrap) -> Estimate | None:
    """As ``paired_ratio``, with its standard errors; of several runs on either side the mean error over them.

    The variance of the logarithm is that over fish plus that over the runs of either side.
    """
    if first[0].episodes != other[0].episodes:
        raise ValueError(f"paired records need the same episodes, got {first[0].episodes} and {other[0].episodes}")
    above, below = (np.array([np.nanmean(run.error, axis=1) for run in runs]) for runs in (first, other))
    estimate = bootstrap.ratio_estimate(above.mean(axis=0), below.mean(axis=0))
    for side in (above, below):
        if estimate is not None and estimate.relative and len(side) > 1:
            fish, draws = bootstrap.independent(side.shape[1]), bootstrap.draws_of_mean(side)
            estimate = estimate.over_runs(side.mean(axis=1), fish, draws)
    return estimate


def compare_runs(first: Runs, other: Runs, bootstrap: Bootstrap) -> dict[str, Interval | float]:
    """How ``other`` stands to ``first`` on the same fish: ``ratio`` of the mean errors (``paired_ratio``), ``median_ratio``, the
    median over episodes of the ratio of their mean errors, ``better``, the share of episodes in which ``other`` has the smaller
    one, and ``p``, the two-sided p-value of a ratio of 1."""
    estimate = ratio_estimate(first, other, bootstrap)
    above = np.mean([np.nanmean(run.error, axis=1) for run in first], axis=0)
    each = np.array([np.nanmean(run.error, axis=1) for run in other])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = above / each.mean(axis=0)
    median: Estimate | None = None
    if np.isfinite(ratios).all() and (ratios > 0).all():
        replicates = pooled_quantile_replicates(ratios[:, None], bootstrap.counts(ratios.size), (0.5,))[0]
        median = bootstrap.estimate(np.median(ratios), replicates, episodes=ratios.size)
    shares = np.array([wins(above, run) for run in each])
    better = bootstrap.share_estimate(shares.mean(axis=0))
    if len(each) > 1:
        fish = bootstrap.independent(ratios.size)
        better = better.over_runs(shares.mean(axis=1), fish, bootstrap.draws_of_mean(shares))
        if median is not None:
            counts = bootstrap.counts(ratios.size)
            with np.errstate(divide="ignore"):
                alone = above / each
            draws = [pooled_quantile_replicates(run[:, None], counts, (0.5,))[0] for run in alone]
            median = median.over_runs(np.median(alone, axis=1), fish, draws)
    return {
        "ratio": bootstrap.interval(estimate),
        "median_ratio": bootstrap.interval(median),
        "better": _within_shares(bootstrap.interval(better)),
        "p": math.nan if estimate is None or not estimate.relative else estimate.p_value(),
        "freedom": math.inf if estimate is None else estimate.freedom,
    }


def _within_shares(figure: Interval) -> Interval:
    return Interval(value=figure.value, low=max(figure.low, 0.0), high=min(figure.high, 1.0))


def _share_of_steps(flag: NDArray[np.bool_], error: Floats) -> Floats:
    return flag.sum(axis=1) / (~np.isnan(error)).sum(axis=1)
