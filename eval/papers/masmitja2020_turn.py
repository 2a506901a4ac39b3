"""Masmitja et al. 2020, Fig. 3D: the error before and after the target's turn with all and with 60 % of its pings received."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.motions import WhiteAcceleration
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size, make_row
from tagtrack.eval.papers.masmitja2020_twin import (
    EQUATION_22,
    MAX_RANGE,
    PAPER,
    SWIMMING,
    TIME_STEP,
    TURN,
    area_belief,
    iterate,
    make_scenario,
    resample_iterations,
    told_of,
)
from tagtrack.eval.papers.printed import MASMITJA2020_FIG_3D, MASMITJA2020_LOST
from tagtrack.eval.plots import COLOURS, FAINT, empty_figure
from tagtrack.eval.statistics.estimate import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE = "Fig. 3D"
SECONDS = 2 * TURN  # the turn comes half way
STRETCH = 30 * 60.0  # [s] over which errors are averaged: the last half hour before the turn, and of the mission
END = 10 * 60.0  # [s]: an iteration is lost whose mean error over the last ten minutes exceeds the transmission range

NOTE = (
    "A repetition is 50 iterations, drawn anew from ours. Averaged: the last half hour before the turn and of all 134 minutes. "
    "Lost: over 250 m off in the last ten. The filter is read as the first author published it, mu, start and renewal at 300 m "
    "(see Fig. 3C). A particle 200 m inside then keeps 6 % of its weight in silence; one miss does not decide."
)
ON_NEARER = "As before, but weights change about the tag's own range, 250 m."
ON_EQUATION_22 = (
    "Eq. 22's normal weights about 250 m allow no missed ping within range: silence moves all particles beyond it, at 60 % "
    "mostly wrongly, and the circle follows. We believe that the printed figures come from the published weights."
)
ON_KNOWN = (
    "Eq. 22's normal edge, but the filter is told the reception ratio: a silence weighs 1 minus it times the survival function. "
    "The right model of misses, which the paper does not print, holds the target."
)
ON_MOTION = "As the first table, particles moving by Eq. 8 (a velocity that changes by 1 mm/s in a second along each axis)."


@dataclass(frozen=True, kw_only=True)
class TurnVariant:
    """One change of an assumption, and why."""

    suffix: str
    note: str
    belief: Belief
    told: bool = False  # the filter knows the reception ratio


VARIANTS = (
    TurnVariant(suffix="", belief=area_belief(), note=NOTE),
    TurnVariant(suffix=", mu 250 m", belief=area_belief(mu=MAX_RANGE), note=ON_NEARER),
    TurnVariant(suffix=", Eq. 22", belief=area_belief(receiver=EQUATION_22, mu=MAX_RANGE), note=ON_EQUATION_22),
    TurnVariant(suffix=", reception known", belief=area_belief(), told=True, note=ON_KNOWN),
    TurnVariant(suffix=", Eq. 8", belief=replace(area_belief(), motion=WhiteAcceleration()), note=ON_MOTION),
)


def run_turn(setting: Setting) -> Findings:
    """Fig. 3D."""
    rows: list[Row] = []
    errors: dict[str, dict[str, Floats]] = {}
    for variant in VARIANTS:
        errors[variant.suffix] = {name: track(variant, float(name) / 100, setting) for name in MASMITJA2020_FIG_3D}
        for name, error in errors[variant.suffix].items():
            rows += turn_rows(name, error, variant, setting.seed)
    return Findings(rows=rows, figures={"masmitja2020_fig_3d": plot_turn(errors)})


def track(variant: TurnVariant, reception: float, setting: Setting) -> Floats:
    """Errors (iterations, steps) [m]."""
    belief = told_of(reception) if variant.told else variant.belief
    size = setting.size
    scenario = make_scenario(seconds=SECONDS, particles=size.area_particles, reception=reception, fish=SWIMMING, belief=belief)
    return iterate(scenario, size.tracked, setting)


def turn_rows(reception: str, error: Floats, variant: TurnVariant, seed: int) -> list[Row]:
    """Errors before and after the turn, and where it is printed the share of iterations lost."""
    sets = resample_iterations(len(error), seed)
    make = partial(make_row, paper=PAPER, table=TABLE + variant.suffix, row=f"{reception} % received", note=variant.note)
    rows = [
        make(mean_error(error, end)[sets].mean(axis=1), column=column, paper_value=printed, unit="m")
        for (column, printed), end in zip(MASMITJA2020_FIG_3D[reception].items(), (TURN, SECONDS), strict=True)
    ]
    if reception == "60":
        lost = 100.0 * is_lost(error)
        rows.append(make(lost[sets].mean(axis=1), column="iterations lost", paper_value=MASMITJA2020_LOST, unit="%"))
    return rows


def mean_error(error: Floats, end: float, stretch: float = STRETCH) -> Floats:
    """(iterations,) mean [m] over the stretch [s] that ends at a time [s]."""
    last, steps = round(end / TIME_STEP), round(stretch / TIME_STEP)
    return error[:, last - steps : last].mean(axis=1)


def is_lost(error: Floats) -> np.ndarray:
    """(iterations,) whether the target is lost at the end."""
    return mean_error(error, SECONDS, END) > MAX_RANGE


def plot_turn(errors: Mapping[str, Mapping[str, Floats]]) -> Figure:
    """Error over time: mean and middle 90 % of the iterations, a panel for each variant."""
    figure, panels = empty_figure(width=11.0, height=3.2 * -(-len(errors) // 2), rows=-(-len(errors) // 2), columns=2)
    for axes in panels[len(errors) :]:
        axes.set_visible(False)
    for axes, (suffix, found) in zip(panels, errors.items(), strict=False):
        for (reception, error), colour in zip(found.items(), COLOURS, strict=False):
            minutes = TIME_STEP / 60 * np.arange(1, error.shape[1] + 1)
            low, high = np.quantile(error, (0.05, 0.95), axis=0)
            axes.fill_between(minutes, low, high, color=colour, alpha=0.2, lw=0)
            axes.plot(minutes, error.mean(axis=0), color=colour, lw=1.4, label=f"{reception} % received")
        axes.axvline(TURN / 60, color=FAINT, lw=1, ls=":")
        axes.set(title=TABLE + suffix, xlabel="time [min]", ylabel="error [m]", yscale="log", ylim=(5, 5000))
        axes.yaxis.set_major_formatter("{x:g}")
    panels[0].legend(frameon=False)
    return figure


def count_steps(size: Size) -> int:
    return len(VARIANTS) * len(MASMITJA2020_FIG_3D) * size.tracked * round(SECONDS / TIME_STEP)


TURN_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_turn, steps=count_steps)
