"""Lin et al. 2013, Table IV and Figs. 8 and 11: a tagged boat localized by angle, by distance and by both.

The vehicle tracks the boat on both measurements; then filters run offline over what it recorded (V.E).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.recovery import Recovery
from tagtrack.envs.belief.refilter import Recording, refilter
from tagtrack.envs.motions import StraightAndIdle
from tagtrack.envs.scenario import TIME_OF_FLIGHT, Scenario
from tagtrack.envs.sensors import Measurements
from tagtrack.eval.papers.clark2013_twin import TIME_STEP, printed_filter, record_missions
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size, make_row
from tagtrack.eval.papers.lin2013_ranging import ACTIVE_SECONDS, BOAT
from tagtrack.eval.papers.lin2013_twin import Floats, with_measurements
from tagtrack.eval.papers.pictures import plot_rows
from tagtrack.eval.papers.printed import LIN2013_FACTOR, LIN2013_FIG_8, LIN2013_TABLE_IV
from tagtrack.eval.plots import COLOURS, INK, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER, TABLE = "lin2013", "Table IV"
MEASUREMENTS = {"Angle": Measurements.ANGLE, "Distance": Measurements.DISTANCE, "Angle and Distance": Measurements.BOTH}
BINS = ((0.0, 30.0), (30.0, 60.0), (60.0, 90.0))  # [m] from the vehicle to the boat
LEAST_TIME = 30.0  # [s] in a bin; a mission with less says nothing of it
WALK = printed_filter("standard").motion  # of the particles: "simulates shark motion" (IV.C.3)
FASTER = 1.5  # [m/s] of the boat
RATE = 0.1  # alpha_fast, which the paper leaves open


@dataclass(frozen=True, kw_only=True)
class LocalizationVariant:
    """The tables as they stand, or with one assumption changed."""

    changed: str = ""  # behind the table's name
    boat: StraightAndIdle = BOAT
    recovery: Recovery = TIME_OF_FLIGHT.belief.recovery  # offline
    note: str  # of Table IV
    by_distance: str  # of Fig. 11
    full: bool = False  # with all trials; else a quarter of them


NOTE = (
    "Twenty recorded missions after the boat of Table III, twenty trials each. Assumed: particles walk by Clark et al., "
    "Alg. 2; 1,000 of them; sigma_d 3 m; alpha_slow 0.01, alpha_fast 0.3. Both together are best, as printed. Distance alone "
    "beats angle alone, because our vehicle is rarely far off: behind a faster boat (below) the order is the printed one."
)
ON_BOAT = (
    "As Table IV with a boat that relocates at 1.5 m/s. The vehicle falls farther behind, where distance alone errs most "
    "(Fig. 11): order and mean errors come out nearly as printed. The intervals are wide because some missions lose the boat."
)
ON_RATE = (
    "As Table IV with random particles that come more slowly, offline alone: the error with both measurements falls most, that "
    "by distance hardly. The price is a longer way back from a wrong belief (Alg. 2, alpha_fast 0.1)."
)
ON_FIG_8 = "The filter on board in the missions of Table IV, under the same assumptions."
ON_FIG_11 = (
    "No number is printed. Ours: quartiles of missions with 30 s or more in an interval. The paper: hardly a difference below "
    "30 m, both best to 60 m, with the lowest 75th percentile beyond. Here angle is worst below 30 m; both have the best median "
    "to 60 m; beyond it angle is best, unless random particles come more slowly (below)."
)
ON_FIG_11_BOAT = "As Fig. 11 with the faster boat: by the medians the same order in every interval, and more time far off."
ON_FIG_11_RATE = (
    "As Fig. 11 with alpha_fast 0.1: both measurements are best in every interval, and beyond 60 m have the lowest 75th "
    "percentile, as printed."
)

VARIANTS = (
    LocalizationVariant(note=NOTE, by_distance=ON_FIG_11, full=True),
    LocalizationVariant(
        changed=f", boat at {FASTER:g} m/s", boat=replace(BOAT, speed=FASTER), note=ON_BOAT, by_distance=ON_FIG_11_BOAT
    ),
    LocalizationVariant(
        changed=f", alpha_fast {RATE:g}",
        recovery=replace(TIME_OF_FLIGHT.belief.recovery, fast_rate=RATE),
        note=ON_RATE,
        by_distance=ON_FIG_11_RATE,
    ),
)


def boat_scenario(particles: int, boat: StraightAndIdle = BOAT) -> Scenario:
    """Tracking of the boat on both measurements."""
    belief = replace(TIME_OF_FLIGHT.belief, motion=WALK, particles=particles)
    steps = round(ACTIVE_SECONDS / TIME_STEP)
    return replace(TIME_OF_FLIGHT, time_step=TIME_STEP, episode_steps=steps, fish=boat, belief=belief)


def run_localization(setting: Setting) -> Findings:
    """Table IV, Figs. 8 and 11, as they stand and with one assumption changed."""
    missions: dict[StraightAndIdle, list[Recording]] = {}
    rows: list[Row] = []
    by_distance: list[Row] = []
    boxes = {}
    for variant in VARIANTS:
        scenario = boat_scenario(setting.size.particles, variant.boat)
        if variant.boat not in missions:
            missions[variant.boat] = record_missions(
                scenario, setting.size.recorded, seed=setting.seed, threads=setting.threads, on_step=setting.advance
            )
        recorded = missions[variant.boat]
        errors = localize(recorded, variant, scenario.belief, setting)
        distance = np.array([mission.range[1:] for mission in recorded])
        rows += rows_of_table(variant, errors)
        by_distance += rows_by_distance(variant, errors, distance)
        boxes["Fig. 11" + variant.changed] = (errors, distance)
    picture = plot_rows([row for row in rows if row.unit == "m"], "localization error [m]")
    rows += [*rows_of_online(missions[BOAT]), *by_distance]
    return Findings(rows=rows, figures={"lin2013_table_iv": picture, "lin2013_fig_11": plot_by_distance(boxes)})


def localize(
    missions: Sequence[Recording], variant: LocalizationVariant, on_board: Belief, setting: Setting
) -> dict[str, Floats]:
    """Errors (missions, trials, K) [m] by measurements."""
    errors = {}
    for name, measurements in MEASUREMENTS.items():
        receiver = with_measurements(on_board.receiver, measurements)
        belief = replace(on_board, recovery=variant.recovery, receiver=receiver)
        trials = trials_of(variant, setting.size)
        errors[name] = np.array(
            [
                refilter(mission, belief, trials, seed=setting.seed + k, threads=setting.threads, on_step=setting.advance)
                for k, mission in enumerate(missions)
            ]
        )
    return errors


def rows_of_table(variant: LocalizationVariant, errors: Mapping[str, Floats]) -> list[Row]:
    """Mean and standard deviation over all trials and steps of a mission; and by how much both beat the better one alone."""
    make = partial(make_row, paper=PAPER, table=TABLE + variant.changed, note=variant.note)
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


def rows_by_distance(variant: LocalizationVariant, errors: Mapping[str, Floats], distance: Floats) -> list[Row]:
    """Fig. 11: quartiles of a mission's errors while the boat was so far off. ``distance``: (missions, K) [m]."""
    make = partial(make_row, paper=PAPER, table="Fig. 11" + variant.changed, unit="m", note=variant.by_distance)
    rows = []
    for nearest, farthest in BINS:
        within = (nearest <= distance) & (distance < farthest)
        enough = np.flatnonzero(within.sum(axis=1) * TIME_STEP >= LEAST_TIME)
        for name, error in errors.items():
            for column, share in {"median": 0.5, "75th percentile": 0.75}.items():
                values = [np.quantile(error[mission][:, within[mission]], share) for mission in enough]
                rows.append(make(values or [np.nan], row=f"{name}, {nearest:g} to {farthest:g} m", column=column))
    return rows


def plot_by_distance(found: Mapping[str, tuple[Mapping[str, Floats], Floats]]) -> Figure:
    """Boxes of all errors of all missions: a row for each title with its errors and distances, a panel for each bin."""
    figure, panels = empty_figure(width=9.0, height=3.0 * len(found), rows=len(found), columns=len(BINS))
    places = ((title, *each, bin_) for title, each in found.items() for bin_ in BINS)
    for axes, (title, errors, distance, (nearest, farthest)) in zip(panels, places, strict=True):
        within = (nearest <= distance) & (distance < farthest)
        held = [np.swapaxes(error, 1, 2)[within].ravel() for error in errors.values()]
        boxes = axes.boxplot(held, whis=(2.5, 97.5), showfliers=False, widths=0.6, patch_artist=True)
        for box, colour in zip(boxes["boxes"], COLOURS, strict=False):
            box.set(facecolor=colour, alpha=0.45)
        for line in boxes["medians"]:
            line.set(color=INK, lw=1.6)
        axes.set_xticks(range(1, len(errors) + 1), ["both" if " and " in name else name.lower() for name in errors])
        axes.set_title(f"{nearest:g} to {farthest:g} m, {100 * within.mean():.0f} % of the time", fontsize=9)
        axes.set(ylim=(0, None))
        axes.grid(visible=False, axis="x")
        if nearest == BINS[0][0]:
            axes.set_ylabel(title + "\nlocalization error [m]")
    figure.suptitle("all missions and trials: quartiles, whiskers hold 95 %", fontsize=10)
    return figure


def trials_of(variant: LocalizationVariant, size: Size) -> int:
    return size.offline if variant.full else max(size.offline // 4, 1)


def count_steps(size: Size) -> int:
    """Filter steps of all variants, recording included."""
    trials = sum(len(MEASUREMENTS) * trials_of(variant, size) for variant in VARIANTS)
    recordings = len({variant.boat for variant in VARIANTS})
    return round(ACTIVE_SECONDS / TIME_STEP) * size.recorded * (recordings + trials)


LOCALIZATION_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_localization, steps=count_steps)
