"""The figures of fleets: each tag's error, how often vehicles came too near one another, what they sent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tagtrack.eval.episode_record import FleetRecord
from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.estimate import Floats, Interval


def summarize_fleet(
    records: Sequence[FleetRecord], *, lost_error: float, bootstrap: Bootstrap | None = None
) -> dict[str, Interval]:
    """The figures of one policy, or of the runs of one training, beside those of ``metrics.summarize``.

    Args:
        lost_error: a tag is lost in a step where its own error exceeds this [m].
    Returns:
        ``worst_tag_error_m``, the mean error of the tag that was known worst in each episode; ``tag_lost_fraction``, the share of
        time lost, mean over tags; ``encroachments_per_hour`` and ``messages_per_hour`` of all vehicles; for each tag
        ``tag_0_error_m`` ... and ``tag_0_lost_fraction`` ...
    """
    bootstrap = bootstrap or Bootstrap()
    runs = [_episode_values(record, lost_error) for record in records]
    figures = {}
    for name in runs[0]:
        values = np.array([run[name] for run in runs])
        estimate = bootstrap.mean_estimate(values.mean(axis=0))
        if len(runs) > 1:
            fish, draws = bootstrap.independent(values.shape[1]), bootstrap.draws_of_mean(values)
            estimate = estimate.over_runs(values.mean(axis=1), fish, draws)
        figures[name] = bootstrap.interval(estimate)
    return figures


def _episode_values(record: FleetRecord, lost_error: float) -> dict[str, Floats]:
    """What is averaged over episodes, each (E,)."""
    error = record.tag_error.mean(axis=1)  # (E, T)
    lost = (record.tag_error > lost_error).mean(axis=1)
    hours = record.tag_error.shape[1] * record.time_step / 3600.0
    values = {
        "worst_tag_error_m": error.max(axis=1),
        "tag_lost_fraction": lost.mean(axis=1),
        "encroachments_per_hour": record.encroachments.sum(axis=1) / hours,
        "messages_per_hour": record.messages.sum(axis=1) / hours,
    }
    for tag in range(error.shape[1]):
        values[f"tag_{tag}_error_m"] = error[:, tag]
        values[f"tag_{tag}_lost_fraction"] = lost[:, tag]
    return values
