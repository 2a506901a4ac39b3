"""The map of a survey: receivers, the distances between them, and the reference places (Masmitja et al. 2020, Fig. 4G)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tagtrack.eval.plots import COLOURS, FAINT, INK, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_LABELS = 15  # distances written beside their lines; more would cover each other


def plot_map(document: Mapping[str, Any]) -> Figure:
    """Receivers with their error bars (95 %), lines where a distance was measured, reference places as crosses."""
    figure, (axes,) = empty_figure(width=7.0, height=6.5)
    place = {line["receiver"]: (line["x"], line["y"]) for line in document["receivers"]}
    for line in document["distances"]:
        ends = np.array([place[line["first"]], place[line["second"]]])
        axes.plot(*ends.T, color=FAINT, lw=1, zorder=1)
        if len(document["distances"]) <= MOST_LABELS:
            spot = ends[0] + 0.3 * (ends[1] - ends[0])  # not the middle, where diagonals cross
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
            axes.annotate(f"{line['distance_m']:.1f} m", spot, ha="center", va="center", fontsize=8, color=INK, bbox=box)
    x, y = np.array(list(place.values())).T
    sd = 1.96 * np.array([(line["sd_x"], line["sd_y"]) for line in document["receivers"]]).T
    axes.errorbar(x, y, xerr=sd[0], yerr=sd[1], fmt="o", color=COLOURS[0], ms=6, capsize=3, label="receiver")
    for name, spot in place.items():
        axes.annotate(name, spot, (7, 7), textcoords="offset points", color=COLOURS[0])
    reference = [line["reference"] for line in document["receivers"] if line["reference"] is not None]
    if reference:
        axes.plot(*np.array(reference).T, "x", color=COLOURS[1], mew=2, ms=9, label="reference")
        axes.legend(frameon=False)
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.margins(0.12)
    return figure
