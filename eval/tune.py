"""`tagtrack eval tune`: the number of a baseline that tracks best, found on episodes that no benchmark uses."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from tagtrack.baselines.registry import BASELINES, LEADING_PARAMETERS, usual_parameters
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.task import Task
from tagtrack.envs.validation import unknown
from tagtrack.eval.cells.engine import Engine
from tagtrack.eval.cells.options import EngineOptions
from tagtrack.eval.comparison import Comparison, compare, describe_fleet
from tagtrack.eval.metrics import paired_ratio
from tagtrack.eval.options import EpisodeOptions, TaskOptions
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, fleet_columns, fleet_note, interval_cell, show, value_cell, write_json
from tagtrack.eval.results_folder import require_writable_file
from tagtrack.eval.rollout import SeedBlock
from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.estimate import Interval
from tagtrack.eval.versions import collect_versions

LONGER = 2  # times that a grid goes on beyond an end at which the best lies
EACH_WAY = 3  # values that a refinement tries on either side of the best

Found = tuple[Comparison, float, list[float]]  # all that was compared, the best value, all values tried


@dataclass(frozen=True, kw_only=True)
class Grid:
    """What is tried without --values."""

    values: tuple[float, ...]
    whole: bool = False  # numbers, from 1 on
    geometric: bool = False  # may go on at either end, each value so many times the one before


def usual_grid(parameter: str, scenario: Scenario) -> Grid | None:
    """A usual range of a baseline's parameter, in the task's own lengths and times; None where there is none."""
    length, interval = scenario.scale.length, max(scenario.tag.longest_interval, scenario.time_step)
    grids = {
        "radius": Grid(values=_times(usual_radius(scenario), (0.35, 0.5, 0.7, 1, 1.4, 2, 2.8)), geometric=True),
        "tau": Grid(values=(5, 10, 15, 20, 25, 30, 35, 40, 45)),  # beyond, the steps are never steered: pursuit
        "perimeter": Grid(values=_times(length, (0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8))),
        "horizon": Grid(values=(1, 2, 3, 5, 8, 13, 21, 34), whole=True, geometric=True),
        "centroid": Grid(values=(0, 1)),
        "radius_step": Grid(values=_times(length, (0, 0.04, 0.1, 0.2, 0.4))),
        "spacing": Grid(values=(0, 0.15, 0.3, 0.45, 0.6)),
        "hold": Grid(values=_times(interval, (3, 6, 10, 15, 30, 60)), geometric=True),
        "watch": Grid(values=_times(interval, (3, 6, 10, 15, 30, 60)), geometric=True),
        "per_metre": Grid(values=_times(1 / length, (0, 2.5, 5, 10, 20, 35))),
    }
    return grids.get(parameter)


def _times(unit: float, multiples: Sequence[float]) -> tuple[float, ...]:
    return tuple(float(f"{unit * multiple:.3g}") for multiple in multiples)


def usual_radius(scenario: Scenario) -> float:
    """About where a good circle is [m]: the usual one of ranging and presence, a fifth of the task's length of others."""
    return float(usual_parameters(scenario).get("radius", 0.2 * scenario.scale.length))


def longer(grid: Grid, tried: Sequence[float], best: float) -> list[float]:
    """Two more values beyond the end of those tried, if the best lies there and the grid may go on."""
    values = sorted(tried)
    if not grid.geometric or len(values) < 2 or best not in (values[0], values[-1]):
        return []
    factor = values[1] / values[0] if best == values[0] else values[-1] / values[-2]
    beyond = [best * factor**k if best == values[-1] else best / factor**k for k in (1, 2)]
    if grid.whole:
        return _not_yet([float(round(value)) for value in beyond if value >= 1], tried)
    return _not_yet([float(f"{value:.3g}") for value in beyond], tried)


def finer(grid: Grid, tried: Sequence[float], best: float) -> list[float]:
    """Values between the best and its neighbours: the middles, or whole numbers."""
    values = sorted(tried)
    place = values.index(best)
    found: list[float] = []
    for other in values[max(place - 1, 0) : place] + values[place + 1 : place + 2]:
        if grid.whole:
            between = np.arange(min(best, other) + 1, max(best, other))
            near = between[np.argsort(np.abs(between - best), kind="stable")][:EACH_WAY]
            found += sorted(float(value) for value in near)
        else:
            middle = math.sqrt(best * other) if grid.geometric else (best + other) / 2
            found.append(float(f"{middle:.3g}"))
    return _not_yet(found, tried)


def _not_yet(values: Sequence[float], tried: Sequence[float]) -> list[float]:
    return [value for value in dict.fromkeys(values) if value not in tried and value >= 0]


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
    """Values to try; without them a usual range for the task, which goes on where the best lies at its end, and gets finer."""
    trial: EpisodeOptions = field(default_factory=lambda: EpisodeOptions(episodes=256))
    engine: EngineOptions = field(default_factory=EngineOptions)
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(none)")] = None
    """JSON file to write."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        self.engine.check()
        task = self.task.build()
        grid = self.grid(task.scenario)
        require_writable_file(self.out)
        with self.engine.open() as engine:
            comparison, best, tried = self.search(task, grid, engine)
            document = tuning_document(comparison, {self.spec(value): value for value in sorted(tried)}, collect_versions())
            print_tuning(document)
            for line in edge_notes(best, tried, grid):
                print(line)
            if self.out is not None:
                write_json(self.out, document)
                print(f"written: {self.out}")

    def search(self, task: Task, grid: Grid, engine: Engine) -> Found:
        """The grid, on beyond its end where the best lies there, and finer about the best."""
        tried = list(grid.values)
        comparison = self.compare(task, tried, "grid", engine)
        found = comparison, self.value_of(best_policy(comparison)), tried
        if self.values:
            return found
        for _ in range(LONGER):
            if not (more := longer(grid, found[2], found[1])):
                break
            found = self.go_on(task, found, more, "beyond", engine)
        if grid.whole or grid.geometric or len(found[2]) > 2:
            if more := finer(grid, found[2], found[1]):
                found = self.go_on(task, found, more, "finer", engine)
        return found

    def compare(self, task: Task, values: Sequence[float], stage: str, engine: Engine) -> Comparison:
        """The baseline with each of some values, on the episodes for tuning."""
        trial = self.trial
        with progress_bar(len(values) * trial.episodes * task.scenario.episode_steps) as advance:
            return compare(
                task,
                [self.spec(value) for value in values],
                block=SeedBlock.TUNING,
                episodes=trial.episodes,
                seed=trial.seed,
                threads=trial.threads,
                env_id=self.task.env_id,
                engine=engine,
                on_step=lambda name, steps: advance(f"{stage}: {name}", steps),
            )

    def go_on(self, task: Task, before: Found, more: Sequence[float], stage: str, engine: Engine) -> Found:
        """With more values."""
        comparison, _, tried = before
        new = self.compare(task, more, stage, engine)
        both = replace(
            comparison, records={**comparison.records, **new.records}, summaries={**comparison.summaries, **new.summaries}
        )
        return both, self.value_of(best_policy(both)), [*tried, *more]

    @property
    def name(self) -> str:
        """Of the parameter. Raises ValueError for an unknown baseline or one without a number to tune."""
        name = self.policy.partition(":")[0]
        if name not in BASELINES:
            raise unknown("baseline", name, BASELINES)
        parameter = self.parameter or LEADING_PARAMETERS.get(name)
        if parameter is None:
            raise ValueError(f"{name} has no number to tune; those that have: {', '.join(LEADING_PARAMETERS)}")
        return parameter

    def grid(self, scenario: Scenario) -> Grid:
        """What is tried. Raises ValueError where there is nothing to try."""
        usual = usual_grid(self.name, scenario)
        if self.values:
            return Grid(values=tuple(dict.fromkeys(float(value) for value in self.values)))
        if usual is None:
            raise ValueError(f"there is no usual range for {self.name} of {self.policy}; give --values")
        return usual

    def spec(self, value: float) -> str:
        """The baseline with a value of its parameter."""
        name, colon, _ = self.policy.partition(":")
        if colon:
            return f"{self.policy},{self.name}={value:.10g}"
        key = "" if self.name == LEADING_PARAMETERS.get(name) else f"{self.name}="
        return f"{name}:{key}{value:.10g}"

    def value_of(self, spec: str) -> float:
        """The value of a baseline that ``spec`` made."""
        return float(re.split("[:=]", spec)[-1])


def edge_notes(best: float, tried: Sequence[float], grid: Grid) -> list[str]:
    """A warning where the best is the least or the largest value tried, and another might be better still."""
    ends = {min(tried): "least", max(tried): "largest"}
    if len(tried) < 2 or best not in ends or (ends[best] == "least" and best == 0) or set(tried) <= {0.0, 1.0}:
        return []
    if grid.whole and best == 1:
        return []
    return [f"warning: the best is the {ends[best]} value tried, {best:.10g}; try --values beyond it"]


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
    show(as_console_table(header, rows, note))
    best = next(row for row in document["values"] if row["policy"] == document["best"])
    print(f"best: {document['best']}, mean error {interval_cell(best['mean_error_m'])} m")
