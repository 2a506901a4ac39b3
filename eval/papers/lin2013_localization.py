"""Lin et al. 2013, Table IV and Figs. 8 and 11: a tagged boat localized by angle, by distance and by both.

The vehicle tracks the boat on both measurements; then filters run offline over what it recorded (V.E).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.envs.belief.filter import Belief
from tagtrack.envs.belief.refilter import Recording, refilter
from tagtrack.envs.belief.weighing import Measurements
from tagtrack.envs.scenario import TIME_OF_FLIGHT, Scenario
from tagtrack.envs.sim.motion import MomentumRandomWalk, Motion
from tagtrack.eval.papers.clark2013_twin import TIME_STEP, printed_filter, record_missions
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size, make_row
from tagtrack.eval.papers.lin2013_ranging import ACTIVE_SECONDS, BOAT
from tagtrack.eval.papers.lin2013_twin import Floats
from tagtrack.eval.papers.pictures import plot_rows
from tagtrack.eval.papers.printed import LIN2013_FACTOR, LIN2013_FIG_8, LIN2013_TABLE_IV
from tagtrack.eval.plots import COLOURS, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER, TABLE = "lin2013", "Table IV"
MEASUREMENTS = {"Angle": Measurements.ANGLE, "Distance": Measurements.DISTANCE, "Angle and Distance": Measurements.BOTH}
BINS = ((0.0, 30.0), (30.0, 60.0), (60.0, 90.0))  # [m] from the vehicle to the boat
LEAST_TIME = 30.0  # [s] in a bin; a mission with less says nothing of it
WALK = printed_filter("standard").motion


@dataclass(frozen=True, kw_only=True)
class Variant:
    """The table with the particles moved in one way."""

    table: str
    motion: Motion
    note: str
    full: bool = False  # with all trials; else a quarter of them


NOTE = ""
ON_BOUNDS = ""
ON_FIG_8 = ""
ON_FIG_11 = ""

VARIANTS = (
    Variant(table=TABLE, motion=WALK, note=NOTE, full=True),
    Variant(table=f"{TABLE}, particles at 1 m/s at most", motion=MomentumRandomWalk(), note=ON_BOUNDS),
)


def boat_scenario(particles: int) -> Scenario:
    """Tracking of the boat on both measurements, with particles that walk as in Clark et al. 2013, Alg. 2."""
    belief = replace(TIME_OF_FLIGHT.belief, motion=WALK, particles=particles)
    steps = round(ACTIVE_SECONDS / TIME_STEP)
    return replace(TIME_OF_FLIGHT, time_step=TIME_STEP, episode_steps=steps, fish=BOAT, belief=belief)


def run_localization(setting: Setting) -> Findings:
    """Table IV with its variants, Figs. 8 and 11."""
    scenario = boat_scenario(setting.size.particles)
    missions = record_missions(
        scenario, setting.size.recorded, seed=setting.seed, threads=setting.threads, on_step=setting.advance
    )
    by_variant = {variant: localize(missions, variant, scenario.belief, setting) for variant in VARIANTS}
    rows = [row for variant, errors in by_variant.items() for row in rows_of_table(variant, errors)]
    pictures = {"lin2013_table_iv": plot_rows([row for row in rows if row.unit == "m"], "localization error [m]")}
    rows += rows_of_online(missions)
    distance = np.array([mission.contact["range"][1:] for mission in missions])
    errors = by_variant[VARIANTS[0]]
    rows += rows_by_distance(errors, distance)
    return Findings(rows=rows, figures=pictures | {"lin2013_fig_11": plot_by_distance(errors, distance)})


def localize(missions: Sequence[Recording], variant: Variant, on_board: Belief, setting: Setting) -> dict[str, Floats]:
    """Errors (missions, trials, K) [m] by measurements."""
    errors = {}
    for name, measurements in MEASUREMENTS.items():
        belief = replace(on_board, motion=variant.motion, measurements=measurements)
        errors[name] = np.array(
            [
                refilter(
                    mission,
                    belief,
                    trials_of(variant, setting.size),
                    seed=setting.seed + number,
                    threads=setting.threads,
                    on_step=setting.advance,
                )
                for number, mission in enumerate(missions)
            ]
        )
    return errors


def rows_of_table(variant: Variant, errors: Mapping[str, Floats]) -> list[Row]:
    """Mean and standard deviation over all trials and steps of a mission; and by how much both beat the better one alone."""
    make = partial(make_row, paper=PAPER, table=variant.table, note=variant.note)
    rows = []
    for row, error in errors.items():
        figures = {"mean": error.mean(axis=(1, 2)), "σ": error.std(axis=(1, 2))}
        for column, values in figures.items():
            rows.append(make(values, row=row, column=column, paper_value=LIN2013_TABLE_IV[row][column], unit="m"))
    angle, distance, both = (error.mean(axis=(1, 2)) for error in errors.values())
    factor = np.minimum(angle, distance) / both
    return [*rows, make(factor, row="the better one / both", column="mean", paper_value=LIN2013_FACTOR, unit="1")]


def rows_of_online(missions: Sequence[Recording]) -> list[Row]:
    """Fig. 8: the filter that ran on board."""
    errors = [
        np.hypot(mission.belief["estimate_x"] - mission.fish[:, 0], mission.belief["estimate_y"] - mission.fish[:, 1])[1:]
        for mission in missions
    ]
    make = partial(make_row, paper=PAPER, table="Fig. 8", row="on board", unit="m", note=ON_FIG_8)
    figures = {"mean": [error.mean() for error in errors], "σ": [error.std() for error in errors]}
    return [make(values, column=column, paper_value=LIN2013_FIG_8[column]) for column, values in figures.items()]


def rows_by_distance(errors: Mapping[str, Floats], distance: Floats) -> list[Row]:
    """Fig. 11: quartiles of a mission's errors while the boat was so far off. ``distance``: (missions, K) [m]."""
    make = partial(make_row, paper=PAPER, table="Fig. 11", unit="m", note=ON_FIG_11)
    rows = []
    for nearest, farthest in BINS:
        within = (nearest <= distance) & (distance < farthest)
        enough = np.flatnonzero(within.sum(axis=1) * TIME_STEP >= LEAST_TIME)
        for name, error in errors.items():
            for column, share in {"median": 0.5, "75th percentile": 0.75}.items():
                values = [np.quantile(error[mission][:, within[mission]], share) for mission in enough]
                rows.append(make(values or [np.nan], row=f"{name}, {nearest:g} to {farthest:g} m", column=column))
    return rows


def plot_by_distance(errors: Mapping[str, Floats], distance: Floats) -> Figure:
    """Boxes of all errors of all missions, a panel for each interval of the distance."""
    figure, panels = empty_figure(width=9.0, height=4.2, columns=len(BINS))
    for axes, (nearest, farthest) in zip(panels, BINS, strict=True):
        within = (nearest <= distance) & (distance < farthest)
        held = [np.swapaxes(error, 1, 2)[within].ravel() for error in errors.values()]
        boxes = axes.boxplot(held, whis=(2.5, 97.5), showfliers=False, widths=0.6, patch_artist=True)
        for box, colour in zip(boxes["boxes"], COLOURS, strict=False):
            box.set(facecolor=colour, alpha=0.45)
        for line in boxes["medians"]:
            line.set(color="black", lw=1.5)
        axes.set_xticks(range(1, len(errors) + 1), [name.replace(" and ", "\nand ") for name in errors])
        axes.set_title(f"{nearest:g} to {farthest:g} m, {within.mean():.1%} of the time", fontsize=10)
        axes.set(ylim=(0, None))
        axes.grid(visible=False, axis="x")
    panels[0].set_ylabel("localization error [m]")
    figure.suptitle("all missions and trials: quartiles, whiskers hold 95 %", fontsize=10)
    return figure


def trials_of(variant: Variant, size: Size) -> int:
    return size.offline if variant.full else max(size.offline // 4, 1)


def count_steps(size: Size) -> int:
    """Filter steps of all variants, recording included."""
    trials = sum(len(MEASUREMENTS) * trials_of(variant, size) for variant in VARIANTS)
    return round(ACTIVE_SECONDS / TIME_STEP) * size.recorded * (1 + trials)


LOCALIZATION_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_localization, steps=count_steps)
