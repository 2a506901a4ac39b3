"""`tagtrack eval papers`: simulated twins of the papers' experiments, as a table, a JSON file and pictures."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from tagtrack.eval.cells.cell import Done
from tagtrack.eval.cells.engine import Engine
from tagtrack.eval.cells.options import EngineOptions
from tagtrack.eval.papers.document import as_markdown_page, console_table, papers_document
from tagtrack.eval.papers.frame import QUICK, Experiment, Findings, Setting, Size
from tagtrack.eval.papers.registry import EXPERIMENTS
from tagtrack.eval.papers.running import run_experiments
from tagtrack.eval.plots import save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import show, write_json, write_text
from tagtrack.eval.results_folder import default_folder, replace_results, require_replaceable
from tagtrack.eval.rollout import SeedBlock, block_seed
from tagtrack.eval.versions import collect_versions

OWN_FILES = ("papers.json", "papers.md", *(f"{paper}_*.png" for paper in EXPERIMENTS))


@dataclass(frozen=True, kw_only=True)
class Papers:
    """Repeat the papers' experiments in simulation and set our figures beside the printed ones.

    Writes papers.json (one row for each printed figure), papers.md (the same as tables, with what was assumed and why figures
    differ) and a picture for each table. The papers did each experiment once: ours is the median of many repetitions, in brackets
    their middle 95 %. Nothing is tuned to match.
    """

    paper: Annotated[str | None, tyro.conf.arg(metavar="|".join(EXPERIMENTS), help_behavior_hint="(all)")] = None
    """Of which paper."""
    quick: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """A few repetitions with few particles: shows that it runs, its figures mean nothing."""
    seed: int = 0
    """Of the first repetition; the others follow."""
    engine: EngineOptions = field(default_factory=EngineOptions)
    data: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(TAGTRACK_DATA, else none)")] = None
    """Folder with the field data of Masmitja et al. 2020 (resnep/), for their Tables 1 and S1; left out without it."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(runs/papers-PAPER-TIME)")] = None
    """Folder to write; earlier results of this command are replaced."""

    def run(self) -> None:
        """Run it."""
        if self.paper is not None and self.paper not in EXPERIMENTS:
            raise ValueError(f"unknown paper {self.paper!r}; known: {', '.join(EXPERIMENTS)}")
        self.engine.check()
        if self.data is not None and not self.data.is_dir():
            raise FileNotFoundError(f"no folder {self.data}; name the one that holds resnep/, or leave --data out")
        first = block_seed(SeedBlock.BENCHMARK, self.seed)
        out = self.out or default_folder("papers", self.paper or "all")
        require_replaceable(out, OWN_FILES, "comparison with the papers")
        size = QUICK if self.quick else Size()
        with self.engine.open() as engine:
            taken = self.repeat(size, first, engine)
            found: dict[Experiment, Findings] = {experiment: done.value for experiment, done in taken.items()}
            seconds = {experiment: done.seconds for experiment, done in taken.items()}
            document = papers_document(found, seconds=seconds, seed=self.seed, size=size, versions=collect_versions())
            show(console_table(document))
            with replace_results(out, OWN_FILES) as folder:
                write_json(folder / "papers.json", document)
                write_text(folder / "papers.md", as_markdown_page(document))
                for name, figure in figures_of(found).items():
                    save_figure(folder / f"{name}.png", figure)
        print(f"written: {out}")

    def repeat(self, size: Size, seed: int, engine: Engine) -> Mapping[Experiment, Done]:
        """What each experiment found, and the time it took."""
        chosen = [each for paper, experiments in EXPERIMENTS.items() if self.paper in (None, paper) for each in experiments]
        setting = Setting(size=size, seed=seed, data=self.data or named_data())
        with progress_bar(sum(experiment.steps(size) for experiment in chosen)) as advance:
            return run_experiments(chosen, setting, engine, advance)


def named_data() -> Path | None:
    """The folder that TAGTRACK_DATA names."""
    named = os.environ.get("TAGTRACK_DATA")
    return Path(named) if named else None


def figures_of(found: Mapping[Experiment, Findings]) -> dict[str, Any]:
    """All figures by file name."""
    return {name: figure for findings in found.values() for name, figure in findings.figures.items()}
