"""The pictures of a benchmark: distributions of errors, learning curves, the paths in two episodes."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.eval.comparison import Comparison, typical_episodes
from tagtrack.eval.contestants import each_run
from tagtrack.eval.metrics import error_quantiles
from tagtrack.eval.plots import SHARES, EpisodePaths, plot_errors, plot_learning_curve, plot_track, save_figure
from tagtrack.eval.rollout import Contestant, SeedBlock, block_seed, trace
from tagtrack.eval.statistics.bootstrap import Bootstrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESAMPLES_OF_BANDS = 200


def draw_errors(comparison: Comparison) -> Figure:
    """The distributions of the errors, with bands within which they would lie for other fish and training runs."""
    errors = {name: record.error for name, record in comparison.records.items()}
    bootstrap = Bootstrap(resamples=RESAMPLES_OF_BANDS, clusters=comparison.clusters)
    bands = {name: np.array([(e.low, e.high) for e in error_quantiles(comparison.each_run(name), SHARES, bootstrap)]).T
             for name in errors}
    return plot_errors(errors, bands=bands, lost_error=comparison.task.scenario.lost_error)


def draw_learning(comparison: Comparison, specs: Mapping[str, str | dict[str, str]]) -> Figure | None:
    """The learning curves of trainings of several runs, whose folders tell them alike; None where there are none.

    A line stands at the mean error of the first policy, which learns nothing.
    """
    curves = {}
    for name in comparison.runs:
        group = specs[name]
        runs = [read_curve(Path(folder)) for folder in group.values()] if isinstance(group, dict) else []
        if runs and all(run is not None and np.array_equal(run[0], runs[0][0]) for run in runs):  # type: ignore[index]
            curves[name] = (runs[0][0], np.array([run[1] for run in runs]))  # type: ignore[index]
    first = next(iter(comparison.records))
    level = {first: comparison.summaries[first]["mean_error_m"].value} if first not in curves else {}
    return plot_learning_curve(curves, level) if curves else None


def read_curve(run: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """Steps and validation errors [m] of a training run; None where its folder does not tell them."""
    try:
        with (run / "progress.csv").open(encoding="utf-8", newline="") as file:
            rows = [(float(row["steps"]), float(row["validation_error_m"])) for row in csv.DictReader(file)]
    except (OSError, KeyError, ValueError, TypeError, csv.Error):  # a file that was edited, or is being written
        return None
    steps, errors = np.array(rows).reshape(-1, 2).T
    return steps, errors


def draw_tracks(folder: Path, comparison: Comparison, makers: Mapping[str, Contestant | dict[str, Contestant]]) -> None:
    """Draw the typical episodes of a comparison, all policies side by side, as ``track_NAME.png``."""
    first = block_seed(SeedBlock.BENCHMARK, comparison.seed)
    for name, episode in typical_episodes(comparison).items():
        tracks = {}
        for policy, maker in each_run(makers, all_runs=False).items():
            traced = trace(comparison.task, maker, episodes=1, seed=first + episode)
            tracks[policy] = EpisodePaths(fish=traced.fish[0], vehicle=traced.vehicle[0], belief=traced.estimate[0])
        title = f"{comparison.env}, {name} episode (seed {comparison.seed + episode})"
        save_figure(folder / f"track_{name}.png", plot_track(tracks, title=title))
