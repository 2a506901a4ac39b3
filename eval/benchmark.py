"""`python -m eval benchmark`: policies on the same episodes, as a table, a JSON file and pictures."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import rich
import tyro

from tagtrack.envs.model import import_object
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.comparison import Comparison, compare, typical_episodes
from tagtrack.eval.contestants import make_groups, name_groups
from tagtrack.eval.metrics import error_quantiles
from tagtrack.eval.options import EpisodeOptions, ManyParticles
from tagtrack.eval.plots import SHARES, EpisodePaths, plot_errors, plot_learning_curve, plot_track, save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import console_table, write_benchmark, write_json
from tagtrack.eval.results_folder import default_folder, replace_results, require_replaceable
from tagtrack.eval.rivals import rivals_of
from tagtrack.eval.rollout import Contestant, Localizer, PolicyMaker, SeedBlock, block_seed, trace
from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.versions import collect_versions
from tagtrack.eval.whole_number import WholeNumber
from tagtrack.live.recording import MISSION_FILE, Recorder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OWN_FILES = ("benchmark.json", "config.json", "table.md", "errors.png", "learning_curves.png", "track_*.png")
RESAMPLES_OF_BANDS = 200


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """Compare policies on the same fish.

    Writes benchmark.json, table.md, errors.png (distribution of the error), track_median.png and track_hard.png (the paths in
    two episodes) and config.json (what was asked for), and prints the table. Ratios are to the first policy named; a step is
    lost where the error exceeds the scenario's lost_error.
    """

    task: ManyParticles = field(default_factory=ManyParticles)
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY ...", help_behavior_hint="(the best heuristics)")] = ()
    """Baselines (three_step, pursuit, circle:40, information, stationary, random, oracle_circle; uncertain and assignment, which
    share out tags), learned (the policy that comes with the package) and folders of training runs. NAME=RUN,RUN,... are runs of
    one training that differ in their seed, as one row: a single seed is no result.
    my_module:MyController is a controller of your own (a class of heuristics, or what makes a policy for a simulation).
    static_array:200 stands for four moored receivers on a square of 200 m (as without a number), which locate every ping."""
    trial: EpisodeOptions = field(default_factory=EpisodeOptions)
    trust: bool = False
    """Load models of Stable-Baselines3 (model.zip) among --policies, which runs the code in them."""
    from_step: WholeNumber = 0
    """First step of each episode that counts: 100 leaves out how the fish was found."""
    metrics: Annotated[tuple[str, ...], tyro.conf.arg(metavar="MODULE:FUNCTION ...", help_behavior_hint="(none)")] = ()
    """Figures of your own: functions of an EpisodeRecord (errors, ranges, each (E, K) [m]) that give a number for each of E."""
    record: WholeNumber = 0
    """Episodes of each policy, the first ones, that are also written as logs of missions, for `python -m live replay`."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(runs/benchmark-ID-TIME)")] = None
    """Folder to write; an earlier benchmark's is replaced."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        task, trial, env_id = self.task.build(), self.trial, self.task.env_id
        specs = name_groups(self.policies or rivals_of(task))
        metrics = {text.rpartition(":")[2]: import_object(text) for text in self.metrics}
        if not 0 <= self.record <= trial.episodes:
            raise ValueError(f"--record must be from 0 to the {trial.episodes} episodes, got {self.record}")
        if self.record and task.scenario.vehicles > 1:
            raise ValueError(f"--record writes missions of one vehicle, got vehicles={task.scenario.vehicles}; leave it out")
        makers = make_groups(specs, task, env_id, trust=self.trust)
        out = self.out or default_folder("benchmark", env_id)
        if self.record:
            require_logs(out, makers)
        require_replaceable(out, OWN_FILES, "benchmark")
        runs = sum(len(maker) if isinstance(maker, dict) else 1 for maker in makers.values())
        with progress_bar(runs * trial.episodes * task.scenario.episode_steps) as advance:
            comparison = compare(
                task,
                makers,
                episodes=trial.episodes,
                seed=trial.seed,
                threads=trial.threads,
                from_step=self.from_step,
                metrics=metrics,
                env_id=f"{env_id} ({self.task.preset})" if self.task.preset else env_id,
                on_step=advance,
            )
        rich.print(console_table(comparison.document({})))  # before it is written: a full disk must not cost the result
        asked = {
            **self.task.describe(task),
            "replayed": task.describe_tracks(),
            "policies": specs,
            "episodes": trial.episodes,
            "seed": trial.seed,
            "from_step": self.from_step,
            "metrics": self.metrics,
        }
        with replace_results(out, OWN_FILES) as folder:
            write_benchmark(folder, comparison.document(collect_versions()))
            write_json(folder / "config.json", asked)
            save_figure(folder / "errors.png", draw_errors(comparison))
            if learning := draw_learning(comparison, specs):
                save_figure(folder / "learning_curves.png", learning)
            draw_tracks(folder, comparison, makers)
        if self.record:
            self.write_logs(out, makers, task)
        print(f"written: {out}")

    def write_logs(self, out: Path, makers: Mapping[str, Contestant | dict[str, Contestant]], task: Task) -> None:
        """The first episodes of each policy, a folder each, in one that lies beside ``out``."""
        asked, logs = self.task.make_options(), logs_of(out)
        shutil.rmtree(logs, ignore_errors=True)
        for name, maker in each_run(makers).items():
            if isinstance(maker, Localizer):
                continue
            for episode in range(self.record):
                seed = block_seed(SeedBlock.BENCHMARK, self.trial.seed) + episode
                folder = logs / f"{log_name(name)}-{episode}"
                record_episode(
                    folder, task, maker, seed=seed, preset=asked["preset"], overrides=asked["overrides"] or {}
                )


def each_run(makers: Mapping[str, Contestant | dict[str, Contestant]], *, all_runs: bool = True) -> dict[str, Contestant]:
    """All contestants by name, a training's runs as NAME/RUN, or its first one alone."""
    found: dict[str, Contestant] = {}
    for name, maker in makers.items():
        runs = list(maker.items()) if isinstance(maker, dict) else [("", maker)]
        for run, one in runs if all_runs else runs[:1]:
            found[f"{name}/{run}" if run else name] = one
    return found


def logs_of(out: Path) -> Path:
    """Where the logs of a benchmark lie: beside its folder."""
    return out.with_name(f"{out.name}-logs")


def log_name(policy: str) -> str:
    """A policy's name as that of a folder."""
    return policy.replace(":", "-").replace("/", "-")


def require_logs(out: Path, makers: Mapping[str, Contestant | dict[str, Contestant]]) -> None:
    """Refuse, before any work is done, logs that cannot be written, or that somebody else wrote."""
    logs = logs_of(out)
    names = [log_name(name) for name, maker in each_run(makers).items() if not isinstance(maker, Localizer)]
    if not names:
        raise ValueError("--record writes missions of vehicles, and none of --policies steers one; leave it out")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"--record would write two policies to {logs / twice}-0; rename a folder")
    if logs.exists() and not (logs.is_dir() and all((entry / MISSION_FILE).is_file() for entry in logs.iterdir())):
        raise ValueError(f"{logs} holds something else than logs of missions; choose another --out")


def record_episode(folder: Path, task: Task, maker: PolicyMaker, *, seed: int, preset: str | None, overrides: Any) -> None:
    """Write one episode of a policy as the log of a mission."""
    simulation = Simulation(task.scenario, tracks=task.tracks)
    policy, memory = maker(simulation), None
    observation = simulation.reset(seed)
    recorder = Recorder(simulation)
    recorder.note()
    for step in range(task.scenario.episode_steps):
        action, memory = policy.predict(observation[:, 0], memory, np.array([step == 0]), deterministic=True)
        simulation.step(action[:, None])
        recorder.note()
    recorder.write(folder, env_id=task.env_id, seed=seed, preset=preset, overrides=overrides)


def draw_errors(comparison: Comparison) -> Figure:
    """The distributions of the errors, with bands within which they would lie for other fish and training runs."""
    errors = {name: record.error for name, record in comparison.records.items()}
    bootstrap = Bootstrap(resamples=RESAMPLES_OF_BANDS, clusters=comparison.clusters)
    bands = {name: np.array([(e.low, e.high) for e in error_quantiles(comparison.each_run(name), SHARES, bootstrap)]).T
             for name in errors}
    return plot_errors(errors, bands=bands, lost_error=comparison.task.scenario.lost_error)


def draw_learning(comparison: Comparison, specs: Mapping[str, str | dict[str, str]]) -> Figure | None:
    """The learning curves of trainings of several runs, whose folders tell them alike; None where there are none."""
    curves = {}
    for name in comparison.runs:
        group = specs[name]
        runs = [read_curve(Path(folder)) for folder in group.values()] if isinstance(group, dict) else []
        if runs and all(run is not None and np.array_equal(run[0], runs[0][0]) for run in runs):  # type: ignore[index]
            curves[name] = (runs[0][0], np.array([run[1] for run in runs]))  # type: ignore[index]
    return plot_learning_curve(curves, {}) if curves else None


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
