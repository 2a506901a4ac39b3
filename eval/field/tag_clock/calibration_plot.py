"""The picture of a calibration: how the differences between arrivals scatter, and which were left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tagtrack.eval.field.tag_clock.calibration import Calibration, Kind
from tagtrack.eval.plots import COLOURS, INK, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_BINS = 200
LONGEST_SHOWN = 5  # periods; a gap of hours would hide the rest, so it is drawn at the edge


def plot_differences(calibration: Calibration, *, title: str = "") -> Figure:
    """Two histograms: the regular differences about the period, and all differences by kind (Lin et al. 2013, Table I)."""
    figure, (near, wide) = empty_figure(width=10.0, height=4.2, columns=2)
    differences, estimate = calibration.differences, calibration.by_line
    offset = 1e3 * (differences.of_kind(Kind.REGULAR) - estimate.period)
    half = max(float(np.abs(offset).max()), 0.05) * 1.1  # [ms]; a perfect record still gets an axis
    bins = np.linspace(-half, half, int(min(2 * half / 0.01, MOST_BINS)) + 1).tolist()  # 0.01 ms is a record's resolution
    near.hist(offset, bins=bins, color=COLOURS[0])
    near.axvline(0.0, color=INK, lw=1, ls=":")
    near.set(xlabel=f"difference - {estimate.period:.7f} s [ms]", ylabel="frequency", title="regular differences")
    longest = min(float(differences.value.max()), LONGEST_SHOWN * estimate.period)
    edges = np.linspace(0.0, 1.05 * longest, 101).tolist()
    for kind, colour in zip(Kind, COLOURS, strict=False):
        values = differences.of_kind(kind)
        if values.size:
            wide.hist(np.minimum(values, longest), bins=edges, color=colour, label=f"{kind.name.lower()}, {values.size}")
    wide.set(xlabel="difference [s]", yscale="log", ylim=(0.5, None), title="all differences")
    wide.legend(frameon=False)
    if title:
        figure.suptitle(title, color=INK, fontsize=11)
    return figure
