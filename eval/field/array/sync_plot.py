"""The picture of a synchronization: clocks against the reference, before and after (Masmitja et al. 2020, Fig. 4 B-F)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tagtrack.eval.field.static_array.clocks import Synchronization
from tagtrack.eval.plots import COLOURS, FAINT, INK, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DAY, HOUR = 86400.0, 3600.0
MOST_POINTS = 3000  # of a receiver; more are thinned evenly, an eye sees no difference


def plot_residuals(found: Synchronization) -> Figure:
    """Differences to the reference over time: raw, after the line through the initial points, and at the end, by receiver."""
    receptions = found.receptions
    names = [name for name in found.receivers if name in found.models]
    figure, (raw, line, final) = empty_figure(width=13.0, height=max(4.2, 0.3 * len(names) + 1.2), columns=3)
    begin = float(receptions.time.min())
    long = float(receptions.time.max()) - begin > 3 * DAY
    unit, word = (DAY, "days") if long else (HOUR, "hours")
    reach = max(3.0 * found.sigma, 1e-4)
    for row, name in enumerate(names):
        rows = np.flatnonzero(receptions.receiver == found.receivers.index(name))
        rows = rows[np.argsort(receptions.time[rows])]
        kept, out = rows[found.used[rows]], rows[~found.used[rows]]
        kept = kept[:: max(kept.size // MOST_POINTS, 1)]
        look: dict[str, Any] = {"ls": "", "marker": ".", "ms": 2.5, "mew": 0, "color": COLOURS[row % len(COLOURS)]}
        time = (receptions.time[kept] - begin) / unit
        raw.plot(time, found.uncorrected[kept], **look)
        line.plot(time, 1e3 * found.straightened[kept], **look)
        final.axhline(row, color=FAINT, lw=0.6)
        final.plot(time, row - 0.5 * np.clip(found.residual[kept] / reach, -1, 1), **look)
        final.plot((receptions.time[out] - begin) / unit, row - 0.5 * np.sign(found.residual[out]), "x", color=INK, ms=5)
    final.set_yticks(range(len(names)), [f"{name}, {1e3 * found.models[name].rms:.2f} ms" for name in names])
    final.set(ylim=(len(names) - 0.4, -0.6))
    raw.set(ylabel=f"ahead of {found.reference} [s]")
    line.set(ylabel=f"ahead of {found.reference} [ms]")
    titles = ("raw clocks", "after a line through the initial points", f"at the end, rows +-{1e3 * reach:.2g} ms")
    outliers = int(np.sum(~found.used))
    for axes, title in zip((raw, line, final), titles, strict=True):
        axes.set_title(title + (f", x: {outliers} outliers" if axes is final and outliers else ""), fontsize=10, color=INK)
        axes.set(xlabel=f"time [{word}]")
    return figure
