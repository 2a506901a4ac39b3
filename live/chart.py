"""The chart of a running mission."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tagtrack.live.map import ellipse_of
from tagtrack.live.tracker import Estimate


def draw_chart(path: Path, track: Sequence[tuple[float, float]], estimates: Sequence[Estimate]) -> None:
    """Draw where the vehicle went, (x, y) [m or degrees], and where tags are believed to be."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Ellipse

    from tagtrack.eval.plots import COLOURS, FAINT, save_figure

    figure = Figure(figsize=(6.0, 6.0), layout="constrained")
    axes = figure.subplots()
    own = np.array(track)
    axes.plot(*own.T, color=FAINT, label="vehicle")
    axes.plot(*own[-1], marker=(3, 0, 0), color="black", markersize=8, linestyle="none")
    for k, estimate in enumerate(estimates):
        colour = COLOURS[k % len(COLOURS)]
        covariance = estimate.covariance
        width, height, angle = ellipse_of(math.sqrt(covariance[0, 0]), math.sqrt(covariance[1, 1]), float(covariance[0, 1]))
        axes.plot(estimate.x, estimate.y, marker="*", color=colour, markersize=10, linestyle="none", label=str(estimate.tag))
        axes.add_patch(Ellipse((estimate.x, estimate.y), 2 * width, 2 * height, angle=angle, fill=False, color=colour))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, east")
    axes.set_ylabel("y, north")
    axes.legend(fontsize=8)
    save_figure(path, figure)
