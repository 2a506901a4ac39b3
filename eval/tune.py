"""`python -m eval tune`: the number of a baseline that tracks best, found on episodes that no benchmark uses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import rich
import tyro

from tagtrack.baselines.registry import BASELINES, LEADING_PARAMETERS
from tagtrack.eval.comparison import Comparison, compare, describe_fleet
from tagtrack.eval.metrics import Bootstrap, Interval, paired_ratio
from tagtrack.eval.options import EpisodeOptions, TaskOptions
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, fleet_columns, fleet_note, interval_cell, value_cell, write_json
from tagtrack.eval.rollout import SeedBlock
from tagtrack.eval.versions import collect_versions

# What is tried without --values, by parameter: metres, degrees, pings, seconds.
USUAL_VALUES: Mapping[str, tuple[float, ...]] = {
    "radius": (5, 7, 10, 14, 20, 28, 40, 56, 80),
    "tau": (5, 10, 15, 20, 25, 30, 35, 40, 45),  # beyond, the steps are never steered: pursuit
    "perimeter": (0, 5, 10, 15, 20, 30, 40),
    "horizon": (1, 2, 3, 5, 8, 13),
    "centroid": (0, 1),
    "radius_step": (0, 2, 5, 10, 20),
    "spacing": (0, 0.15, 0.3, 0.45, 0.6),
    "hold": (6, 12, 20, 30, 60, 120),
    "watch": (6, 12, 20, 30, 60, 120),
    "per_metre": (0, 0.05, 0.1, 0.2, 0.4, 0.7),
}


@dataclass(frozen=True, kw_only=True)
class Tune:
    """Find the number of a baseline that tracks best: the circle's radius, the three steps' tau ...

    The episodes are none of those that `benchmark` and `train` use. The best value's own figure flatters it a little, as any
    choice of the best does: report what `benchmark` gives for it.
    """

    task: TaskOptions = field(default_factory=TaskOptions)
    policy: Annotated[str, tyro.conf.arg(metavar="BASELINE")] = "circle"
    """The baseline, with other parameters fixed if you like: circle, three_step, three_step:perimeter=20."""
    parameter: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(the one behind the colon)")] = None
    """Its parameter: radius (circle), tau in degrees (three_step), horizon in pings (information) ..."""
    values: Annotated[tuple[float, ...], tyro.conf.arg(metavar="X ...", help_behavior_hint="(a usual range)")] = ()
    """Values to try."""
    trial: EpisodeOptions = field(default_factory=lambda: EpisodeOptions(episodes=256))
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(none)")] = None
    """JSON file to write."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        task, env_id = self.task.build(), self.task.env_id
        specs = self.specifications()
        require_writable_file(self.out)
        with progress_bar(len(specs) * self.trial.episodes * task.scenario.episode_steps) as advance:
            comparison = compare(
                task,
                list(specs),
                block=SeedBlock.TUNING,
                episodes=self.trial.episodes,
                seed=self.trial.seed,
                threads=self.trial.threads,
                env_id=env_id,
                on_step=advance,
            )
        document = tuning_document(comparison, specs, collect_versions())
        print_tuning(document)
        if self.out is not None:
            write_json(self.out, document)
            print(f"written: {self.out}")

    def specifications(self) -> dict[str, float]:
        """The value tried by each baseline's specification. Raises ValueError where there is nothing to try."""
        name, colon, _ = self.policy.partition(":")
        if name not in BASELINES:
            raise ValueError(f"unknown baseline {name!r}; known: {', '.join(BASELINES)}")
        parameter = self.parameter or LEADING_PARAMETERS.get(name)
        if parameter is None:
            raise ValueError(f"{name} has no number to tune; those that have: {', '.join(LEADING_PARAMETERS)}")
        values = self.values or USUAL_VALUES.get(parameter, ())
        if not values:
            raise ValueError(f"there is no usual range for {parameter} of {name}; give --values")
        if colon:
            return {f"{self.policy},{parameter}={value:.10g}": value for value in values}
        key = "" if parameter == LEADING_PARAMETERS.get(name) else f"{parameter}="
        return {f"{name}:{key}{value:.10g}": value for value in values}


def tuning_document(comparison: Comparison, specs: Mapping[str, float], versions: Mapping[str, str]) -> dict[str, Any]:
    """What the JSON file holds: figures by specification, and the best.

    ``best_over_this`` is the best mean error over that of the value, paired by episode: with an interval that ends below 1 the
    value is worse for certain, otherwise it may be as good.
    """
    best = best_policy(comparison)
    rows = []
    for spec, value in specs.items():
        figures = {name: figure.to_json() for name, figure in comparison.summaries[spec].items()}
        ratio = Interval(value=1.0, low=1.0, high=1.0)
        if spec != best:
            ratio = paired_ratio(comparison.records[best], comparison.records[spec])
        reward = comparison.records[spec].reward
        if reward is not None:
            figures["mean_reward"] = Bootstrap().mean(reward.mean(axis=1)).to_json()
        rows.append({"policy": spec, "value": value, **figures, "best_over_this": ratio.to_json()})
    fleet = describe_fleet(comparison.task.scenario)
    return {
        "env": comparison.env,
        "episodes": comparison.episodes,
        "seed": comparison.seed,
        "particles": comparison.task.scenario.belief.particles,
        **({} if fleet is None else {"fleet": fleet}),
        "versions": dict(versions),
        "best": best,
        "values": rows,
    }


def best_policy(comparison: Comparison) -> str:
    """The policy with the lowest mean error, the first of equals."""
    errors = {name: float(np.mean(error)) for name, error in comparison.mean_errors().items()}
    return min(errors, key=errors.__getitem__)


def print_tuning(document: Mapping[str, Any]) -> None:
    """A table of all values, and the best in a sentence."""
    fleet = document.get("fleet")
    columns: list[tuple[str, str, float]] = [("median [m]", "median_error_m", 1), ("lost [%]", "lost_fraction", 100)]
    columns.append(("range [m]", "mean_range_m", 1))
    if fleet:
        columns = [column for column in columns if column[1] != "lost_fraction"] + fleet_columns(fleet)
    if document["values"][0]["inside_perimeter"]["value"] is not None:
        columns.append(("inside perimeter [%]", "inside_perimeter", 100))
    columns.append(("reward", "mean_reward", 1))
    header = ["policy", "mean error [m]", *(title for title, _, _ in columns), "best / policy"]
    rows = [
        [row["policy"], interval_cell(row["mean_error_m"])]
        + [value_cell(row[figure], scale) for _, figure, scale in columns]
        + ["1" if row["policy"] == document["best"] else interval_cell(row["best_over_this"])]
        for row in document["values"]
    ]
    note = (
        f"{document['episodes']} paired episodes of {document['env']} for tuning, seed {document['seed']}, "
        f"{document['particles']} particles; in brackets 95 % bootstrap intervals. The ratio is the best mean error over the "
        f"row's: where its interval reaches 1 the row may be as good.{fleet_note(fleet) if fleet else ''}"
    )
    rich.print(as_console_table(header, rows, note))
    best = next(row for row in document["values"] if row["policy"] == document["best"])
    print(f"best: {document['best']}, mean error {interval_cell(best['mean_error_m'])} m")


def require_writable_file(path: Path | None) -> None:
    """Refuse, before any work is done, a file that cannot be written.

    Raises:
        ValueError: if it is a folder. FileNotFoundError: if its folder is missing.
    """
    if path is None:
        return
    if path.is_dir():
        raise ValueError(f"{path} is a folder; name a file in it")
    if not path.absolute().parent.is_dir():
        raise FileNotFoundError(f"cannot write {path}: make the folder {path.absolute().parent} first")
