"""`tagtrack eval suite`: policies on every environment, by one protocol that nobody chooses, and one score."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from tagtrack.eval.cells.options import EngineOptions
from tagtrack.eval.whole_number import WholeNumber


@dataclass(frozen=True, kw_only=True)
class Suite:
    """Run policies on every environment and on fleets, by one protocol, and give each one score.

    The protocol is fixed: 256 episodes of each task that nothing else uses, with the tasks' own settings. Judged is the cost,
    minus the mean reward, since that is what the tasks ask for. A score of 0 is the paper's controller, 1 the best known policy;
    between them and beyond it is the logarithm of the geometric mean, over tasks, of the cost ratios. A task that a policy cannot
    play counts like the paper's controller.
    """

    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY ...")] = ("heuristic",)
    """Baselines, `heuristic` (each task's best), or folders of runs in which {task} stands for the task's name:
    mine=runs/{task}-seed0,runs/{task}-seed1. The paper's controllers and `learned` always take part."""
    tasks: Annotated[tuple[str, ...], tyro.conf.arg(metavar="TASK ...", help_behavior_hint="(all)")] = ()
    """Only some, to try; there is no score then, but of these."""
    quick: bool = False
    """16 episodes of each, to see it run."""
    threads: WholeNumber = 1
    """Threads of the simulation; results do not depend on them."""
    engine: EngineOptions = field(default_factory=EngineOptions)
    trust: bool = False
    """Load models of Stable-Baselines3 (model.zip), which runs the code in them."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(runs/suite-TIME.json)")] = None
    """JSON file to write; the leaderboard of the documentation is made from such a one."""

    def run(self) -> None:
        """Run it."""
        from tagtrack.eval.suite_run import run_suite

        run_suite(self)
