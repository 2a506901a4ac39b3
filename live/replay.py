"""`tagtrack live replay`: the log of a mission through the filter, once more or with others."""

from __future__ import annotations

import argparse
import csv
import io
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.envs.belief.assumptions import BELIEFS
from tagtrack.envs.csv_table import name_cell, open_csv
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.task import Task, build_task, parse_overrides
from tagtrack.envs.validation import unknown
from tagtrack.live.calibrated import RangeFinder, read_range_finder
from tagtrack.live.conventions import Conventions
from tagtrack.live.journal import JOURNAL_FILE
from tagtrack.live.journal_log import find_journal, read_journal, tell_journal
from tagtrack.live.mission_log import MissionLog, Reading, read_log
from tagtrack.live.recording import MISSION_FILE, NAVIGATION_FILE, READINGS_FILE, REFERENCE_FILE
from tagtrack.live.tracker import SYNONYMS, Tracker

OWN_FILES = ("estimates.csv", "summary.json", "map.png", "comparison.md")
COLUMNS = ("t", "tag", "x", "y", "sd_x", "sd_y", "cov_xy", "best_x", "best_y", "heard")
SIGMAS = (1, 2, 3)
HONEST = {k: 1.0 - math.exp(-0.5 * k * k) for k in SIGMAS}  # share within k sigmas of a Gaussian belief in the plane


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A log, and what its filter is to know."""

    log: MissionLog
    task: Task
    tags: tuple[str, ...]
    conventions: Conventions
    depths: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    episode: int = 0
    range_finder: RangeFinder | None = None

    def track(self, task: Task | None = None, *, seed: int | None = None) -> Replayed:
        """Let the filter of the task, or of another, go through the log."""
        task = task or self.task
        span = self.log.navigation[-1].t - self.log.navigation[0].t
        tracker = Tracker(
            task,
            tags=self.tags,
            conventions=self.conventions,
            depths=self.depths,
            seed=self.seed if seed is None else seed,
            episode=self.episode,
            late=0.0,
            stale=max(span, 5.0),
        )
        rows: list[list[Any]] = []
        begun = time.perf_counter()
        waiting = iter(self._readings())
        reading = next(waiting, None)
        for k, fix in enumerate(self.log.navigation):
            while reading is not None and reading.t <= fix.t:
                self._hear(tracker, reading)
                reading = next(waiting, None)
            try:
                tracker.navigate(fix.t, fix.x, fix.y, fix.heading, fix.speed)
            except ValueError as error:
                reason = f"navigation at t={fix.t:.12g}: {str(error).partition('; begin')[0]}"
                raise ValueError(f"{reason}; are times in seconds? else divide the log there") from None
            if k + 1 == len(self.log.navigation):
                while reading is not None:
                    self._hear(tracker, reading)
                    reading = next(waiting, None)
            for estimate in tracker.estimates(fix.t):
                sd_x, sd_y = np.sqrt(np.diagonal(estimate.covariance)).tolist()
                rows.append(
                    [fix.t, estimate.tag, estimate.x, estimate.y, sd_x, sd_y, float(estimate.covariance[0, 1]), estimate.best_x,
                     estimate.best_y, estimate.heard]
                )  # fmt: skip
        counts = dict(tracker.counts)
        if tracker.waiting:
            counts["after the last navigation"] = tracker.waiting
        return Replayed(rows=rows, counts=counts, seconds=time.perf_counter() - begun)

    def _readings(self) -> Iterator[Reading]:
        for reading in self.log.readings:
            if reading.tag in self.tags:
                yield reading

    def _hear(self, tracker: Tracker, reading: Reading) -> None:
        values = dict(reading.values)
        if self.range_finder is not None and reading.heard:
            arrival = reading.t if reading.arrival is None else reading.arrival
            values["range"] = self.range_finder.range_of(reading.tag, arrival)
        names = tracker.task.scenario.belief.receiver.readings
        known = {name: value for name, value in values.items() if SYNONYMS.get(name, name) in names}
        try:
            tracker.hear(reading.t, reading.tag, heard=reading.heard, arrival=reading.arrival, depth=reading.depth, **known)
        except ValueError as error:
            raise ValueError(f"reading at t={reading.t:.12g}: {error}") from None


@dataclass(frozen=True, kw_only=True)
class Replayed:
    """What a filter made of a log."""

    rows: list[list[Any]]  # as COLUMNS
    counts: dict[str, int]
    seconds: float

    def of(self, tag: str) -> dict[str, np.ndarray]:
        """Columns of one tag as arrays."""
        chosen = [row for row in self.rows if row[1] == tag]
        return {name: np.array([row[k] for row in chosen], float) for k, name in enumerate(COLUMNS) if name != "tag"}


def read_mission(options: argparse.Namespace) -> Mission:
    """The mission that a command line names."""
    if options.seed is not None and not 0 <= options.seed < 2**63:
        raise ValueError(f"--seed must be from 0 to {2**63 - 1}, got {options.seed}")
    journal = find_journal(options.log)
    paths, told = ([], tell_journal(journal)) if journal is not None else _log_files(options.log)
    env = options.env or told.get("env")
    if env is None:
        raise ValueError("say which task's filter to use: --env LeopardShark-v0 (bearings), RangeOnly-v0, AreaOnly-v0 ...")
    own = told if options.env in (None, told.get("env")) else {}  # what was recorded of another task does not fit
    overrides = {**own.get("overrides", {}), **parse_overrides([text for group in options.set for text in group], None)}
    if options.filter is not None:
        overrides["belief"] = options.filter
    particles = own.get("particles") if options.particles is None else options.particles
    task = build_task(env, preset=own.get("preset"), overrides=overrides, particles=particles)
    names = task.scenario.belief.receiver.readings
    log = read_log(paths, names) if journal is None else read_journal(journal)
    tags = _choose_tags(options.tags or told.get("tags"), log, asked=options.tags is not None)
    return Mission(
        log=log,
        task=task._replace(scenario=with_overrides(task.scenario, {"targets": len(tags)})),
        tags=tags,
        conventions=_conventions(options, log),
        depths={tag: depth for tag, depth in told.get("depths", {}).items() if tag in tags},
        seed=own.get("seed", 0) if options.seed is None else options.seed,
        episode=own.get("episode", 0) if options.seed is None else 0,
        range_finder=None if options.calibration is None else read_range_finder(options.calibration),
    )


def _log_files(given: Sequence[str]) -> tuple[list[Path], dict[str, Any]]:
    """Files of a log; of a folder that was recorded those in it, and what it says of itself."""
    if len(given) == 1 and Path(given[0]).is_dir():
        folder = Path(given[0])
        if not (folder / MISSION_FILE).is_file():
            raise FileNotFoundError(f"{folder} holds neither {MISSION_FILE} nor {JOURNAL_FILE}; name the log's files")
        try:
            told = json.loads((folder / MISSION_FILE).read_text(encoding="utf-8"))
            require_mission(told)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"{folder / MISSION_FILE} is damaged ({error}); record the mission again") from None
        return [folder / NAVIGATION_FILE, folder / READINGS_FILE], told
    return [Path(path) for path in given], {}


def require_mission(told: Any) -> None:
    """Raise ValueError unless this is what a recorder writes."""
    if not isinstance(told, dict):
        raise ValueError("it is no object")
    whole = lambda value: type(value) is int and value >= 0  # noqa: E731
    tests = {
        "env": lambda value: isinstance(value, str),
        "preset": lambda value: value is None or isinstance(value, str),
        "overrides": lambda value: isinstance(value, dict),
        "tags": lambda value: isinstance(value, list) and value and all(isinstance(tag, str) for tag in value),
        "depths": lambda value: isinstance(value, dict) and all(type(depth) in (int, float) for depth in value.values()),
        "particles": whole,
        "seed": whole,
        "episode": whole,
    }
    for name, holds in tests.items():
        if name not in told or not holds(told[name]):
            raise ValueError(f"{name} is {told.get(name)!r:.60}")


def _choose_tags(wanted: Sequence[str] | None, log: MissionLog, *, asked: bool) -> tuple[str, ...]:
    heard = log.tags
    if wanted is None:
        if not heard:
            raise ValueError("the log holds no reading; name the tags that were sought: --tags NAME ...")
        return heard
    if asked and (strange := [tag for tag in wanted if tag not in heard]):
        raise ValueError(f"tag {strange[0]} is not in this mission; the log has {', '.join(heard) or 'none'}")
    return tuple(wanted)


def _conventions(options: argparse.Namespace, log: MissionLog) -> Conventions:
    origin = tuple(options.origin) if options.origin else None
    if log.in_degrees and origin is None:
        first = log.navigation[0]
        origin = (first.x, first.y)
    if not log.in_degrees and origin is not None:
        raise ValueError("--origin is for logs with lon,lat; this one has x,y in metres")
    return Conventions(
        headings=options.headings or log.conventions.get("headings", "nautical"),
        speeds=options.speeds or log.conventions.get("speeds", "m/s"),
        origin=origin,  # type: ignore[arg-type]
    )


@dataclass(frozen=True)
class Reference:
    """Where the tags truly were, by tag; "" for all."""

    tracks: Mapping[str, tuple[np.ndarray, np.ndarray]]  # times (K,), places (K, 2) in the log's units
    in_degrees: bool

    def at(self, tag: str, t: np.ndarray) -> np.ndarray:
        """(len(t), 2) places, NaN where the track does not reach."""
        if tag not in self.tracks and "" not in self.tracks:
            return np.full((len(t), 2), np.nan)
        times, places = self.tracks.get(tag) or self.tracks[""]
        return np.stack([np.interp(t, times, places[:, k], left=np.nan, right=np.nan) for k in (0, 1)], axis=1)


def read_reference(path: Path) -> Reference:
    """A csv with t (or t_unix_s), x, y (or lon, lat) and, of several tags, tag. Raises ValueError where it is none."""
    rows: dict[str, list[tuple[float, float, float]]] = {}
    with open_csv(path, "reference track", ("t", "x", "y")) as table:
        axes = ("lon", "lat") if {"lon", "lat"} <= set(table.columns) else ("x", "y")
        clock = "t_unix_s" if "t_unix_s" in table.columns and "t" not in table.columns else "t"
        tagged = "tag" in table.columns
        for row in table.rows((clock, *axes, *(("tag",) if tagged else ()))):
            rows.setdefault(row.name("tag") if tagged else "", []).append(
                (row.number(clock), row.number(axes[0]), row.number(axes[1]))
            )
    if not rows:
        raise ValueError(f"{path} holds no row; a reference needs t,{axes[0]},{axes[1]}")
    tracks = {}
    for tag, points in rows.items():
        array = np.array(sorted(points))
        tracks[tag] = (array[:, 0], array[:, 1:])
    return Reference(tracks, axes == ("lon", "lat"))


def judge(replayed: Replayed, mission: Mission, reference: Reference) -> dict[str, dict[str, float]]:
    """By tag: errors [m] of what the filter reports, how often the truth lay within 1, 2 and 3 sigmas, and the NEES."""
    from tagtrack.eval.consistency import normalized_error_squared

    found = {}
    for tag in mission.tags:
        columns = replayed.of(tag)
        truth = _in_metres(reference.at(tag, columns["t"]), mission.conventions)
        best = _in_metres(np.stack([columns["best_x"], columns["best_y"]], axis=1), mission.conventions)
        mean = _in_metres(np.stack([columns["x"], columns["y"]], axis=1), mission.conventions)
        known = np.isfinite(truth).all(axis=1)
        if not known.any():
            continue
        error = np.linalg.norm(best - truth, axis=1)[known]
        covariance = np.stack(
            [columns["sd_x"] ** 2, columns["cov_xy"], columns["cov_xy"], columns["sd_y"] ** 2], axis=1
        ).reshape(-1, 2, 2)
        normalized = normalized_error_squared((mean - truth)[known], covariance[known])
        found[tag] = {
            "rows": int(known.sum()),
            "mean_error_m": float(error.mean()),
            "median_error_m": float(np.median(error)),
            "rmse_m": float(np.sqrt((error**2).mean())),
            **{f"within_{k}_sigma": float((normalized <= k * k).mean()) for k in SIGMAS},
            "nees": float(normalized.mean()),
        }
    return found


def _in_metres(places: np.ndarray, conventions: Conventions) -> np.ndarray:
    if conventions.origin is None:
        return places
    known = np.isfinite(places).all(axis=1)
    metres = np.full(places.shape, np.nan)
    metres[known] = [conventions.place_in(*map(float, place)) for place in places[known]]
    return metres


def summarize_mission(mission: Mission, replayed: Replayed, errors: Mapping[str, Mapping[str, float]] | None) -> dict[str, Any]:
    """What summary.json holds."""
    log = mission.log
    tags = {}
    for tag in mission.tags:
        pings = [reading for reading in log.readings if reading.tag == tag]
        columns = replayed.of(tag)
        tags[tag] = {
            "heard": sum(reading.heard for reading in pings),
            "not_answered": sum(not reading.heard for reading in pings),
            "last": {name: float(columns[name][-1]) for name in ("t", "x", "y", "sd_x", "sd_y")},
            "mean_sd_x": float(columns["sd_x"].mean()),
            "mean_sd_y": float(columns["sd_y"].mean()),
            **({"against_reference": errors[tag]} if errors and tag in errors else {}),
        }
    others = sorted({reading.tag for reading in log.readings} - set(mission.tags))
    return {
        "env": mission.task.env_id,
        "particles": mission.task.scenario.belief.particles,
        "seed": mission.seed,
        "conventions": mission.conventions.to_json(),
        "from_s": log.navigation[0].t,
        "to_s": log.navigation[-1].t,
        "navigation_rows": len(log.navigation),
        "rows_out_of_order": log.disordered,
        "rows_doubled": log.doubled,
        "readings_dropped": replayed.counts,
        "other_tags": others,
        "seconds": round(replayed.seconds, 3),
        "tags": tags,
    }


def write_estimates(path: Path, replayed: Replayed) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for t, tag, *figures in replayed.rows:
        numbers = ("" if isinstance(value, float) and math.isnan(value) else value for value in figures)
        writer.writerow([t, name_cell(tag), *numbers])
    path.write_text(text.getvalue(), encoding="utf-8")


def compare_filters(mission: Mission, names: Sequence[str], seeds: int, reference: Reference | None) -> list[list[str]]:
    """A row for each filter: errors and sigmas, means over tags and seeds; of the first column the standard deviation, too."""
    rows = []
    for name in names:
        task = _with_belief(mission.task, name)
        figures = []
        for seed in range(mission.seed, mission.seed + seeds):
            replayed = mission.track(task, seed=seed)
            columns = [replayed.of(tag) for tag in mission.tags]
            spread = [float(np.mean([each[axis].mean() for each in columns])) for axis in ("sd_x", "sd_y")]
            judged = list(judge(replayed, mission, reference).values()) if reference else []
            keys = ("mean_error_m", "median_error_m", *(f"within_{k}_sigma" for k in SIGMAS), "nees")
            figures.append([*(float(np.mean([each[key] for each in judged])) for key in keys if judged), *spread])
        middle, over_seeds = np.mean(figures, axis=0), np.std(figures, axis=0)
        shares = range(2, 5) if reference else range(0)
        cells = [f"{100 * figure:.0f}" if k in shares else f"{figure:.3g}" for k, figure in enumerate(middle)]
        cells[0] += f" +- {over_seeds[0]:.2g}"
        rows.append([name, *cells])
    return rows


def _with_belief(task: Task, name: str) -> Task:
    particles = task.scenario.belief.particles
    return task._replace(scenario=with_overrides(task.scenario, {"belief": name, "belief.particles": particles}))


def comparison_header(reference: bool) -> list[str]:
    judged = ["error [m]", "median", *(f"in {k} s" for k in SIGMAS), "NEES"] if reference else []
    return ["filter", *judged, "sd x", "sd y"]


def run(options: argparse.Namespace) -> None:
    """The command."""
    from tagtrack.eval.report import as_console_table, as_markdown, show
    from tagtrack.eval.results_folder import replace_results, require_replaceable
    from tagtrack.live.map import plot_mission

    out = Path(options.out)
    require_replaceable(out, OWN_FILES, "replay")
    mission = read_mission(options)
    reference = _find_reference(options)
    if reference is not None and reference.in_degrees != mission.log.in_degrees:
        has, other = ("lon,lat", "x,y") if reference.in_degrees else ("x,y", "lon,lat")
        raise ValueError(f"--reference {options.reference} has {has}, the log {other}; give both in one kind")
    for name in options.compare or ():
        if name not in BELIEFS:
            raise unknown("filter", name, BELIEFS)
    if options.seeds < 1:
        raise ValueError(f"--seeds must be at least 1, got {options.seeds}")
    replayed = mission.track()
    errors = judge(replayed, mission, reference) if reference else None
    if reference is not None and not errors:
        raise ValueError(f"--reference {options.reference} has no time in common with the log; are both clocks the same?")
    summary = summarize_mission(mission, replayed, errors)
    table = None
    if options.compare:
        table = (
            comparison_header(reference is not None),
            compare_filters(mission, options.compare, options.seeds, reference),
            comparison_note(options.seeds, reference is not None),
        )
    with replace_results(out, OWN_FILES) as folder:
        write_estimates(folder / "estimates.csv", replayed)
        (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        plot_mission(folder / "map.png", mission, replayed, reference)
        if table is not None:
            (folder / "comparison.md").write_text(as_markdown(*table), encoding="utf-8")
    tell(summary)
    if table is not None:
        show(as_console_table(*table))
    print(f"written: {out}")


def comparison_note(seeds: int, judged: bool) -> str:
    """What stands below the comparison of filters."""
    note = f"Means over {seeds} seeds +- standard deviation over them, metres."
    if not judged:
        return note
    honest = ", ".join(f"{100 * share:.0f}" for share in HONEST.values())
    return (
        f"{note} In k s: share of time [%] that the reference lay within k sigmas; honest beliefs have {honest} and a NEES "
        "(normalized error squared) of 2."
    )


def _find_reference(options: argparse.Namespace) -> Reference | None:
    if options.reference is not None:
        return read_reference(Path(options.reference))
    recorded = Path(options.log[0]) / REFERENCE_FILE
    return read_reference(recorded) if len(options.log) == 1 and recorded.is_file() else None


def tell(summary: Mapping[str, Any]) -> None:
    """A few lines for people."""
    if summary["rows_out_of_order"]:
        count = summary["rows_out_of_order"]
        print(f"{count} rows stood after a later one and were sorted; if a clock was reset there, divide the log")
    for name, count in summary["readings_dropped"].items():
        print(f"{count} readings were dropped: {name}")
    if summary["other_tags"]:
        print(f"left out, not among --tags: {', '.join(summary['other_tags'])}")
    for tag, row in summary["tags"].items():
        last = row["last"]
        text = f"tag {tag}: heard {row['heard']} times, at last {last['x']:.7g}, {last['y']:.7g}"
        text += f" +- {last['sd_x']:.3g}, {last['sd_y']:.3g} m"
        if "against_reference" in row:
            judged = row["against_reference"]
            shares = ", ".join(f"{100 * judged[f'within_{k}_sigma']:.0f} %" for k in SIGMAS)
            text += f"; mean error {judged['mean_error_m']:.3g} m, within 1, 2, 3 sigma {shares}, NEES {judged['nees']:.3g}"
        print(text)
