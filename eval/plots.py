"""The pictures of an evaluation, drawn from arrays with matplotlib's object API.

No function touches pyplot, so nothing opens a window or leaks into a notebook's own figures. Each returns a `Figure`,
which `save_figure` writes to disk.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tagtrack.eval.metrics import LOST_ERROR
from tagtrack.eval.statistics.estimate import Estimate, Floats, Interval
from tagtrack.policies.files import replace_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito (2008): told apart by colour-blind readers too. The yellow is left out, it vanishes on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#333333")
FISH, VEHICLE = "#56B4E9", "#D55E00"
INK, FAINT, GRID = "#333333", "#9AA0A6", "#E6E8EA"
SMALLEST_ERROR = 0.001  # [m]; a logarithmic axis has no zero, smaller errors are drawn here


@dataclass(frozen=True, kw_only=True)
class EpisodePaths:
    """One episode of one policy, every array (K, 2) [m]; NaN where unknown. Of a fleet there are further axes after K."""

    fish: NDArray[np.floating]  # (K, T, 2) of T tags
    vehicle: NDArray[np.floating]  # (K, V, 2) of V vehicles
    belief: NDArray[np.floating]  # the estimate, not the particles; (K, O, T, 2) of O beliefs


@dataclass(frozen=True, kw_only=True)
class TradeoffCurve:
    """One policy at P settings: how near it came against how well it knew."""

    inside: Sequence[Interval]  # share of time inside the perimeter
    error: Sequence[Interval]  # mean localization error [m]
    labels: Sequence[str] = ()  # the setting of each point, for instance "30 m"; all points or none
    learned: bool = False  # drawn with stars


def save_figure(path: str | os.PathLike[str], figure: Figure) -> None:
    """Write a figure as PNG, whole or not at all."""
    _take_names_as_they_are(figure)
    with replace_file(path) as temporary:
        figure.savefig(temporary, format="png", dpi=150)


def _take_names_as_they_are(figure: Figure) -> None:
    """No text of ours is a formula, but for the powers of ten of logarithmic axes: of a tag "$1$" the dollars are part."""
    from matplotlib.text import Text
    from matplotlib.ticker import LogFormatter

    powers: set[Text] = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), LogFormatter):
                powers |= {*axis.get_ticklabels(which="major"), *axis.get_ticklabels(which="minor")}
    for text in figure.findobj(Text):
        if text not in powers:
            text.set_parse_math(False)  # type: ignore[attr-defined]


SHARES = np.linspace(0.02, 0.98, 49)  # of steps, at which the distribution of errors has a band


def plot_errors(
    errors: Mapping[str, ArrayLike], *, bands: Mapping[str, Floats] | None = None, lost_error: float = LOST_ERROR
) -> Figure:
    """Distribution of the localization error: for each policy the share of steps below an error.

    Args:
        errors: by policy, arrays of any shape [m]; NaN steps are left out.
        bands: by policy, (2, 49) between which the error lies that ``SHARES`` of the steps stay below [m].
        lost_error: marked where it falls into the picture [m].
    """
    from matplotlib.ticker import LogLocator

    figure, (axes,) = empty_figure(width=9.0, height=4.8)
    axes.set_xscale("log")
    share = np.linspace(0, 1, 1001)
    first, last = [], []
    for (name, error), (colour, style) in zip(errors.items(), _looks(), strict=False):
        quantiles = np.nanquantile(np.asarray(error, dtype=np.float64), share)
        label = f"{name}, median {quantiles[500]:.3g} m"
        shown = np.maximum(quantiles, SMALLEST_ERROR)
        axes.plot(shown, 100 * share, color=colour, linestyle=style, lw=1.8, label=label)
        if bands and np.isfinite(bands[name]).all():
            low, high = np.maximum(bands[name], SMALLEST_ERROR)
            axes.fill_betweenx(100 * SHARES, low, high, color=colour, alpha=0.2, lw=0)
        first.append(shown[10])
        last.append(shown[-3])  # the very largest errors would stretch the axis for nothing
    low, high = min(first), max(*last, 1.1 * min(first))
    axes.set(xlim=(low, high), ylim=(0, 100))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
    axes.xaxis.set_minor_formatter("{x:g}")
    if low < lost_error < high:
        axes.axvline(lost_error, color=FAINT, lw=1, ls=":")
        axes.annotate("lost", (lost_error, 3), xytext=(4, 0), textcoords="offset points", color=FAINT)
    axes.set(xlabel="localization error [m]", ylabel="share of steps below [%]")
    figure.legend(loc="outside right center", frameon=False)
    return figure


def plot_track(tracks: Mapping[str, EpisodePaths], *, title: str = "") -> Figure:
    """Paths of fish, vehicle and estimate in one episode, a panel for each policy, all to the same scale.

    The panels show all of fish and vehicle; an estimate that strays farther (mirrored, or not yet formed) is cut.
    """
    shown = np.concatenate([path.reshape(-1, 2) for track in tracks.values() for path in (track.fish, track.vehicle)])
    low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
    margin = 0.06 * max(*(high - low), 10.0)
    low, high = low - margin, high + margin
    columns = min(len(tracks), 4)
    rows = -(-len(tracks) // columns)
    panel_height = np.clip(3.6 * (high[1] - low[1]) / (high[0] - low[0]), 1.8, 6.5)
    width, height = max(3.6 * columns, 5.5), rows * (panel_height + 0.4) + 1.0
    figure, panels = empty_figure(width=width, height=height, rows=rows, columns=columns, shared=True)
    for index, (name, track) in enumerate(tracks.items()):
        axes = panels[index]
        _draw_paths(axes, track)
        fish = track.fish if track.belief.ndim == 2 else track.fish[:, None]
        error = np.nanmean(np.linalg.norm(track.belief - fish, axis=-1))
        digits = ".3g" if error < 1000 else ".0f"
        axes.set_title(f"{name}\nmean error {error:{digits}} m", fontsize=10, color=INK)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        scale_bar(axes, low, high)
        if index + columns >= len(tracks):  # no panel below
            axes.set_xlabel("x [m]")
            axes.tick_params(labelbottom=True)
        if index % columns == 0:
            axes.set_ylabel("y [m]")
    for axes in panels[len(tracks) :]:
        axes.set_visible(False)
    handles, labels = panels[0].get_legend_handles_labels()
    for marker, fill, label in (("o", "white", "start"), ("s", INK, "end")):
        handles += panels[0].plot([], [], marker, color=INK, mfc=fill, mew=1.6, ms=6)
        labels.append(label)
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    if title:
        figure.suptitle(title, color=INK, fontsize=11)
    return figure


def _draw_paths(axes: Axes, track: EpisodePaths) -> None:
    """Lines of all fish, vehicles and estimates, and where the first two begin and end."""
    looks = ((track.fish, FISH, 3.0, "fish"), (track.vehicle, VEHICLE, 1.2, "vehicle"), (track.belief, INK, 0.9, "estimate"))
    for paths, colour, width, name in looks:
        each = paths.reshape(len(paths), -1, 2).swapaxes(0, 1)
        for index, path in enumerate(each):
            axes.plot(*path.T, color=colour, lw=width, label=None if index else name)
    for paths, colour in ((track.fish, FISH), (track.vehicle, VEHICLE)):
        first, last = (paths[k].reshape(-1, 2).T for k in (0, -1))
        axes.plot(*first, "o", color=colour, mfc="white", mew=1.6, ms=7, zorder=4)
        axes.plot(*last, "s", color=colour, ms=5, zorder=4)


def plot_learning_curve(curves: Mapping[str, tuple[ArrayLike, ArrayLike]], levels: Mapping[str, float]) -> Figure:
    """Validation error while learning; of several runs of one training their mean, with a band that holds it for other runs.

    Args:
        curves: by run, (steps (S,), error (S,) [m]), or errors (R, S) of R runs; NaN leaves a gap.
        levels: by heuristic, its mean error [m], drawn as a dashed line.
    """
    from matplotlib.ticker import EngFormatter

    figure, (axes,) = empty_figure(width=7.5, height=4.4)
    looks = _looks()
    for (name, curve), (colour, _) in zip(curves.items(), looks, strict=False):
        steps, error = (np.asarray(values, dtype=np.float64) for values in curve)
        if error.ndim == 2:
            runs, error = error, error.mean(axis=0)
            each = [Estimate(value=mean, below=0.0, above=0.0, relative=True).over_runs(errors, 2**31).interval()
                    for mean, errors in zip(error, runs.T, strict=True)]
            axes.fill_between(steps, [e.low for e in each], [e.high for e in each], color=colour, alpha=0.2, lw=0)
        (line,) = axes.plot(steps, error, "o-", color=colour, ms=3, lw=1.6, label=name)
        if np.isfinite(error).any():
            best = int(np.nanargmin(error))
            line.set_label(f"{name}, best {error[best]:.3g} m")
            axes.plot(steps[best], error[best], "*", color=colour, ms=12, mec="white", zorder=4)
    for (name, level), (colour, _) in zip(levels.items(), looks, strict=False):
        axes.axhline(level, color=colour, lw=1.2, ls="--", label=f"{name}, {level:.3g} m")
    axes.set(xlabel="environment steps", ylabel="validation error [m]")
    axes.xaxis.set_major_formatter(EngFormatter())
    figure.legend(loc="outside right center", frameon=False)
    return figure


def plot_tradeoff(curves: Mapping[str, TradeoffCurve], *, perimeter: float | None = None) -> Figure:
    """Localization error against the share of time inside the perimeter; the lower left corner is best.

    Args:
        perimeter: named on the axis if given [m].
    """
    figure, (axes,) = empty_figure(width=7.5, height=5.0)
    for (name, curve), (colour, style) in zip(curves.items(), _looks(), strict=False):
        (inside, inside_reach), (error, error_reach) = error_bars(curve.inside, 100), error_bars(curve.error)
        axes.errorbar(inside, error, error_reach, inside_reach, fmt="none", ecolor=colour, elinewidth=0.8)
        marker, size = ("*", 12) if curve.learned else ("o", 5)
        axes.plot(
            inside, error, marker=marker, ms=size, mec="white", mew=0.6, color=colour, ls=style, lw=1.4, label=name
        )
        for label, x, y in zip(curve.labels, inside, error, strict=bool(curve.labels)):
            axes.annotate(label, (x, y), xytext=(6, 5), textcoords="offset points", fontsize=8, color=colour)
    where = "the perimeter" if perimeter is None else f"{perimeter:g} m"
    axes.set(xlabel=f"share of time inside {where} [%]", ylabel="mean localization error [m]")
    arrow = {"arrowstyle": "->", "color": FAINT}
    axes.annotate("better", (0.02, 0.02), (0.09, 0.09), "axes fraction", color=FAINT, arrowprops=arrow)
    axes.legend(loc="upper right", frameon=False)
    return figure


def plot_calibration(shares: Mapping[str, Mapping[float, Interval]]) -> Figure:
    """Share of time the truth lies inside the belief's ellipses, beside what the ellipses promise.

    Args:
        shares: by belief, the share by nominal probability; all beliefs with the same probabilities.
    """
    figure, (axes,) = empty_figure(width=6.5, height=4.2)
    nominal = list(next(iter(shares.values())))
    width = min(0.8 / len(shares), 0.35)
    centre = (len(shares) - 1) / 2
    for index, (name, (colour, _)) in enumerate(zip(shares, _looks(), strict=False)):
        share, reach = error_bars([shares[name][probability] for probability in nominal], 100)
        place = np.arange(len(nominal)) + (index - centre) * width
        axes.bar(place, share, 0.9 * width, color=colour, label=name)
        axes.errorbar(place, share, reach, fmt="none", ecolor=INK, elinewidth=0.9)
        for x, height in zip(place, share, strict=True):
            axes.annotate(f"{height:.3g}", (x, 2), ha="center", color="white", fontsize=8)
    group, level = np.arange(len(nominal)), 100 * np.array(nominal)
    axes.hlines(level, group - 0.46, group + 0.46, color=INK, lw=1.6, label="nominal")
    axes.set_xticks(group, [f"{percent:g} % ellipse" for percent in level])
    axes.set(ylabel="share of time the truth lies inside [%]", ylim=(0, 105))
    axes.grid(visible=False, axis="x")
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure


def empty_figure(
    *, width: float, height: float, rows: int = 1, columns: int = 1, shared: bool = False
) -> tuple[Figure, list[Axes]]:
    """An empty figure [inch] and its panels, row by row; shared: all panels to one scale, with equal axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="compressed" if shared else "constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False, sharex=shared, sharey=shared).flat)
    for axes in panels:
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(FAINT)
        axes.tick_params(color=FAINT, labelcolor=INK)
        axes.grid(visible=True, color=GRID, lw=0.7)
        axes.set_axisbelow(True)
    return figure, panels


def _looks() -> Iterator[tuple[str, str]]:
    """Colour and line style, without end; after seven the colours return with another line."""
    return cycle([(colour, style) for style in ("-", "--", ":") for colour in COLOURS])


def error_bars(intervals: Sequence[Interval], scale: float = 1) -> tuple[Floats, Floats]:
    """Values (P,) and the reach (2, P) of their error bars down and up; no bar where there is no interval."""
    value, low, high = scale * np.array([(interval.value, interval.low, interval.high) for interval in intervals]).T
    return value, np.nan_to_num(np.maximum([value - low, high - value], 0))


def scale_bar(axes: Axes, low: Floats, high: Floats) -> None:
    """A bar of 1, 2 or 5 times a power of ten metres, up to a third of the panel, in its lower left corner."""
    steps = np.outer(10.0 ** np.arange(-1, 6), (1, 2, 5)).ravel()
    length = steps[steps < (high[0] - low[0]) / 3].max()
    x, y = low + 0.04 * (high - low)
    axes.plot([x, x + length], [y, y], color=INK, lw=2.5, solid_capstyle="butt", zorder=5)
    middle = (x + length / 2, y)
    axes.annotate(f"{length:g} m", middle, (0, 3), textcoords="offset points", ha="center", fontsize=8, color=INK)
