"""Masmitja et al. 2020, Fig. 3C: which radius, particle range and resampling ratio are best, and what missed pings cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.envs.belief.assumptions import AOTT
from tagtrack.envs.motions import Motion, WhiteAcceleration
from tagtrack.envs.sensors import PresenceReceiver
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size, make_row
from tagtrack.eval.papers.masmitja2020_twin import (
    EQUATION_22,
    MAX_RANGE,
    PAPER,
    PARTICLE_RANGE,
    PUBLISHED,
    RADIUS,
    RENEWED,
    RESTING,
    SWIMMING,
    TIME_STEP,
    area_belief,
    iterate,
    make_scenario,
    resample_iterations,
)
from tagtrack.eval.papers.printed import MASMITJA2020_FIG_3C
from tagtrack.eval.plots import COLOURS, FAINT, empty_figure
from tagtrack.eval.statistics.estimate import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE = "Fig. 3C"
SETTLING = 20 * 60.0  # [s] left out: the particles still gather
TARGETS = MappingProxyType({"static": RESTING, "moving": SWIMMING})

# The values of each ratio; those of the others are meanwhile the paper's, all pings received.
SWEEPS: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {
        "radius": (0.2, 0.5, 0.7, 0.8, 0.9, 1.0, 1.2),
        "range": (0.8, 1.0, 1.2, 1.4, 2.0),
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
    "The ratio of least mean error, after the first 20 of 60 minutes; a repetition is 30 iterations, drawn anew from ours. The "
    "filter is read as the first author published it: particles start within the particle range, are spread anew within it, and "
    "change their weights about it (mu), by a Cauchy distribution of 1 m, in silence of 40 m."
)
ON_EQUATION_22 = (
    "As before with Eq. 22's normal weights about the tag's range, the particle range being that of start and renewal alone. On "
    "a circle of the tag's range every ping tells most, and ours prefers it; the particle range then hardly matters."
)
ON_MOTION = (
    "As the first table, particles moving by Eq. 8: a velocity that changes by 1 mm/s in a second along each axis (sigma is not "
    "printed)."
)


@dataclass(frozen=True, kw_only=True)
class RatiosVariant:
    """Under which assumption which ratios are varied."""

    suffix: str
    note: str
    receiver: PresenceReceiver = PUBLISHED
    known: bool = False  # mu is the tag's range, whatever the particle range
    motion: Motion = AOTT.motion
    true_range: float = MAX_RANGE  # within which tags are heard [m]
    ratios: tuple[str, ...] = tuple(SWEEPS)


VARIANTS = (
    RatiosVariant(suffix="", note=NOTE),
    RatiosVariant(suffix=", Eq. 22", receiver=EQUATION_22, known=True, ratios=("radius", "range"), note=ON_EQUATION_22),
    RatiosVariant(suffix=", Eq. 8", motion=WhiteAcceleration(), ratios=("radius", "range"), note=ON_MOTION),
)


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
    for variant in VARIANTS:
        found = {(ratio, target): sweep(ratio, target, variant, setting) for ratio in variant.ratios for target in TARGETS}
        sets = resample_iterations(setting.size.settings, setting.seed)
        rows += [
            make_row(
                found[ratio, target].best(sets),
                paper=PAPER,
                table=TABLE + variant.suffix,
                row=f"{target} target",
                column=f"best {ratio} ratio",
                paper_value=printed,
                unit="1",
                note=variant.note,
            )
            for target in TARGETS
            for ratio, printed in MASMITJA2020_FIG_3C.items()
            if ratio in variant.ratios
        ]
        name = variant.suffix.replace(",", "").replace(" %", "").replace(" ", "_")
        figures["masmitja2020_fig_3c" + name] = plot_sweeps(found)
    return Findings(rows=rows, figures=figures)


def sweep(ratio: str, target: str, variant: RatiosVariant, setting: Setting) -> Sweep:
    """One ratio varied, for one target."""
    errors = [run_value(ratio, value, target, variant, setting) for value in SWEEPS[ratio]]
    return Sweep(values=SWEEPS[ratio], errors=np.array(errors))


def run_value(ratio: str, value: float, target: str, variant: RatiosVariant, setting: Setting) -> Floats:
    """(iterations,) mean error [m] with one ratio changed."""
    particle_range = value * MAX_RANGE if ratio == "range" else PARTICLE_RANGE
    belief = replace(
        area_belief(particle_range, variant.receiver, MAX_RANGE if variant.known else None),
        motion=variant.motion,
        renewed_share=value if ratio == "resampling" else RENEWED,
    )
    scenario = make_scenario(
        seconds=setting.size.settings_seconds,
        particles=setting.size.area_particles,
        reception=value if ratio == "reception" else 1.0,
        fish=TARGETS[target],
        belief=belief,
        true_range=variant.true_range,
    )
    radius = value * MAX_RANGE if ratio == "radius" else RADIUS
    return iterate(scenario, setting.size.settings, setting, radius)[:, round(SETTLING / TIME_STEP) :].mean(axis=1)


def plot_sweeps(found: Mapping[tuple[str, str], Sweep]) -> Figure:
    """Mean error over each ratio, for both targets, with the standard error; the paper's choice is marked."""
    ratios = list(dict.fromkeys(ratio for ratio, _ in found))
    rows, columns = (2, 2) if len(ratios) > 2 else (1, len(ratios))
    figure, panels = empty_figure(width=4.5 * columns, height=3.0 * rows, rows=rows, columns=columns)
    for axes, ratio in zip(panels, ratios, strict=True):
        for target, colour in zip(TARGETS, COLOURS, strict=False):
            each = found[ratio, target]
            spread = each.errors.std(axis=1) / each.errors.shape[1] ** 0.5
            axes.errorbar(each.values, each.errors.mean(axis=1), spread, fmt="o-", ms=4, color=colour, label=f"{target} target")
        if ratio in MASMITJA2020_FIG_3C:
            axes.axvline(MASMITJA2020_FIG_3C[ratio], color=FAINT, lw=1, ls=":")
        axes.set(xlabel=LABELS[ratio], ylabel="mean error [m]", ylim=(0, None))
    panels[0].legend(frameon=False)
    return figure


def count_steps(size: Size) -> int:
    values = sum(len(SWEEPS[ratio]) for variant in VARIANTS for ratio in variant.ratios)
    return len(TARGETS) * values * size.settings * round(size.settings_seconds / TIME_STEP)


SETTINGS_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_settings, steps=count_steps)
