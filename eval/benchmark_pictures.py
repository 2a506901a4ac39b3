"""The pictures of a benchmark: distributions of errors, learning curves, the paths in two episodes."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.eval.comparison import Comparison, typical_episodes
from tagtrack.eval.contestants import each_run
from tagtrack.eval.html_report import Illustration
from tagtrack.eval.metrics import error_quantiles
from tagtrack.eval.plots import SHARES, EpisodePaths, plot_errors, plot_learning_curve, plot_track, save_figure
from tagtrack.eval.rollout import Contestant, Localizer, SeedBlock, block_seed, trace
from tagtrack.eval.statistics.bootstrap import Bootstrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESAMPLES_OF_BANDS = 200
FRAMES, FRAME_SIDE = 30, 260  # of the report's film
SHOWN = {  # file -> title and words in the report
    "errors.png": ("Profile of errors", "For each policy the share of all steps whose localization error is below a value."),
    "learning_curves.png": ("Learning", "Validation error while learning, a band for other runs, a line for the first policy."),
    "track_median.png": ("The median episode", "Paths of fish, vehicle and estimate under each policy in the median episode."),
    "track_hard.png": ("A hard episode", "The same in an episode that is harder than 95 of 100."),
}


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


def film_of(comparison: Comparison, makers: Mapping[str, Contestant | dict[str, Contestant]]) -> Illustration | None:
    """The median episode under the first policy and the best other one, moving; None without pygame-ce or a vehicle to see."""
    one_of_each = zip(makers, each_run(makers, all_runs=False).values(), strict=True)
    steering = {name: maker for name, maker in one_of_each if not isinstance(maker, Localizer)}
    if not steering:
        return None
    first, *others = steering
    chosen = [first, *sorted(others, key=lambda name: comparison.records[name].error.mean())[:1]]
    seed = comparison.seed + typical_episodes(comparison)["median"]
    try:
        from tagtrack.eval.film import film, save_film

        frames = film(
            comparison.task,
            {name: steering[name] for name in chosen},
            seed=block_seed(SeedBlock.BENCHMARK, seed),
            frames=FRAMES,
            side=FRAME_SIDE,
        )
    except ImportError:
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.gif"
        save_film(path, frames)
        data = path.read_bytes()
    words = f"One episode, seed {seed}, of {' and '.join(chosen)}: yellow is the vehicle, red the fish, blue the belief."
    return Illustration(title="An episode", data=data, kind="gif", words=words)


def illustrations(folder: Path, film: Illustration | None) -> list[Illustration]:
    """What a report shows of a benchmark's folder, in order."""
    found = [
        Illustration(title=title, data=(folder / name).read_bytes(), kind="png", words=words)
        for name, (title, words) in SHOWN.items()
        if (folder / name).is_file()
    ]
    return [*found[:1], *([film] if film else []), *found[1:]]
