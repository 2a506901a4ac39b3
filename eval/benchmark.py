"""`tagtrack eval benchmark`: policies on the same episodes, as a table, a JSON file, pictures and a report.

What runs it is imported when it runs: the help must not wait for numba.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from tagtrack.eval.cells.options import EngineOptions
from tagtrack.eval.options import EpisodeOptions, ManyParticles
from tagtrack.eval.whole_number import WholeNumber

OWN_FILES = ("benchmark.json", "config.json", "table.md", "errors.png", "learning_curves.png", "track_*.png", "report.html")


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """Compare policies on the same fish.

    Writes benchmark.json, table.md, errors.png (distribution of the error), track_median.png and track_hard.png (the paths in
    two episodes), config.json (what was asked for) and report.html (all of it on one page), and prints the table. Ratios are to
    the first policy named; a step is lost where the error exceeds the scenario's lost_error.
    """

    task: ManyParticles = field(default_factory=ManyParticles)
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY ...", help_behavior_hint="(the best heuristics)")] = ()
    """Baselines (three_step, pursuit, circle:40, information, stationary, random, oracle_circle; uncertain and assignment, which
    share out tags), learned (the policy that comes with the package) and folders of training runs. NAME=RUN,RUN,... are runs of
    one training that differ in their seed, as one row: a single seed is no result.
    my_module:MyController is a controller of your own (a class of heuristics, or what makes a policy for a simulation).
    static_array:200 stands for four moored receivers on a square of 200 m (as without a number), which locate every ping."""
    trial: EpisodeOptions = field(default_factory=EpisodeOptions)
    engine: EngineOptions = field(default_factory=EngineOptions)
    trust: bool = False
    """Load models of Stable-Baselines3 (model.zip) among --policies, which runs the code in them."""
    from_step: WholeNumber = 0
    """First step of each episode that counts: 100 leaves out how the fish was found."""
    metrics: Annotated[tuple[str, ...], tyro.conf.arg(metavar="MODULE:FUNCTION ...", help_behavior_hint="(none)")] = ()
    """Figures of your own: functions of an EpisodeRecord (errors, ranges, each (E, K) [m]) that give a number for each of E."""
    film: bool = True
    """Whether report.html has a moving picture of the median episode: the first policy and the best other one (pygame-ce)."""
    record: WholeNumber = 0
    """Episodes of each policy, the first ones, that are also written as logs of missions, for `tagtrack live replay`."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(runs/benchmark-ID-TIME)")] = None
    """Folder to write; an earlier benchmark's is replaced."""

    def run(self) -> None:
        """Run it."""
        from tagtrack.eval.benchmark_run import run_benchmark

        run_benchmark(self)
