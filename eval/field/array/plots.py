"""The pictures of a simulated array: Masmitja et al. 2020, Figs. 2, S1 and S2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tagtrack.eval.field.array.monte_carlo import PLACES, Outcome, bound_of_pings
from tagtrack.eval.field.array.scene import ARRAYS, Noise, Scene, place_receivers
from tagtrack.eval.field.static_array.bound import cramer_rao_bound, root_trace
from tagtrack.eval.field.static_array.model import ArraySetting, Floats
from tagtrack.eval.plots import COLOURS, FAINT, INK, empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEVELS = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0)  # [m]
REACH = 1.5  # baselines from the middle to the edge of a map
MAP_POINTS = 121
PRINTED_SECONDS = {"wls": 5e-3, "pf": 0.977}  # per position, the paper's text on Fig. 2E
MARKERS = "osD^vPX*<>"


def plot_bound(scene: Scene, baseline: float, sigma: float) -> Figure:
    """Maps of the bound for the paper's arrays (Figs. 2A and S1), and the trajectory (Fig. 2B).

    Twice the paper's: its Eq. 15 counts the six differences of four arrivals, each of ``sigma``, as independent.
    """
    from matplotlib.colors import BoundaryNorm

    figure, panels = empty_figure(width=11.5, height=7.6, rows=2, columns=3, shared=True)
    axis = baseline * np.linspace(-REACH, REACH, MAP_POINTS)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1)
    setting = ArraySetting(sound_speed=scene.sound_speed, sigma=sigma)
    look: dict[str, Any] = {"cmap": "viridis_r", "norm": BoundaryNorm(LEVELS, 256, extend="both"), "extend": "both"}
    for axes, name in zip(panels, ARRAYS, strict=False):
        receivers = place_receivers(name, baseline)
        least = np.minimum(root_trace(cramer_rao_bound(grid, receivers, setting)), 1e3)
        axes.contourf(axis, axis, least, levels=LEVELS, **look)
        axes.plot(*receivers.T, "x", color=COLOURS[1], mew=2, ms=8)
        axes.set_title(f"{len(receivers)} receivers, {name}", fontsize=10, color=INK)
        axes.set(aspect="equal")
    figure.colorbar(panels[0].collections[0], ax=panels, label=f"bound for {1e3 * sigma:g} ms [m]", shrink=0.8, format="{x:g}")
    axes = panels[-1]
    axes.plot(*scene.position.T, ".-", color=COLOURS[0], lw=1.2, ms=4)
    axes.plot(*scene.position[0], "o", color=COLOURS[0], mfc="white", mew=1.6, ms=7)
    axes.plot(*scene.receivers.T, "x", color=COLOURS[1], mew=2, ms=8)
    axes.set_title("trajectory, a dot for each ping", fontsize=10, color=INK)
    axes.set(aspect="equal", xlim=(axis[0], axis[-1]), ylim=(axis[0], axis[-1]))
    for index, axes in enumerate(panels):
        if index >= 3:
            axes.set_xlabel("x [m]")
        if index % 3 == 0:
            axes.set_ylabel("y [m]")
    return figure


def plot_rmse(document: Mapping[str, Any]) -> Figure:
    """RMSE by noise and method inside and outside the array, median and 5-95 % of the runs (Fig. 2D)."""
    figure, panels = empty_figure(width=11.5, height=4.6, columns=2)
    noises = document["noises"]
    names = list(noises[0]["methods"])
    group = np.arange(len(noises))
    for axes, place in zip(panels, PLACES, strict=True):
        for index, name in enumerate(names):
            figures = [noise["methods"][name][f"rmse_{place}_m"] for noise in noises]
            value, low, high = np.array([[f["value"], f["low"], f["high"]] for f in figures], dtype=np.float64).T
            offset = (index - (len(names) - 1) / 2) * 0.8 / len(names)
            colour, marker = COLOURS[index % len(COLOURS)], MARKERS[index % len(MARKERS)]
            reach = [value - low, high - value]
            axes.errorbar(group + offset, value, reach, fmt=marker, color=colour, ms=5, elinewidth=1.2, label=name)
        for place_on_axis, noise in zip(group, noises, strict=True):
            bound = noise[f"bound_{place}_m"]
            if bound is not None:
                label = "bound" if place_on_axis == 0 else "_"
                axes.hlines(bound, place_on_axis - 0.45, place_on_axis + 0.45, color=INK, lw=1.4, ls="--", label=label)
        axes.set_xticks(group, [noise["label"] for noise in noises])
        _log_rmse(axes)
        axes.set(title=f"{place} the array")
        axes.grid(visible=False, axis="x")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", frameon=False)
    return figure


def plot_rmse_over_time(scene: Scene, found: Mapping[Noise, Mapping[str, Outcome]]) -> Figure:
    """RMSE of the runs at each ping beside the bound, a panel for each noise; grey: inside the array (Figs. 2C and S2)."""
    figure, panels = empty_figure(width=11.5, height=1.0 + 2.6 * len(found), rows=len(found))
    minutes = np.arange(len(scene.position)) * scene.delay / 60
    for axes, (noise, outcomes) in zip(panels, found.items(), strict=True):
        for index, (name, outcome) in enumerate(outcomes.items()):
            colour, style = COLOURS[index % len(COLOURS)], ("-", "--", ":")[index // len(COLOURS) % 3]
            axes.plot(minutes, _over_runs(outcome.error), color=colour, ls=style, lw=1.3, label=name)
        axes.plot(minutes, bound_of_pings(scene, noise), color=INK, lw=1.6, ls="--", label="bound")
        inside = np.where(scene.inside, 1.0, 0.0)
        axes.fill_between(minutes, inside, step="mid", color=FAINT, alpha=0.18, lw=0, transform=axes.get_xaxis_transform())
        _log_rmse(axes)
        axes.set(xlim=(minutes[0], minutes[-1]))
        axes.set_title(noise.label, fontsize=10, color=INK)
    panels[-1].set_xlabel("time [min]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False)
    return figure


def plot_time(seconds: Mapping[str, float]) -> Figure:
    """Time per position by method, beside those that the paper prints (Fig. 2E)."""
    figure, (axes,) = empty_figure(width=7.5, height=1.2 + 0.4 * len(seconds))
    place = np.arange(len(seconds))
    axes.barh(place, [1e3 * value for value in seconds.values()], color=COLOURS[0], height=0.6, label="here")
    printed = [(index, 1e3 * PRINTED_SECONDS[name]) for index, name in enumerate(seconds) if name in PRINTED_SECONDS]
    if printed:
        where, value = zip(*printed, strict=True)
        axes.plot(value, where, "D", color=COLOURS[1], ms=6, label="Masmitja et al. 2020")
    for index, ms in enumerate(1e3 * np.array(list(seconds.values()))):
        axes.annotate(f"{ms:.2g} ms", (ms, index), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8)
    axes.set_yticks(place, list(seconds))
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="processor time per position [ms]")
    axes.margins(x=0.15)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(visible=False, axis="y")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


def _log_rmse(axes: Axes) -> None:
    """A logarithmic axis that names 1, 2 and 5 of each decade."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axes.set(yscale="log", ylabel="RMSE [m]")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def _over_runs(error: Floats) -> Floats:
    """(K,) root mean square over the runs that gave a position; NaN where none did."""
    located = np.isfinite(error).sum(axis=0)
    return np.sqrt(np.nansum(error**2, axis=0) / np.where(located, located, np.nan))
