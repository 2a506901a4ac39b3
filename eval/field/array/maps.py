"""Maps of moored receivers and what they located."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from tagtrack.eval.plots import COLOURS, FAINT, INK, empty_figure, scale_bar

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_NAMED = 16  # clouds in the legend
MOST_ELLIPSES = 500  # positions with an ellipse each
ELLIPSE = float(np.sqrt(chi2.ppf(0.95, 2)))  # half its axes, in standard deviations: 95 % of positions lie within


@dataclass(frozen=True, kw_only=True)
class Cloud:
    """Positions (K, 2) [m] of one tag; ``joined`` draws a line through them, broken where NaN.

    ``covariance`` (K, 2, 2) [m^2] draws ellipses; ``doubtful`` (K,) bool positions that may as well be elsewhere.
    """

    name: str
    position: NDArray[np.floating]
    joined: bool = False
    covariance: NDArray[np.floating] | None = None
    doubtful: NDArray[np.bool_] | None = None


def plot_map(
    clouds: Sequence[Cloud],
    receivers: NDArray[np.floating],
    names: Sequence[str],
    *,
    truth: NDArray[np.floating] | None = None,
) -> Figure:
    """Receivers (R, 2) [m] with their names, the positions of tags, and where they really were (T, 2), north up.

    The map shows the receivers, all of the tracks and the inner 98 % of other positions, with a margin and a scale bar; up to
    500 positions have ellipses of 95 %.
    """
    figure, (axes,) = empty_figure(width=8.0, height=7.0)
    figure.set_layout_engine("compressed")  # equal scales leave room that "constrained" takes from the labels
    origin = np.round(receivers.mean(axis=0), -2) + 0.0  # -0 is 0
    ellipses = sum(len(cloud.position) for cloud in clouds) <= MOST_ELLIPSES
    for cloud, colour in zip(clouds, _colours(len(clouds)), strict=True):
        label = cloud.name if len(clouds) <= MOST_NAMED else None
        _draw(axes, cloud, cloud.position - origin, colour, label)
        if ellipses and cloud.covariance is not None:
            _draw_ellipses(axes, cloud.position - origin, cloud.covariance, colour)
    if any(cloud.doubtful is not None and cloud.doubtful.any() for cloud in clouds):
        axes.plot([], [], "o", color=INK, mfc="none", mew=0.8, ms=5, label="or elsewhere")
    if truth is not None and np.isfinite(truth).any():
        truth = np.unique(truth[np.isfinite(truth).all(axis=1)], axis=0)
        size = 9 if len(truth) < 50 else 4  # places, or a track
        axes.plot(*(np.asarray(truth) - origin).T, "+", color=INK, ms=size, mew=1.0, label="reference", zorder=4)
    axes.plot(*(receivers - origin).T, "^", color=INK, ms=8, mfc="white", mew=1.6, label="receiver", zorder=5)
    for name, place in zip(names, receivers - origin, strict=True):
        axes.annotate(name, place, xytext=(6, 5), textcoords="offset points", color=INK, fontsize=9)
    shown = [receivers - origin]
    for joined, shares in ((True, (0.0, 1.0)), (False, (0.01, 0.99))):
        every = np.concatenate([cloud.position for cloud in clouds if cloud.joined == joined] or [np.empty((0, 2))]) - origin
        every = every[np.isfinite(every).all(axis=1)]
        if len(every):
            shown.append(np.quantile(every, shares, axis=0))
    low, high = np.min(np.concatenate(shown), axis=0), np.max(np.concatenate(shown), axis=0)
    margin = 0.08 * max(*(high - low), 10.0)
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin), aspect="equal")
    scale_bar(axes, low - margin, high + margin)
    axes.set(xlabel=f"x - {origin[0]:.0f} m", ylabel=f"y - {origin[1]:.0f} m")
    axes.tick_params(colors=FAINT, labelcolor=INK)
    figure.legend(loc="outside right center", frameon=False, fontsize=8)
    return figure


def _draw(axes: Axes, cloud: Cloud, place: NDArray[np.floating], colour: Any, label: str | None) -> None:
    """A line, or points: few of them are seen, many do not cover; hollow where they are doubtful."""
    if cloud.joined:
        axes.plot(*place.T, color=colour, alpha=0.8, lw=0.9, label=label)
        return
    size = float(np.clip(110.0 / max(len(place), 1) ** 0.5, 2.5, 8.0))
    sure = np.ones(len(place), bool) if cloud.doubtful is None else ~cloud.doubtful
    axes.plot(*place[sure].T, ".", color=colour, alpha=0.7, ms=size, mew=0, label=label)
    axes.plot(*place[~sure].T, "o", color=colour, alpha=0.6, ms=0.6 * size, mfc="none", mew=0.6)


def _draw_ellipses(axes: Axes, place: NDArray[np.floating], covariance: NDArray[np.floating], colour: Any) -> None:
    """In which 95 % of such positions lie."""
    from matplotlib.collections import EllipseCollection

    value, vector = np.linalg.eigh(covariance)
    short, long = 2 * ELLIPSE * np.sqrt(np.maximum(value, 0.0)).T
    angle = np.degrees(np.arctan2(vector[:, 1, 1], vector[:, 0, 1]))
    look: dict[str, Any] = {"facecolors": "none", "edgecolors": [colour], "linewidths": 0.5, "alpha": 0.45}
    axes.add_collection(
        EllipseCollection(long, short, angle, units="xy", offsets=place, offset_transform=axes.transData, **look), autolim=False
    )


def _colours(count: int) -> list[Any]:
    """As many as there are clouds; only the first few are told apart by colour-blind readers too."""
    from matplotlib.colors import hsv_to_rgb

    if count <= len(COLOURS):
        return list(COLOURS[:count])
    return [tuple(hsv_to_rgb((k / count, 0.85, (0.9, 0.55)[k % 2]))) for k in range(count)]
