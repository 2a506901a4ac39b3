"""The figures of fleets: each tag's error, how often vehicles came too near one another, what they sent."""

from __future__ import annotations

import numpy as np

from tagtrack.eval.episode_record import FleetRecord
from tagtrack.eval.metrics import Bootstrap, Interval


def summarize_fleet(record: FleetRecord, *, lost_error: float, bootstrap: Bootstrap | None = None) -> dict[str, Interval]:
    """The figures of one policy beside those of ``metrics.summarize``.

    Args:
        lost_error: a tag is lost in a step where its own error exceeds this [m].
    Returns:
        ``worst_tag_error_m``, the mean error of the tag that was known worst in each episode; ``tag_lost_fraction``, the share of
        time lost, mean over tags; ``encroachments_per_hour`` and ``messages_per_hour`` of all vehicles; for each tag
        ``tag_0_error_m`` ... and ``tag_0_lost_fraction`` ...
    """
    bootstrap = bootstrap or Bootstrap()
    error = record.tag_error.mean(axis=1)  # (E, T)
    lost = (record.tag_error > lost_error).mean(axis=1)
    hours = record.tag_error.shape[1] * record.time_step / 3600.0
    figures = {
        "worst_tag_error_m": error.max(axis=1),
        "tag_lost_fraction": lost.mean(axis=1),
        "encroachments_per_hour": record.encroachments.sum(axis=1) / hours,
        "messages_per_hour": record.messages.sum(axis=1) / hours,
    }
    for tag in range(error.shape[1]):
        figures[f"tag_{tag}_error_m"] = error[:, tag]
        figures[f"tag_{tag}_lost_fraction"] = lost[:, tag]
    return {name: bootstrap.mean(np.ascontiguousarray(values)) for name, values in figures.items()}
