"""Masmitja et al. 2020, Fig. 3C: which radius, particle range and resampling ratio are best, and what missed pings cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.envs.belief.filter import Belief
from tagtrack.eval.metrics import Floats
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size, make_row
from tagtrack.eval.papers.masmitja2020_twin import (
    FILTERS,
    MAX_RANGE,
    PAPER,
    PARTICLE_RANGE,
    RADIUS,
    RENEWED,
    RESTING,
    SWIMMING,
    TIME_STEP,
    iterate,
    make_scenario,
    resample_iterations,
)
from tagtrack.eval.papers.printed import MASMITJA2020_FIG_3C
from tagtrack.eval.plots import COLOURS, FAINT, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE = "Fig. 3C"
SETTLING = 20 * 60.0  # [s] left out: the particles still gather
TARGETS = MappingProxyType({"static": RESTING, "moving": SWIMMING})

# The values of each ratio; those of the others are meanwhile the paper's, all pings received.
SWEEPS: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {
        "radius": (0.2, 0.4, 0.6, 0.8, 0.9, 1.0, 1.2),
        "range": (0.4, 0.8, 1.2, 1.6, 2.4),
        "reception": (0.4, 0.6, 0.8, 0.9, 1.0),
        "resampling": (0.0, 0.005, 0.015, 0.05, 0.15),
    }
)
LABELS = MappingProxyType(
    {
        "radius": "radius of the circle / range of the tag",
        "range": "range of the particles / range of the tag",
        "reception": "pings received / pings",
        "resampling": "share of the particles spread anew",
    }
)

NOTE = (
    "The ratio with the least mean error among those tried, after the first 20 of 60 minutes; a repetition is 30 iterations, "
    "drawn anew from ours. The printed ratios are those that the paper goes on with. With every ping received the particle range "
    "and the share hardly matter: their best values are chance."
)
ON_PUBLISHED = "As before, with the weights of the first author's published filter, which bring Fig. 3D's figures about."


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Mean errors over a ratio's values."""

    values: tuple[float, ...]  # (S,)
    errors: Floats  # (S, iterations) [m]

    def best(self, sets: np.ndarray) -> Floats:
        """(R,) the value with the least mean error in each set (R, iterations) of iterations."""
        return np.asarray(self.values)[self.errors[:, sets].mean(axis=2).argmin(axis=0)]


def run_settings(setting: Setting) -> Findings:
    """Fig. 3C."""
    rows: list[Row] = []
    figures: dict[str, Figure] = {}
    for (suffix, belief), note in zip(FILTERS.items(), (NOTE, ON_PUBLISHED), strict=True):
        found = {(ratio, target): sweep(ratio, target, belief, setting) for ratio in SWEEPS for target in TARGETS}
        sets = resample_iterations(setting.size.settings, setting.seed)
        rows += [
            make_row(
                found[ratio, target].best(sets),
                paper=PAPER,
                table=TABLE + suffix,
                row=f"{target} target",
                column=f"best {ratio} ratio",
                paper_value=printed,
                unit="1",
                note=note,
            )
            for target in TARGETS
            for ratio, printed in MASMITJA2020_FIG_3C.items()
        ]
        figures["masmitja2020_fig_3c" + suffix.replace(", ", "_").replace(" ", "_")] = plot_sweeps(found)
    return Findings(rows=rows, figures=figures)


def sweep(ratio: str, target: str, belief: Belief, setting: Setting) -> Sweep:
    """One ratio varied, for one target."""
    errors = [run_value(ratio, value, target, belief, setting) for value in SWEEPS[ratio]]
    return Sweep(values=SWEEPS[ratio], errors=np.array(errors))


def run_value(ratio: str, value: float, target: str, belief: Belief, setting: Setting) -> Floats:
    """(iterations,) mean error [m] with one ratio changed."""
    belief = replace(
        belief,
        renewed_radius=value * MAX_RANGE if ratio == "range" else PARTICLE_RANGE,
        renewed_share=value if ratio == "resampling" else RENEWED,
    )
    scenario = make_scenario(
        seconds=setting.size.settings_seconds,
        particles=setting.size.area_particles,
        reception=value if ratio == "reception" else 1.0,
        fish=TARGETS[target],
        belief=belief,
    )
    radius = value * MAX_RANGE if ratio == "radius" else RADIUS
    return iterate(scenario, setting.size.settings, setting, radius)[:, round(SETTLING / TIME_STEP) :].mean(axis=1)


def plot_sweeps(found: Mapping[tuple[str, str], Sweep]) -> Figure:
    """Mean error over each ratio, for both targets, with the standard error; the paper's choice is marked."""
    figure, panels = empty_figure(width=9.0, height=6.0, rows=2, columns=2)
    for axes, ratio in zip(panels, SWEEPS, strict=True):
        for target, colour in zip(TARGETS, COLOURS, strict=False):
            each = found[ratio, target]
            spread = each.errors.std(axis=1) / each.errors.shape[1] ** 0.5
            axes.errorbar(each.values, each.errors.mean(axis=1), spread, fmt="o-", ms=4, color=colour, label=f"{target} target")
        if ratio in MASMITJA2020_FIG_3C:
            axes.axvline(MASMITJA2020_FIG_3C[ratio], color=FAINT, lw=1, ls=":")
        axes.set(xlabel=LABELS[ratio], ylabel="mean error [m]", yscale="log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
    panels[0].legend(frameon=False)
    return figure


def count_steps(size: Size) -> int:
    values = sum(len(values) for values in SWEEPS.values())
    return len(FILTERS) * len(TARGETS) * values * size.settings * round(size.settings_seconds / TIME_STEP)


SETTINGS_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_settings, steps=count_steps)
