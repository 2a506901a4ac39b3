"""The picture that every table can have: ours with its interval, the printed value beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.eval.papers.frame import Row
from tagtrack.eval.plots import COLOURS, INK, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_rows(rows: Sequence[Row], label: str, *, logarithmic: bool = False) -> Figure:
    """Rows of one unit as points with their interval, the printed value as a diamond; a panel for each table.

    Args:
        label: of the axis, with the unit.
    """
    rows = [row for row in rows if np.isfinite([row.ours, row.low, row.high]).all()]
    tables = list(dict.fromkeys(row.table for row in rows))
    counts = [sum(row.table == table for row in rows) for table in tables]
    columns = min(len(tables), 2)
    height = 0.34 * max(counts, default=1) + 1.1
    figure, panels = empty_figure(
        width=6.0 * columns, height=height * -(-len(tables) // columns), rows=-(-len(tables) // columns), columns=columns
    )
    several = len({row.column for row in rows}) > 1
    for axes, table in zip(panels, tables, strict=False):
        shown = [row for row in rows if row.table == table][::-1]
        places = np.arange(len(shown))
        for place, row in zip(places, shown, strict=True):
            axes.plot([row.low, row.high], [place, place], color=COLOURS[0], lw=2.5, alpha=0.45, solid_capstyle="butt")
        axes.plot([row.ours for row in shown], places, "o", color=COLOURS[0], label="twin: median and middle 95 %")
        axes.plot([row.paper_value for row in shown], places, "D", color=COLOURS[1], mec="white", label="paper")
        axes.set_yticks(places, [f"{row.row}, {row.column}" if several else row.row for row in shown])
        axes.set(title=table, xlabel=label, ylim=(-0.6, len(shown) - 0.4))
        axes.title.set(color=INK, fontsize=10)
        if logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter("")
    for axes in panels[len(tables) :]:
        axes.set_visible(False)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    return figure
