"""Experiments as cells: the same figures whatever runs them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from tagtrack.eval.cells.cell import Cell, Done
from tagtrack.eval.cells.engine import Advance, Engine
from tagtrack.eval.papers.frame import Experiment, Findings, Setting


def run_experiments(
    chosen: Sequence[Experiment], setting: Setting, engine: Engine, advance: Advance | None = None
) -> Mapping[Experiment, Done]:
    """What each experiment found (``Findings``), and the time it took."""
    plain = replace(setting, advance=print)  # what can travel: each reports in its own way
    cells = [
        Cell(
            name=f"{each.paper}, {each.table}",
            function=_repeat,
            arguments=(each.run, plain),
            units=each.steps(setting.size),
        )
        for each in chosen
    ]
    return dict(zip(chosen, engine.run(cells, advance), strict=True))


def _repeat(run: Callable[[Setting], Findings], setting: Setting, *, tell: Callable[[int], None]) -> Findings:
    return run(replace(setting, advance=tell))
