"""Lin et al. 2013, Table III and Figs. 4 and 5: calculated against actual distance, tied to a buoy and while tracking a boat."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.envs.belief.refilter import Recording
from tagtrack.envs.motions import StraightAndIdle
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sim.sound_speed import sound_speed
from tagtrack.eval.field.tag_clock.coded_tag import CodeReceiver, simulate_arrivals
from tagtrack.eval.field.tag_clock.time_of_flight import TagClock, correct_first_ping, gate_range, time_of_flight_range
from tagtrack.eval.papers.clark2013_twin import TIME_STEP, record_missions
from tagtrack.eval.papers.frame import Experiment, Findings, Setting, Size, make_row
from tagtrack.eval.papers.lin2013_twin import (
    CALIBRATION,
    CODE,
    SPEED,
    TAGS,
    Floats,
    bursts,
    generators,
    paper_clock,
    record_beside,
)
from tagtrack.eval.papers.printed import LIN2013_TABLE_III
from tagtrack.eval.plots import COLOURS, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER, TABLE = "lin2013", "Table III"
TAG = TAGS["55488"]  # "conducted using Tag 55488" (V.B)
TRUE_SPEED = float(sound_speed(19.5, 33.5, 2.0))  # [m/s]: the surface off Catalina in July, our guess
FIX_SIGMA = 2.1  # [m], each axis: 2.5 m of circular error probable, usual for a receiver of one frequency
FIX_MEMORY = 600.0  # [s] over which the error of a GPS position forgets itself
ADJACENT = 60.0  # [s] for which the tag is held to the vehicle, to correct t_0 (Eq. 4 with d_m = 0)

TIED_SECONDS = 233 * 60.0  # 10:25 to 14:18
BUOY = 85.0  # [m] from the tag
LOOP_EVERY = 80 * 60.0  # [s]: "every 80 min ... driven in a single loop between the dock and buoy"
LOOP_SPEED = 1.0  # [m/s]

ACTIVE_SECONDS = 39 * 60.0  # 22:44 to 23:23
SINCE_CORRECTION = 4 * 3600.0  # [s] from the correction of t_0 to the mission: "only several hours"
BOAT = StraightAndIdle(speed=1.0, leg_duration=60.0, idle_duration=240.0)  # "idled for several minutes before relocating"

NOTE = (
    "Actual minus calculated distance over all pings. T_c by the mean of differences over 100 minutes, t_0 by Eq. 4 with "
    f"the tag held to the vehicle, outliers by Alg. 1. Assumed: sound at {TRUE_SPEED:.0f} m/s (19.5 degrees, 33.5 ppt) where "
    f"the paper calculates with 1,500; GPS errors of {FIX_SIGMA:g} m each axis that wander within ten minutes, and as a "
    "constant in the tag's surveyed place; no swing of the buoy. Most of the spread is the GPS's: the table with exact "
    "positions shows what the ranging itself contributes."
)
ON_EXACT = (
    "As Table III, positions known exactly: left are the clock, the receiver's tick of 0.3 m and the speed of sound."
)


@dataclass(frozen=True, kw_only=True)
class RangedPings:
    """One repetition of one experiment, P pings that passed the gate."""

    time: Floats  # (P,) from the start of the experiment [s]
    true: Floats  # (P,) distance [m]
    actual: Floats  # (P,) as the GPS has it [m]
    calculated: Floats  # (P,) from the time of flight [m]

    def error(self, *, exact: bool = False) -> Floats:
        """(P,) actual minus calculated distance [m]; the true one in place of the actual where it is taken ``exact``."""
        return (self.true if exact else self.actual) - self.calculated


def run_ranging(setting: Setting) -> Findings:
    """Table III, as in the paper and with exact positions."""
    missions = record_missions(
        Scenario(time_step=TIME_STEP, episode_steps=round(ACTIVE_SECONDS / TIME_STEP), fish=BOAT),
        setting.size.records,
        seed=setting.seed,
        threads=setting.threads,
        on_step=setting.advance,
    )
    found: dict[str, list[RangedPings]] = {"Tied to buoy": [], "Active tracking": []}
    for mission, generator in zip(missions, generators(setting.seed, setting.size.records, 6), strict=True):
        found["Tied to buoy"].append(measure_tied(generator))
        found["Active tracking"].append(measure_active(mission, generator))
        setting.advance(bursts_of_one())
    rows = []
    for exact, note in ((False, NOTE), (True, ON_EXACT)):
        for name, comparisons in found.items():
            errors = [each.error(exact=exact) for each in comparisons]
            figures = {"mean": [error.mean() for error in errors], "σ": [error.std() for error in errors]}
            for column, values in figures.items():
                table = TABLE + (", exact positions" if exact else "")
                printed = LIN2013_TABLE_III[name][column]
                make = partial(make_row, values, paper=PAPER, table=table, unit="m", note=note)
                rows.append(make(row=name, column=column, paper_value=printed))
    return Findings(rows=rows, figures={"lin2013_fig_4_5": plot_distances({name: each[0] for name, each in found.items()})})


def measure_tied(generator: np.random.Generator) -> RangedPings:
    """The vehicle on its buoy, with its loops to the dock; the record begins with the tag held to it."""

    def distance(time: Floats) -> Floats:
        return np.where(time < ADJACENT, 0.0, tied_distance(time - ADJACENT))

    time, calculated = range_pings(distance, ADJACENT, TIED_SECONDS, generator)
    true = tied_distance(time)
    surveyed = FIX_SIGMA * generator.normal()  # along the line: at 85 m the error across it hardly changes the distance
    return RangedPings(time=time, true=true, actual=true + gps_error(time, generator) - surveyed, calculated=calculated)


def tied_distance(time: Floats) -> Floats:
    """Distance at the buoy, and there and back on the loops."""
    away = BUOY / LOOP_SPEED  # [s] from the buoy to the dock
    since = np.where(time < LOOP_EVERY, np.inf, time % LOOP_EVERY)  # the first loop comes after the first 80 minutes
    return np.minimum(BUOY, LOOP_SPEED * np.abs(since - away))


def measure_active(mission: Recording, generator: np.random.Generator) -> RangedPings:
    """The vehicle after the boat, hours after t_0 was corrected; the boat's place by its GPS, the vehicle's as it believes it."""
    clock = TIME_STEP * np.arange(mission.fish.shape[0])
    begin = ADJACENT + SINCE_CORRECTION

    def distance(time: Floats) -> Floats:
        return np.where(time < begin, 0.0, np.interp(time - begin, clock, mission.range))

    time, calculated = range_pings(distance, begin, ACTIVE_SECONDS, generator)
    believed = np.stack([mission.navigation["x"], mission.navigation["y"]], axis=-1)
    apart = mission.fish - believed
    boat = np.stack([np.interp(time, clock, apart[:, axis]) + gps_error(time, generator) for axis in range(2)], axis=-1)
    true = np.interp(time, clock, mission.range)
    return RangedPings(time=time, true=true, actual=np.hypot(*boat.T), calculated=calculated)


def range_pings(
    distance: Callable[[Floats], Floats], begin: float, duration: float, generator: np.random.Generator
) -> tuple[Floats, Floats]:
    """Time since ``begin`` (P,) [s] and calculated distance (P,) [m] of the pings that pass the gate.

    The clock is the paper's: T_c from an earlier record, t_0 from the first arrival, while the tag is held to the vehicle.
    """
    period = paper_clock(record_beside(TAG, CALIBRATION, generator)).period
    heard = simulate_arrivals(
        TAG, CodeReceiver(), duration=begin + duration, generator=generator, distance=distance, sound_speed=TRUE_SPEED
    )
    arrival = heard.of_code(CODE)
    clock = TagClock(period=period, first_ping=0.0)
    clock = correct_first_ping(clock, time_of_flight_range(arrival[0], clock, SPEED), 0.0, SPEED)
    calculated = time_of_flight_range(arrival, clock, SPEED)
    passed, _ = gate_range(calculated[1:], calculated[:-1])
    kept = np.isfinite(passed) & (arrival[1:] >= begin)
    return arrival[1:][kept] - begin, passed[kept]


def gps_error(time: Floats, generator: np.random.Generator) -> Floats:
    """Error along one axis (P,) [m] of positions at rising times: a Gauss-Markov process."""
    keep = np.exp(-np.diff(time, prepend=-np.inf) / FIX_MEMORY)
    noise = FIX_SIGMA * np.sqrt(1.0 - keep**2) * generator.normal(size=time.size)
    error = np.zeros(time.size)
    for k in range(time.size):
        error[k] = (keep[k] * error[k - 1] if k else 0.0) + noise[k]
    return error


def plot_distances(comparisons: Mapping[str, RangedPings]) -> Figure:
    """Actual and calculated distance over time, one repetition of each experiment."""
    figure, panels = empty_figure(width=9.0, height=6.0, rows=len(comparisons))
    for axes, (name, each) in zip(panels, comparisons.items(), strict=True):
        axes.plot(each.time / 60, each.actual, color=COLOURS[0], lw=1.2, label="actual")
        axes.plot(each.time / 60, each.calculated, ".", color=COLOURS[1], ms=2, label="calculated")
        axes.set(title=f"twin of {name.lower()}", xlabel="time [min]", ylabel="distance [m]", ylim=(0, None))
    panels[0].legend(frameon=False)
    return figure


def bursts_of_one() -> int:
    """Bursts that one repetition of both experiments simulates."""
    return bursts(TAG, 2 * CALIBRATION + 2 * ADJACENT + TIED_SECONDS + SINCE_CORRECTION + ACTIVE_SECONDS)


def count_steps(size: Size) -> int:
    return size.records * (round(ACTIVE_SECONDS / TIME_STEP) + bursts_of_one())


RANGING_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_ranging, steps=count_steps)
