"""`python -m eval benchmark`: policies on the same episodes, as a table, a JSON file and pictures."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro

from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.comparison import Comparison, compare, typical_episodes
from tagtrack.eval.contestants import find_makers, is_run, name_contestants
from tagtrack.eval.options import EpisodeOptions, ManyParticles
from tagtrack.eval.plots import Track, plot_errors, plot_track, save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import print_table, write_benchmark, write_json
from tagtrack.eval.results_folder import default_folder, replace_results, require_replaceable
from tagtrack.eval.rollout import Contestant, Localizer, PolicyMaker, SeedBlock, block_seed, trace
from tagtrack.eval.versions import collect_versions
from tagtrack.eval.whole_number import WholeNumber
from tagtrack.live.recording import MISSION_FILE, Recorder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OWN_FILES = ("benchmark.json", "config.json", "table.md", "errors.png", "track_*.png")


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """Compare policies on the same fish.

    Writes benchmark.json, table.md, errors.png (distribution of the error), track_median.png and track_hard.png (the paths in
    two episodes) and config.json (what was asked for), and prints the table. Ratios are to the first policy named; a step is
    lost where the error exceeds the scenario's lost_error.
    """

    task: ManyParticles = field(default_factory=ManyParticles)
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY ...")] = ("three_step", "pursuit", "circle")
    """Baselines (three_step, pursuit, circle:40, information, stationary, random, oracle_circle; uncertain and assignment, which
    share out tags), learned (the policy that comes with the package) and folders of training runs.
    my_module:MyController is a controller of your own (a class of heuristics, or what makes a policy for a simulation).
    static_array:200 stands for four moored receivers on a square of 200 m (as without a number), which locate every ping."""
    trial: EpisodeOptions = field(default_factory=EpisodeOptions)
    trust: bool = False
    """Load models of Stable-Baselines3 (model.zip) among --policies, which runs the code in them."""
    from_step: WholeNumber = 0
    """First step of each episode that counts: 100 leaves out how the fish was found."""
    together: bool = False
    """One more row for all training runs taken together: a single seed is no result."""
    record: WholeNumber = 0
    """Episodes of each policy, the first ones, that are also written as logs of missions, for `python -m live replay`."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(runs/benchmark-ID-TIME)")] = None
    """Folder to write; an earlier benchmark's is replaced."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        task, trial, env_id = self.task.build(), self.trial, self.task.env_id
        specs = name_contestants(self.policies)
        runs = [name for name, spec in specs.items() if is_run(spec)] if self.together else []
        if self.together and len(runs) < 2:
            raise ValueError(f"--together takes at least two training runs among --policies, got {len(runs)}")
        if not 0 <= self.record <= trial.episodes:
            raise ValueError(f"--record must be from 0 to the {trial.episodes} episodes, got {self.record}")
        if self.record and task.scenario.vehicles > 1:
            raise ValueError(f"--record writes missions of one vehicle, got vehicles={task.scenario.vehicles}; leave it out")
        makers = find_makers(specs, task, env_id, trust=self.trust)
        out = self.out or default_folder("benchmark", env_id)
        if self.record:
            require_logs(out, makers)
        require_replaceable(out, OWN_FILES, "benchmark")
        with progress_bar(len(makers) * trial.episodes * task.scenario.episode_steps) as advance:
            comparison = compare(
                task,
                makers,
                episodes=trial.episodes,
                seed=trial.seed,
                threads=trial.threads,
                from_step=self.from_step,
                together=runs,
                env_id=f"{env_id} ({self.task.preset})" if self.task.preset else env_id,
                on_step=advance,
            )
        print_table(comparison)  # before it is written: a full disk must not cost the result
        asked = {
            **self.task.describe(task),
            "replayed": task.describe_tracks(),
            "policies": specs,
            "episodes": trial.episodes,
            "seed": trial.seed,
            "from_step": self.from_step,
            "together": runs,
        }
        with replace_results(out, OWN_FILES) as folder:
            write_benchmark(folder, comparison.document(collect_versions()))
            write_json(folder / "config.json", asked)
            save_figure(folder / "errors.png", draw_errors(comparison))
            draw_tracks(folder, comparison, makers)
        if self.record:
            self.write_logs(out, makers, task)
        print(f"written: {out}")

    def write_logs(self, out: Path, makers: Mapping[str, Contestant], task: Task) -> None:
        """The first episodes of each policy, a folder each, in one that lies beside ``out``."""
        asked, logs = self.task.make_options(), logs_of(out)
        shutil.rmtree(logs, ignore_errors=True)
        for name, maker in makers.items():
            if isinstance(maker, Localizer):
                continue
            for episode in range(self.record):
                seed = block_seed(SeedBlock.BENCHMARK, self.trial.seed) + episode
                folder = logs / f"{log_name(name)}-{episode}"
                record_episode(
                    folder, task, maker, seed=seed, preset=asked["preset"], overrides=asked["overrides"] or {}
                )


def logs_of(out: Path) -> Path:
    """Where the logs of a benchmark lie: beside its folder."""
    return out.with_name(f"{out.name}-logs")


def log_name(policy: str) -> str:
    """A policy's name as that of a folder."""
    return policy.replace(":", "-").replace("/", "-")


def require_logs(out: Path, makers: Mapping[str, Contestant]) -> None:
    """Refuse, before any work is done, logs that cannot be written, or that somebody else wrote."""
    logs = logs_of(out)
    names = [log_name(name) for name, maker in makers.items() if not isinstance(maker, Localizer)]
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
    errors = {name: record.error for name, record in comparison.records.items()}
    return plot_errors(errors, lost_error=comparison.task.scenario.lost_error)


def draw_tracks(folder: Path, comparison: Comparison, makers: Mapping[str, Contestant]) -> None:
    """Draw the typical episodes of a comparison, all policies side by side, as ``track_NAME.png``."""
    first = block_seed(SeedBlock.BENCHMARK, comparison.seed)
    for name, episode in typical_episodes(comparison).items():
        tracks = {}
        for policy, maker in makers.items():
            traced = trace(comparison.task, maker, episodes=1, seed=first + episode)
            tracks[policy] = Track(fish=traced.fish[0], vehicle=traced.vehicle[0], belief=traced.estimate[0])
        title = f"{comparison.env}, {name} episode (seed {comparison.seed + episode})"
        save_figure(folder / f"track_{name}.png", plot_track(tracks, title=title))
