"""Lin et al. 2013, Tables I and II and Fig. 6: the clock of a tag beside the hydrophone."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.eval.field.tag_clock.calibration import Calibration, calibrate
from tagtrack.eval.field.tag_clock.calibration_plot import plot_differences
from tagtrack.eval.field.tag_clock.coded_tag import CodedTag
from tagtrack.eval.field.tag_clock.time_of_flight import TagClock, time_of_flight_range
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
from tagtrack.eval.papers.printed import LIN2013_FIG_6, LIN2013_TABLE_I, LIN2013_TABLE_II
from tagtrack.eval.plots import COLOURS, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER = "lin2013"
LISTED = 103 * 60.0  # [s]: what the differences of Table I sum to
DAY = 22 * 3600.0  # [s] of Fig. 6
LAST = 600.0  # [s] of the record over which the error is taken
SHOWN = 8  # curves in the picture of Fig. 6
OTHERS = "all others"

NOTE_I = (
    "The simulated receiver counts in ticks of 1/4800 s, of which all printed differences are multiples; that, and a jitter "
    "of 15 us, gives which values occur and how often. The shares of missed and misread codes are taken from this very "
    "table, so the numbers of outliers are no prediction."
)
NOTE_II = (
    "The periods are given to the simulated tags; what is tested is that the mean of differences finds them. Sigma is not "
    "given: it follows from the receiver's tick and jitter."
)
NOTE_6 = (
    "T_c from the first 100 minutes by the mean of differences. What is seen after 22 hours is the error of that mean and "
    "the drift of the clock. How far a clock drifts in the simulation is set from these two printed errors, as an upper "
    "bound, so the size of ours is no prediction. The tables below take each cause alone: a clock that does not drift is "
    "off by about two thirds as much, through T_c; T_c from a line through all arrivals leaves the drift alone."
)


def run_histogram(setting: Setting) -> Findings:
    """Table I."""
    counts: dict[float | str, list[int]] = {value: [] for value in LIN2013_TABLE_I} | {OTHERS: []}
    last: Calibration | None = None
    for generator in generators(setting.seed, setting.size.records, 1):
        last = calibrate(record_beside(TAGS["55436"], LISTED, generator))
        values, frequencies = np.unique(np.round(last.differences.value, 5), return_counts=True)
        found = dict(zip(values.tolist(), frequencies.tolist(), strict=True))
        for value in LIN2013_TABLE_I:
            counts[value].append(found.pop(value, 0))
        counts[OTHERS].append(sum(found.values()))
        setting.advance(bursts(TAGS["55436"], LISTED))
    rows = [
        make_row(
            frequencies,
            paper=PAPER,
            table="Table I",
            row=value if isinstance(value, str) else f"{value:.5f} s",
            column="frequency",
            paper_value=math.nan if isinstance(value, str) else LIN2013_TABLE_I[value],
            unit="1",
            note=NOTE_I,
        )
        for value, frequencies in counts.items()
    ]
    assert last is not None
    return Findings(rows=rows, figures={"lin2013_table_i": plot_differences(last, title="twin of Table I, one record")})


def run_periods(setting: Setting) -> Findings:
    """Table II."""
    rows = []
    for stream, (name, tag) in enumerate(TAGS.items(), 2):
        estimates = []
        for generator in generators(setting.seed, setting.size.records, stream):
            estimates.append(calibrate(record_beside(tag, CALIBRATION, generator)).by_differences)
            setting.advance(bursts(tag, CALIBRATION))
        figures = {"T_c": [each.period for each in estimates], "σ": [each.sigma for each in estimates]}
        for column, values in figures.items():
            printed = LIN2013_TABLE_II[name][column]
            make = partial(make_row, np.round(values, 5), paper=PAPER, table="Table II", unit="s", note=NOTE_II)
            rows.append(make(row=f"tag {name}", column=column, paper_value=printed))
    return Findings(rows=rows)


def run_drift(setting: Setting) -> Findings:
    """Fig. 6."""
    tag = TAGS["55436"]
    by_way: dict[str, list[float]] = {"": [], ", T_c from a line": [], ", a clock that does not drift": []}
    curves = []
    for generator in generators(setting.seed, setting.size.records, 4):
        arrival = record_beside(tag, DAY, generator)
        early = arrival[arrival - arrival[0] <= CALIBRATION]
        by_paper, by_line = (late_range(arrival, clock) for clock in (paper_clock(early), calibrate(early).clock))
        curves.append((arrival, by_paper))
        by_way[""].append(final_error(arrival, by_paper))
        by_way[", T_c from a line"].append(final_error(arrival, by_line))
        setting.advance(bursts(tag, DAY))
    steady = replace(tag, wander=0.0)
    for generator in generators(setting.seed, setting.size.records, 5):
        arrival = record_beside(steady, DAY, generator)
        early = arrival[arrival - arrival[0] <= CALIBRATION]
        by_way[", a clock that does not drift"].append(final_error(arrival, late_range(arrival, paper_clock(early))))
        setting.advance(bursts(steady, DAY))
    rows = [
        make_row(
            errors,
            paper=PAPER,
            table="Fig. 6" + way,
            row=day,
            column="error after 22 h",
            paper_value=printed,
            unit="m",
            note=NOTE_6,
        )
        for way, errors in by_way.items()
        for day, printed in LIN2013_FIG_6.items()
    ]
    return Findings(rows=rows, figures={"lin2013_fig_6": plot_drift(curves[:SHOWN])})


def late_range(arrival: Floats, clock: TagClock) -> Floats:
    """Calculated distance [m] at each arrival of a tag that is beside the hydrophone: its error."""
    return time_of_flight_range(arrival, clock, SPEED)


def final_error(arrival: Floats, error: Floats) -> float:
    """Median over the last minutes [m]: single arrivals may be a misread code's."""
    return float(np.median(error[arrival > arrival[-1] - LAST]))


def plot_drift(curves: list[tuple[Floats, Floats]]) -> Figure:
    """Error of the calculated distance over the day, some records."""
    figure, (axes,) = empty_figure(width=8.0, height=4.4)
    for (arrival, error), colour in zip(curves, (*COLOURS, "#9AA0A6"), strict=False):
        blocks = error[: error.size // 50 * 50].reshape(-1, 50)
        hours = (arrival[: blocks.size] - arrival[0]).reshape(-1, 50).mean(axis=1) / 3600
        axes.plot(hours, np.median(blocks, axis=1), color=colour, lw=1.0)
    for day, printed in LIN2013_FIG_6.items():
        axes.plot(DAY / 3600, printed, "D", color=COLOURS[1], mec="white", clip_on=False, zorder=4)
        axes.annotate(day, (DAY / 3600, printed), xytext=(-8, 4), textcoords="offset points", ha="right", fontsize=8)
    axes.set(xlabel="time since the first arrival [h]", ylabel="calculated distance, true 0 [m]", xlim=(0, DAY / 3600))
    axes.set_title(f"code {CODE}, T_c from the first 100 minutes; diamonds: paper", fontsize=10)
    return figure


def record_steps(tag: CodedTag, duration: float, size: Size) -> int:
    return size.records * bursts(tag, duration)


HISTOGRAM_TWIN = Experiment(
    paper=PAPER, table="Table I", run=run_histogram, steps=lambda size: record_steps(TAGS["55436"], LISTED, size)
)
PERIODS_TWIN = Experiment(
    paper=PAPER,
    table="Table II",
    run=run_periods,
    steps=lambda size: sum(record_steps(tag, CALIBRATION, size) for tag in TAGS.values()),
)
DRIFT_TWIN = Experiment(paper=PAPER, table="Fig. 6", run=run_drift, steps=lambda size: 2 * record_steps(TAGS["55436"], DAY, size))
