"""A map of a mission: the vehicle's track, where each tag was believed to be with its ellipses, where it was heard."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tagtrack.live.replay import Mission, Reference, Replayed

ELLIPSES = 12  # of each tag
MOST_POINTS = 4000  # of a line


def plot_mission(path: Path, mission: Mission, replayed: Replayed, reference: Reference | None) -> None:
    """Write the picture."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Ellipse

    from tagtrack.eval.plots import COLOURS, FAINT, INK, save_figure

    figure = Figure(figsize=(7.5, 7.0), layout="constrained")
    axes = figure.subplots()
    fixes = mission.log.navigation
    own = np.array([[fix.x, fix.y] for fix in fixes])
    times = np.array([fix.t for fix in fixes])
    axes.plot(*thin(own).T, color=FAINT, linewidth=1.2, label="vehicle", zorder=1)
    axes.plot(*own[0], marker="o", color=INK, markersize=5, linestyle="none", label="begin", zorder=4)
    degrees = mission.conventions.origin is not None
    scale = _degrees_per_metre(own) if degrees else (1.0, 1.0)
    shown = [own]
    for k, tag in enumerate(mission.tags):
        colour = COLOURS[k % len(COLOURS)]
        columns = replayed.of(tag)
        if reference is not None:
            truth = reference.at(tag, columns["t"])
            axes.plot(*thin(truth).T, color=colour, linewidth=2.5, alpha=0.35, label=f"{tag}, reference", zorder=2)
        heard = [reading.t for reading in mission.log.readings if reading.tag == tag and reading.heard]
        if heard:
            at = np.stack([np.interp(heard, times, own[:, axis]) for axis in (0, 1)], axis=1)
            axes.plot(*thin(at).T, ".", markersize=4, color=colour, alpha=0.5, label=f"{tag}, heard from", zorder=3)
            since = columns["t"] >= heard[0]
            best = np.stack([columns["best_x"], columns["best_y"]], axis=1)[since]
            axes.plot(*thin(best).T, color=colour, linewidth=1.4, label=f"{tag}, estimate", zorder=3)
            shown.append(best)
            rows = np.flatnonzero(since)
            for row in rows[np.unique(np.linspace(0, len(rows) - 1, ELLIPSES).astype(int))] if len(rows) else ():
                sd_x, sd_y = columns["sd_x"][row] * scale[0], columns["sd_y"][row] * scale[1]
                width, height, angle = ellipse_of(sd_x, sd_y, columns["cov_xy"][row] * scale[0] * scale[1])
                place = columns["x"][row], columns["y"][row]
                axes.add_patch(
                    Ellipse(place, 2 * width, 2 * height, angle=angle, fill=False, color=colour, linewidth=0.7, alpha=0.7)
                )
    whole = np.concatenate(shown)
    low, high = np.nanmin(whole, axis=0), np.nanmax(whole, axis=0)
    reach = 0.55 * float(((high - low) / scale).max()) + 1e-3  # [m]
    x, y = 0.5 * (low + high)
    axes.set_xlim(x - reach * scale[0], x + reach * scale[0])
    axes.set_ylim(y - reach * scale[1], y + reach * scale[1])
    axes.set_aspect(scale[0] / scale[1])
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.tick_params(axis="x", labelrotation=20 if degrees else 0)
    axes.set_xlabel("longitude [degrees]" if degrees else "x, east [m]")
    axes.set_ylabel("latitude [degrees]" if degrees else "y, north [m]")
    axes.set_title(f"{mission.task.env_id}: ellipses hold 39 % (one sigma)", fontsize=10)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    save_figure(path, figure)


def thin(points: np.ndarray) -> np.ndarray:
    """At most so many points as can be told apart."""
    return points[:: max(1, len(points) // MOST_POINTS)]


def ellipse_of(sd_x: float, sd_y: float, cov_xy: float) -> tuple[float, float, float]:
    """Half axes [m] and angle [degrees] of the one-sigma ellipse."""
    values, vectors = np.linalg.eigh(np.array([[sd_x**2, cov_xy], [cov_xy, sd_y**2]]))
    minor, major = np.sqrt(np.maximum(values, 0.0))
    return float(major), float(minor), math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))


def _degrees_per_metre(places: np.ndarray) -> tuple[float, float]:
    latitude = math.radians(float(places[:, 1].mean()))
    return 1.0 / (111_320.0 * max(math.cos(latitude), 1e-6)), 1.0 / 110_574.0
