"""Maps of moored receivers and what they located."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.plots import COLOURS, FAINT, INK, empty_figure, scale_bar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_NAMED = 16  # clouds in the legend


@dataclass(frozen=True, kw_only=True)
class Cloud:
    """Positions (K, 2) [m] of one tag; ``joined`` draws a line through them, broken where NaN."""

    name: str
    position: NDArray[np.floating]
    joined: bool = False


def plot_map(
    clouds: Sequence[Cloud],
    receivers: NDArray[np.floating],
    names: Sequence[str],
    *,
    truth: NDArray[np.floating] | None = None,
) -> Figure:
    """Receivers (R, 2) [m] with their names, the positions of tags, and where they really were (T, 2), north up.

    The map shows the receivers, all of the tracks and the inner 98 % of other positions, with a margin and a scale bar.
    """
    figure, (axes,) = empty_figure(width=8.0, height=7.0)
    figure.set_layout_engine("compressed")  # equal scales leave room that "constrained" takes from the labels
    origin = np.round(receivers.mean(axis=0), -2) + 0.0  # -0 is 0
    for cloud, colour in zip(clouds, _colours(len(clouds)), strict=True):
        size = float(np.clip(60.0 / max(len(cloud.position), 1) ** 0.5, 2.5, 7.0))  # few points are seen, many do not cover
        style: dict[str, Any] = {"ls": "-", "lw": 0.8} if cloud.joined else {"ls": "", "marker": ".", "ms": size, "mew": 0}
        label = cloud.name if len(clouds) <= MOST_NAMED else None
        axes.plot(*(cloud.position - origin).T, color=colour, alpha=0.7, label=label, **style)
    if truth is not None and np.isfinite(truth).any():
        truth = np.unique(truth[np.isfinite(truth).all(axis=1)], axis=0)
        axes.plot(*(np.asarray(truth) - origin).T, "+", color=INK, ms=9, mew=1.4, label="reference", zorder=4)
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


def _colours(count: int) -> list[Any]:
    """As many as there are clouds; only the first few are told apart by colour-blind readers too."""
    from matplotlib import colormaps

    shades = [*COLOURS, *(tuple(colormaps["tab20"](k / 20)) for k in range(20))]
    return [shades[k % len(shades)] for k in range(count)]
