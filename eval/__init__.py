"""Paired roll-outs, metrics and tables: which policy localizes the fish best.

``compare`` sets policies side by side on the same episodes; ``tagtrack eval --help`` shows the commands. The names below
load their modules when they are first asked for, so importing this package costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tagtrack.envs.lazy import lazily

if TYPE_CHECKING:
    from tagtrack.eval.cells.engine import Engine
    from tagtrack.eval.comparison import Comparison, compare
    from tagtrack.eval.episode_record import EpisodeRecord
    from tagtrack.eval.metrics import paired_ratio, summarize
    from tagtrack.eval.rollout import SeedBlock, Trace, block_seed, roll_out, trace
    from tagtrack.eval.statistics.bootstrap import Bootstrap
    from tagtrack.eval.statistics.estimate import Interval
    from tagtrack.eval.versions import collect_versions

_HOMES = {
    "cells.engine": ("Engine",),
    "comparison": ("Comparison", "compare"),
    "episode_record": ("EpisodeRecord",),
    "metrics": ("paired_ratio", "summarize"),
    "statistics.bootstrap": ("Bootstrap",),
    "statistics.estimate": ("Interval",),
    "rollout": ("SeedBlock", "Trace", "block_seed", "roll_out", "trace"),
    "versions": ("collect_versions",),
}

__all__ = [
    "Bootstrap",
    "Comparison",
    "Engine",
    "EpisodeRecord",
    "Interval",
    "SeedBlock",
    "Trace",
    "block_seed",
    "collect_versions",
    "compare",
    "paired_ratio",
    "roll_out",
    "summarize",
    "trace",
]

__getattr__, __dir__ = lazily(__name__, _HOMES)
