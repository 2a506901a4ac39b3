"""`tagtrack eval consistency`: is the belief as sure as it may be? Beside the proportions of Clark et al. 2013, Table II."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from tagtrack.eval.consistency import PROBABILITIES, TABLE_II, summarize_consistency
from tagtrack.eval.contestants import find_makers, name_contestants
from tagtrack.eval.options import EpisodeOptions, TaskOptions
from tagtrack.eval.plots import plot_calibration, save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, interval_cell, show, write_json
from tagtrack.eval.results_folder import replace_results, require_replaceable
from tagtrack.eval.rollout import Localizer, SeedBlock, block_seed, trace
from tagtrack.eval.statistics.estimate import Interval
from tagtrack.eval.versions import collect_versions

OWN_FILES = ("consistency.json", "calibration.png")

# Title, and what an honest Gaussian belief would have (2 dof: chi-square; along one axis 68 %).
TITLES: Mapping[str, tuple[str, str]] = {
    "normalized_error_squared": ("normalized error squared, mean", "2"),
    "median_normalized_error_squared": ("the same, median", "1.39"),
    **{f"inside_{100 * p:.0f}": (f"truth inside the {100 * p:.0f} % ellipse [%]", f"{100 * p:.0f}") for p in PROBABILITIES},
    "ex_below_mean_sigma_x": ("e_x < mean sigma_x [%]", ""),
    "ey_below_mean_sigma_y": ("e_y < mean sigma_y [%]", ""),
    "ex_below_sigma_x": ("e_x < sigma_x [%]", "68.3"),
    "ey_below_sigma_y": ("e_y < sigma_y [%]", "68.3"),
    "e_below_sigma": ("e < sigma [%]", ""),
}


@dataclass(frozen=True, kw_only=True)
class Consistency:
    """Compare the spread of the belief with its errors.

    Normalized error squared, share of time the truth lies inside the 50, 90 and 99 % ellipses, proportions of Table II.
    The error is that of the mean of the particles, whatever the filter reports. Other beliefs: --set belief=levy.
    """

    task: TaskOptions = field(default_factory=TaskOptions)
    policy: Annotated[str, tyro.conf.arg(metavar="POLICY")] = "pursuit"
    """Baseline or folder of a training run that steers meanwhile."""
    trial: EpisodeOptions = field(default_factory=lambda: EpisodeOptions(episodes=256))
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(none)")] = None
    """Folder to write consistency.json and calibration.png to."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        task, trial = self.task.build(), self.trial
        if task.scenario.vehicles > 1 or task.scenario.targets > 1:
            raise ValueError(
                f"consistency checks the belief of one vehicle about one tag, got vehicles={task.scenario.vehicles}, "
                f"tags={task.scenario.targets}; leave both out"
            )
        ((name, maker),) = find_makers(name_contestants([self.policy]), task, self.task.env_id).items()
        if isinstance(maker, Localizer):
            raise ValueError(f"{name} steers no vehicle, whose belief could be checked; name a policy")
        if self.out is not None:
            require_replaceable(self.out, OWN_FILES, "consistency check")
        with progress_bar(trial.episodes * task.scenario.episode_steps) as advance:
            traced = trace(
                task,
                maker,
                episodes=trial.episodes,
                seed=block_seed(SeedBlock.BENCHMARK, trial.seed),
                threads=trial.threads,
                on_step=lambda steps: advance(name, steps),
            )
        figures = summarize_consistency(traced.mean - traced.fish, traced.covariance)
        document = {
            **self.task.describe(task),
            "policy": name,
            "episodes": trial.episodes,
            "seed": trial.seed,
            "versions": collect_versions(),
            "figures": {key: figure.to_json() for key, figure in figures.items()},
            "table_ii": dict(TABLE_II),
        }
        print_consistency(document)
        if self.out is not None:
            with replace_results(self.out, OWN_FILES) as folder:
                write_json(folder / "consistency.json", document)
                shares = {f"{name}, {self.task.env_id}": ellipse_shares(figures)}
                save_figure(folder / "calibration.png", plot_calibration(shares))
            print(f"written: {self.out}")


def ellipse_shares(figures: Mapping[str, Interval]) -> dict[float, Interval]:
    """Share inside by nominal probability."""
    return {probability: figures[f"inside_{100 * probability:.0f}"] for probability in PROBABILITIES}


def print_consistency(document: Mapping[str, Any]) -> None:
    """The figures beside those of an honest belief and of the paper."""
    rows = []
    for name, (title, honest) in TITLES.items():
        scale = 100 if title.endswith("[%]") else 1
        paper = f"{100 * TABLE_II[name]:.0f}" if name in TABLE_II else ""
        rows.append([title, interval_cell(document["figures"][name], scale), honest, paper])
    note = (
        f"{document['episodes']} episodes of {document['env']} under {document['policy']}, seed {document['seed']}, "
        f"{document['particles']} particles; in brackets 95 % bootstrap intervals. The paper's column is Clark et al. 2013, "
        "Table II; a normalized error squared above 2 means that the belief is too sure of itself."
    )
    show(as_console_table(["figure", "here", "honest", "paper"], rows, note))
