"""`tagtrack eval tradeoff`: knowing where the fish is against keeping away from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from tagtrack.baselines.registry import baseline_parameters
from tagtrack.eval.cells.options import EngineOptions
from tagtrack.eval.comparison import Comparison, compare
from tagtrack.eval.contestants import name_contestants
from tagtrack.eval.options import EpisodeOptions, ManyParticles
from tagtrack.eval.plots import TradeoffCurve, plot_tradeoff, save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, as_markdown, interval_cell, show, write_json, write_text
from tagtrack.eval.results_folder import default_folder, replace_results, require_replaceable
from tagtrack.eval.static_array import is_static_array
from tagtrack.eval.versions import collect_versions

OWN_FILES = ("tradeoff.json", "tradeoff.md", "tradeoff.png")
LEARNED = "learned"

Curves = dict[str, dict[str, str]]  # curve -> label of a point -> its policy


@dataclass(frozen=True, kw_only=True)
class Tradeoff:
    """Draw the error against the share of time inside the perimeter: heuristics at several settings, and learned policies.

    Which perimeter is judged by is the scenario's (--set reward.perimeter=20); the heuristics get perimeters of their own.
    """

    task: ManyParticles = field(default_factory=lambda: ManyParticles(env="TagTrack/LeopardSharkStandoff-v0"))
    heuristics: Annotated[tuple[str, ...], tyro.conf.arg(metavar="BASELINE ...")] = ("three_step", "circle")
    """Baselines; each takes the perimeters or, where it has none, the radii."""
    perimeters: Annotated[tuple[float, ...], tyro.conf.arg(metavar="X ...")] = (10, 15, 20, 30, 40)
    """Perimeters they keep [m]."""
    radii: Annotated[tuple[float, ...], tyro.conf.arg(metavar="X ...")] = (15, 20, 25, 30, 35, 40, 50)
    """Radii they circle at [m]."""
    runs: Annotated[tuple[str, ...], tyro.conf.arg(metavar="RUN ...", help_behavior_hint="(none)")] = ()
    """Folders of training runs, for instance at several weights of the stand-off term."""
    trial: EpisodeOptions = field(default_factory=lambda: EpisodeOptions(episodes=256))
    engine: EngineOptions = field(default_factory=EngineOptions)
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(runs/tradeoff-ID-TIME)")] = None
    """Folder to write; an earlier one of this command is replaced."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        self.engine.check()
        task, env_id, trial = self.task.build(), self.task.env_id, self.trial
        if task.scenario.reward.perimeter <= 0:
            raise ValueError(f"{env_id} has no perimeter to keep; give one: --set reward.perimeter=20")
        curves = self.curves()
        specs = [policy for curve in curves.values() for policy in curve.values()]
        out = self.out or default_folder("tradeoff", env_id)
        require_replaceable(out, OWN_FILES, "trade-off")
        with self.engine.open() as engine:
            with progress_bar(len(specs) * trial.episodes * task.scenario.episode_steps) as advance:
                comparison = compare(
                    task,
                    specs,
                    episodes=trial.episodes,
                    seed=trial.seed,
                    threads=trial.threads,
                    env_id=env_id,
                    engine=engine,
                    on_step=advance,
                )
            document = tradeoff_document(comparison, curves, {**self.task.describe(task), "versions": collect_versions()})
            table = tradeoff_rows(document)
            show(as_console_table(*table))
            with replace_results(out, OWN_FILES) as folder:
                write_json(folder / "tradeoff.json", document)
                write_text(folder / "tradeoff.md", as_markdown(*table))
                figure = plot_tradeoff(draw_curves(comparison, curves), perimeter=task.scenario.reward.perimeter)
                save_figure(folder / "tradeoff.png", figure)
        print(f"written: {out}")

    def curves(self) -> Curves:
        """The policies of each curve by the label of their points. Raises ValueError for a heuristic with nothing to vary."""
        curves: Curves = {}
        for heuristic in self.heuristics:
            known = baseline_parameters(heuristic.partition(":")[0])
            parameter = "perimeter" if "perimeter" in known else "radius"
            if parameter not in known:
                raise ValueError(f"{heuristic} has neither a perimeter nor a radius to vary; leave it out of --heuristics")
            values = self.perimeters if parameter == "perimeter" else self.radii
            joint = "," if ":" in heuristic else ":"
            title = f"{heuristic}, {'perimeters' if parameter == 'perimeter' else 'radii'}"
            curves[title] = {f"{value:g} m": f"{heuristic}{joint}{parameter}={value:.10g}" for value in values}
        if arrays := [run for run in self.runs if is_static_array(run)]:
            raise ValueError(f"{arrays[0]} has no vehicle that could keep away; leave it out of --runs")
        if self.runs:
            curves[LEARNED] = name_contestants(self.runs)
        if not any(curves.values()):
            raise ValueError("name at least one policy: --heuristics with --perimeters or --radii, or --runs")
        return curves


def tradeoff_document(comparison: Comparison, curves: Curves, asked: Mapping[str, Any]) -> dict[str, Any]:
    """What tradeoff.json holds: for each curve its points, with the figures of each."""
    by_policy = dict(zip([p for curve in curves.values() for p in curve.values()], comparison.summaries.values(), strict=True))
    return {
        **asked,
        "perimeter": comparison.task.scenario.reward.perimeter,
        "episodes": comparison.episodes,
        "seed": comparison.seed,
        "curves": {
            title: [
                {
                    "label": label,
                    "policy": policy,
                    **{name: figure.to_json() for name, figure in by_policy[policy].items()},
                }
                for label, policy in curve.items()
            ]
            for title, curve in curves.items()
        },
    }


def tradeoff_rows(document: Mapping[str, Any]) -> tuple[list[str], list[list[str]], str]:
    """Header, rows and note of the table."""
    header = ["policy", "inside perimeter [%]", "mean error [m]", "mean range [m]"]
    rows = [
        [
            point["policy"] if title != LEARNED else point["label"],
            interval_cell(point["inside_perimeter"], 100),
            interval_cell(point["mean_error_m"]),
            interval_cell(point["mean_range_m"]),
        ]
        for title, points in document["curves"].items()
        for point in points
    ]
    note = (
        f"{document['episodes']} paired episodes of {document['env']}, seed {document['seed']}, {document['particles']} "
        f"particles; perimeter {document['perimeter']:g} m; in brackets 95 % bootstrap intervals over episodes."
    )
    return header, rows, note


def draw_curves(comparison: Comparison, curves: Curves) -> dict[str, TradeoffCurve]:
    """The curves as `plot_tradeoff` takes them."""
    summaries = iter(comparison.summaries.values())
    drawn = {}
    for title, curve in curves.items():
        points = [next(summaries) for _ in curve]
        drawn[title] = TradeoffCurve(
            inside=[point["inside_perimeter"] for point in points],
            error=[point["mean_error_m"] for point in points],
            labels=list(curve),
            learned=title == LEARNED,
        )
    return drawn
