"""`tagtrack live range-test`: how many pings are heard from how far, before a mission relies on it."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tagtrack.live.mission_log import read_log
from tagtrack.live.replay import Reference, read_reference

OWN_FILES = ("range_test.json", "range_test.png")
LEAST_EXPECTED = 30  # pings, for a curve
LEAST_SPREAD = 0.3  # of distances, as a share of the largest: a tag that stays where it is tells of no curve
MOST_INTERVALS = 10_000_000
MOST_BINS = 1000
Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Trials:
    """One for each ping that is expected: how far the tag was, and whether it was heard."""

    distance: Floats  # (K,) [m]
    heard: NDArray[np.bool_]  # (K,)


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Chance = near / (1 + exp((distance - reach) / width)), as ``Water`` has it."""

    near: float
    reach: float  # [m]
    width: float  # [m]

    def at(self, distance: Floats) -> Floats:
        return self.near / (1.0 + np.exp(np.clip((distance - self.reach) / self.width, -50.0, 50.0)))


def collect_trials(platforms: Sequence[tuple[Floats, Floats, Floats]], tag: str, reference: Reference, interval: float) -> Trials:
    """Cut the time for which both platform and tag are known into intervals: each holds a ping, and it was heard or not.

    Args:
        platforms: times (N,) and places (N, 2) [m] of each receiver, and the times (M,) at which it heard the tag [s].
        interval: mean time from one ping to the next [s].
    """
    if not (math.isfinite(interval) and interval > 0):
        raise ValueError(f"--interval must be a positive number of seconds, got {interval}")
    distances, heard = [], []
    for times, places, pings in platforms:
        if (times[-1] - times[0]) / interval > MOST_INTERVALS:
            raise ValueError(f"--interval {interval:g} s makes more than {MOST_INTERVALS:,} intervals; are the times in seconds?")
        edges = np.arange(times[0], times[-1] + 0.5 * interval, interval)
        if edges.size < 2:
            continue
        middle = 0.5 * (edges[1:] + edges[:-1])
        own = np.stack([np.interp(middle, times, places[:, axis]) for axis in (0, 1)], axis=1)
        away = np.linalg.norm(reference.at(tag, middle) - own, axis=1)
        count = np.histogram(pings, edges)[0]
        known = np.isfinite(away)
        distances.append(away[known])
        heard.append(count[known] > 0)
    if not distances or not sum(map(len, distances)):
        raise ValueError("there is no time for which both the receiver and the tag's place are known; are both clocks the same?")
    return Trials(distance=np.concatenate(distances), heard=np.concatenate(heard))


def count_by_distance(trials: Trials, width: float) -> list[dict[str, float]]:
    """Expected and heard pings, share and its 95 % interval (Wilson 1927) in bins of distance."""
    rows = []
    if trials.distance.max() / width > MOST_BINS:
        raise ValueError(f"--bin {width:g} makes over {MOST_BINS} bins up to {trials.distance.max():.0f} m; choose a wider one")
    place = np.floor(trials.distance / width).astype(int)
    for number in np.unique(place):
        chosen = place == number
        n, k = int(chosen.sum()), int(trials.heard[chosen].sum())
        low, high = wilson(k, n)
        rows.append({"from_m": number * width, "to_m": (number + 1) * width, "expected": n, "heard": k, "share": k / n,
                     "low": low, "high": high})  # fmt: skip
    return rows


def wilson(heard: int, expected: int, z: float = 1.959964) -> tuple[float, float]:
    """The score interval of a share."""
    share, n = heard / expected, float(expected)
    middle = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def fit_curve(trials: Trials) -> Curve:
    """The curve of largest likelihood. Raises ValueError for too few pings, or where all or none were heard."""
    from scipy.optimize import minimize

    if len(trials.heard) < LEAST_EXPECTED:
        raise ValueError(f"a curve needs at least {LEAST_EXPECTED} expected pings, got {len(trials.heard)}; test for longer")
    if trials.heard.all() or not trials.heard.any():
        what, advice = ("all", "further off") if trials.heard.all() else ("none", "nearer")
        raise ValueError(f"{what} of {len(trials.heard)} expected pings were heard: go {advice}")
    farthest = float(trials.distance.max())
    near, far = np.quantile(trials.distance, (0.02, 0.98))
    if far - near < LEAST_SPREAD * far:
        raise ValueError(f"the tag stayed between {near:.0f} and {far:.0f} m, which tells of no curve; tow it past the receiver")

    def cost(x: Floats) -> float:
        chance = np.clip(_curve_of(x).at(trials.distance), 1e-9, 1.0 - 1e-9)
        return -float(np.where(trials.heard, np.log(chance), np.log1p(-chance)).sum())

    starts = [np.array([1.0, math.log(share * farthest), math.log(0.1 * farthest)]) for share in (0.3, 0.6, 1.0)]
    bounds = [(-6.0, 6.0), (0.0, math.log(3.0 * farthest)), (math.log(1.0), math.log(3.0 * farthest))]
    found = [minimize(cost, start, method="L-BFGS-B", bounds=bounds) for start in starts]
    return _curve_of(min(found, key=lambda result: float(result.fun)).x)


def _curve_of(x: Floats) -> Curve:
    return Curve(near=1.0 / (1.0 + math.exp(-float(x[0]))), reach=math.exp(float(x[1])), width=math.exp(float(x[2])))


def as_overrides(curve: Curve) -> str:
    """The water of a scenario in which pings are heard like this."""
    return (
        f"water.reach={curve.reach:.4g} water.edge_width={curve.width:.4g} water.clear_hearing={curve.near:.3g} "
        "water.noisy_share=0"
    )


def run(options: argparse.Namespace) -> None:
    """The command."""
    from tagtrack.eval.report import as_console_table, show
    from tagtrack.eval.results_folder import replace_results, require_replaceable

    out = Path(options.out) if options.out else None
    if out is not None:
        require_replaceable(out, OWN_FILES, "range test")
    if not (math.isfinite(options.bin) and options.bin > 0):
        raise ValueError(f"--bin must be a positive number of metres, got {options.bin}")
    reference = read_reference(Path(options.reference))
    if reference.in_degrees:
        raise ValueError(f"{options.reference} has lon,lat, and a range test takes metres; convert it first")
    platforms, tag = _moored(options) if options.detections else _aboard(options)
    trials = collect_trials(platforms, tag, reference, options.interval)
    rows = count_by_distance(trials, options.bin)
    table = [
        [f"{row['from_m']:g} to {row['to_m']:g}", f"{row['expected']}", f"{row['heard']}",
         f"{100 * row['share']:.0f} [{100 * row['low']:.0f}, {100 * row['high']:.0f}]"]
        for row in rows
    ]  # fmt: skip
    note = f"Tag {tag}: a ping is expected each {options.interval:g} s; in brackets 95 % intervals, pings taken as independent."
    show(as_console_table(["distance [m]", "expected", "heard", "share [%]"], table, note))
    curve = fit_curve(trials)
    print(f"chance {curve.near:.2f} near by, half of it at {curve.reach:.0f} m, falling over {curve.width:.0f} m")
    print(f"as a scenario: --set {as_overrides(curve)}")
    if out is not None:
        document: dict[str, Any] = {
            "tag": tag, "interval_s": options.interval, "bins": rows, "overrides": as_overrides(curve),
            "curve": {"near": curve.near, "reach_m": curve.reach, "width_m": curve.width},
        }  # fmt: skip
        with replace_results(out, OWN_FILES) as folder:
            (folder / "range_test.json").write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
            plot_reception(folder / "range_test.png", rows, curve, f"tag {tag}")
        print(f"written: {out}")


def _aboard(options: argparse.Namespace) -> tuple[list[tuple[Floats, Floats, Floats]], str]:
    """The receiver of a vehicle, or a buoy, whose log this is."""
    if not options.log:
        raise ValueError("name a log (--log nav.csv pings.csv) or moored receivers (--detections FILE --receivers FILE)")
    log = read_log(options.log)
    if log.in_degrees:
        raise ValueError("a range test takes x,y in metres; convert the log's lon,lat first")
    tag = _choose(options.tag, log.tags)
    times = np.array([fix.t for fix in log.navigation])
    places = np.array([[fix.x, fix.y] for fix in log.navigation])
    pings = np.array([reading.t for reading in log.readings if reading.tag == tag and reading.heard])
    return [(times, places, pings)], tag


def _moored(options: argparse.Namespace) -> tuple[list[tuple[Floats, Floats, Floats]], str]:
    """Receivers on moorings, from the first to the last detection of any of them."""
    from tagtrack.eval.field.telemetry import read_receivers, read_telemetry

    if not options.receivers:
        raise ValueError("--detections needs --receivers FILE: receiver,x,y of each")
    found = read_telemetry([Path(options.detections)]).detections
    places = read_receivers(options.receivers)
    tag = _choose(options.tag, found.tags)
    own = found.tag == found.tags.index(tag)
    span = np.array([found.time[own].min(), found.time[own].max()])
    platforms = []
    for name, place in zip(places.names, places.position, strict=True):
        heard = own & (found.receiver == found.receivers.index(name)) if name in found.receivers else np.zeros_like(own)
        platforms.append((span, np.stack([place, place]), found.time[heard]))
    return platforms, tag


def _choose(wanted: str | None, tags: Sequence[str]) -> str:
    if wanted is None and len(tags) == 1:
        return tags[0]
    listed = ", ".join(tags) or "none"
    if wanted is None:
        raise ValueError(f"choose a tag by --tag; the log has {listed}")
    if wanted not in tags:
        raise ValueError(f"tag {wanted} is not in the log; it has {listed}")
    return wanted


def plot_reception(path: Path, rows: Sequence[dict[str, float]], curve: Curve, title: str) -> None:
    """Shares with their intervals, and the curve."""
    from matplotlib.figure import Figure

    from tagtrack.eval.plots import COLOURS, INK, save_figure

    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.subplots()
    middle = np.array([0.5 * (row["from_m"] + row["to_m"]) for row in rows])
    share = np.array([row["share"] for row in rows])
    error = np.array([[row["share"] - row["low"], row["high"] - row["share"]] for row in rows]).T
    error = 100 * np.maximum(error, 0.0)  # rounding leaves a little below 0 where all or none were heard
    axes.errorbar(middle, 100 * share, yerr=error, fmt="o", color=INK, markersize=4, linewidth=1, label="heard")
    distance = np.linspace(0.0, rows[-1]["to_m"], 400)
    axes.plot(distance, 100 * curve.at(distance), color=COLOURS[0], label=f"half at {curve.reach:.0f} m")
    for row in rows:
        axes.annotate(f"{row['expected']}", (0.5 * (row["from_m"] + row["to_m"]), 1.0), fontsize=7, ha="center", color="#777777")
    axes.set_xlabel("distance [m]")
    axes.set_ylabel("pings heard [%]")
    axes.set_ylim(0, 105)
    axes.set_xlim(0, None)
    axes.set_title(f"{title}; below: pings expected", fontsize=10)
    axes.legend(fontsize=8)
    save_figure(path, figure)
