"""Masmitja et al. 2020, Tables 1 and S1: where time differences put five moored tags, from the campaign's own detections.

No simulation: the public part of the field data, if the folder is named. Its times are corrected for drift by the authors and
rounded to 10 ms, so a position is made of a hundred pings where the paper may have taken each.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from tagtrack.eval.field.static_array.averaging import Blocks, average_pings, number_by_count
from tagtrack.eval.field.static_array.matching import array_window, match_pings, remove_impossible
from tagtrack.eval.field.static_array.model import ArraySetting, Floats
from tagtrack.eval.field.static_array.noise import estimate_sigma
from tagtrack.eval.field.static_array.registry import METHODS
from tagtrack.eval.field.telemetry import read_detections
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size
from tagtrack.eval.papers.printed import MASMITJA2020_POSITION_2, MASMITJA2020_TABLE_1, MASMITJA2020_TABLE_S1

PAPER = "masmitja2020"
SOUND_SPEED = 1500.0  # of the authors' localization; the distances between receivers are at 1512 m/s
AVERAGED = 100  # pings to a position
SYSTEMATIC = 1e-3  # of clocks and places, which averaging does not remove [s]
RESTING = 1e-9  # random acceleration [m/s^1.5] and first speed [m/s] of a tag that MAP-M and PF are told is moored
BOOTSTRAPS = 1000
LABELS = {"pf": "PF", "map_m": "MAP-M", "ml": "ML", "wls": "WLS", "wls_ml": "WLS-ML"}

NOTE_1 = (
    f"Field data, June and July; a position for each {AVERAGED} pings that three receivers heard; in brackets 95 % of bootstraps "
    "over blocks of them, for neighbours hang together. Error and SD: of their distance from Position 1, by WLS-ML. D and E were "
    "heard by three receivers 160 and 432 times only, and their Positions 1 come from a rotation that was applied askew (0.7 m)."
)
NOTE_S1 = (
    "As Table 1; error: of the mean, from the paper's Position 2 (its own mean: 0.02 m is no distance from Position 1, which is "
    "half a metre away), SD: of the positions about their mean. The paper's ML, WLS and PF go astray at receivers; ours start "
    "from several places, take the cone's roots, and move the particles, so D and E come out, by PF "
    "to 3.5 m. MAP-M and PF know that tags rest."
)


@dataclass(frozen=True, kw_only=True)
class Mooring:
    """One of the five tags, with what was heard of it."""

    letter: str
    place: Floats  # (2,) Position 1 [m]
    blocks: Blocks
    setting: ArraySetting


def run_field(setting: Setting) -> Findings:
    """Tables 1 and S1; nothing without the data."""
    folder = setting.data / "resnep" if setting.data is not None else None
    if folder is None or not (folder / "sync_detections.csv.gz").is_file():
        setting.advance(len(LABELS))
        return Findings(rows=())
    moorings, receivers = read_moorings(folder)
    generator = np.random.default_rng(setting.seed)
    rows = []
    for method, label in LABELS.items():
        for mooring in moorings:
            position = locate_mooring(mooring, receivers, method)
            printed = MASMITJA2020_TABLE_S1[label]
            second = np.array(MASMITJA2020_POSITION_2[mooring.letter])
            make = partial(_bootstrap, position, generator, row=label, table="Table S1", note=NOTE_S1)
            rows.append(make(partial(_off, place=second), f"{mooring.letter} error", printed[f"{mooring.letter} error"]))
            rows.append(make(_scatter, f"{mooring.letter} SD", printed[f"{mooring.letter} SD"]))
            if method == "wls_ml":
                rows += _table_1(position, mooring, generator)
        setting.advance(1)
    return Findings(rows=sorted(rows, key=lambda row: len(row.table)))  # Table 1 before S1


def read_moorings(folder: Path) -> tuple[list[Mooring], Floats]:
    """The five tags, and the places of the four receivers (4, 2) [m]."""
    with (folder / "stations.csv").open(newline="", encoding="utf-8") as file:
        stations = list(csv.DictReader(file))
    place = {station["mooring"]: np.array([float(station[f"table1_position1_{axis}"]) for axis in "xy"]) for station in stations}
    detections = read_detections([folder / "sync_detections.csv.gz"])
    names = {station["receiver"]: station["mooring"] for station in stations if station["receiver"]}
    receivers = np.array([place[names[name]] for name in detections.receivers])
    moorings = []
    for station in stations:
        heard = detections.of_tag(station["sync_tag"])
        matched = match_pings(heard, array_window(receivers, SOUND_SPEED))
        pings = remove_impossible(matched, receivers, SOUND_SPEED).pings
        setting = ArraySetting(sound_speed=SOUND_SPEED, acceleration_sigma=RESTING, first_speed_sigma=RESTING)
        sigma = estimate_sigma(pings, receivers, setting) or setting.sigma
        blocks = average_pings(pings, number_by_count(pings, AVERAGED, 3), sigma, SYSTEMATIC)
        letter = station["mooring"]
        moorings.append(Mooring(letter=letter, place=place[letter], blocks=blocks, setting=setting))
    return moorings, receivers


def locate_mooring(mooring: Mooring, receivers: Floats, method: str) -> Floats:
    """Positions (K, 2) [m] of a tag by a method."""
    blocks = mooring.blocks
    found = METHODS[method](blocks.pings, receivers, mooring.setting, information=blocks.information).position
    return found[np.isfinite(found).all(axis=1)]


def _table_1(position: Floats, mooring: Mooring, generator: np.random.Generator) -> list[Row]:
    printed = MASMITJA2020_TABLE_1[mooring.letter]
    make = partial(_bootstrap, position, generator, row=mooring.letter, table="Table 1", note=NOTE_1)
    second = np.array(MASMITJA2020_POSITION_2[mooring.letter])
    return [
        make(partial(_distance, place=mooring.place), "Error", printed["Error"]),
        make(partial(_distance_sd, place=mooring.place), "SD", printed["SD"]),
        make(partial(_off, place=mooring.place), "mean to Position 1", float(np.linalg.norm(second - mooring.place))),
        make(partial(_off, place=second), "mean to Position 2", math.nan),
    ]


def _bootstrap(
    position: Floats,
    generator: np.random.Generator,
    figure: Callable[[Floats], float],
    column: str,
    printed: float,
    *,
    row: str,
    table: str,
    note: str,
) -> Row:
    """A figure of positions (K, 2), and where it lies in 95 % of resamples of blocks of them."""
    ours = low = high = math.nan  # where the method locates nothing
    if len(position):
        drawn = draw_blocks(len(position), block_length(position), generator)
        ours = figure(position)
        low, high = np.quantile([figure(position[rows]) for rows in drawn], (0.025, 0.975)).tolist()
    return Row(
        paper=PAPER,
        table=f"{table}, field data",
        row=row,
        column=column,
        paper_value=printed,
        ours=float(ours),
        low=low,
        high=high,
        unit="m",
        note=note,
        repeated=False,
    )


def block_length(position: Floats) -> int:
    """How many positions in a row (K, 2) hang together: twice their integrated autocorrelation time, at most a fifth of them."""
    count = len(position)
    about = position - position.mean(axis=0)
    lags = range(1, max(count // 3, 1))
    power = (about**2).sum()
    time = 1.0
    for lag in lags if power > 0 else ():
        alike = float((about[:-lag] * about[lag:]).sum() / power)
        if alike < 2.0 / math.sqrt(count):  # nothing but chance
            break
        time += 2.0 * alike
    return int(np.clip(math.ceil(2.0 * time) if time > 1.0 else 1, 1, max(count // 5, 1)))


def draw_blocks(count: int, length: int, generator: np.random.Generator) -> np.ndarray:
    """(BOOTSTRAPS, count) rows drawn in blocks of a length, round the end (circular block bootstrap, Politis and Romano 1992)."""
    blocks = -(-count // length)
    start = generator.integers(0, count, (BOOTSTRAPS, blocks, 1))
    return np.asarray(((start + np.arange(length)) % count).reshape(BOOTSTRAPS, -1)[:, :count])


def _off(position: Floats, place: Floats) -> float:
    return float(np.linalg.norm(position.mean(axis=0) - place))


def _scatter(position: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum((position - position.mean(axis=0)) ** 2, axis=1))))


def _distance(position: Floats, place: Floats) -> float:
    return float(np.mean(np.linalg.norm(position - place, axis=1)))


def _distance_sd(position: Floats, place: Floats) -> float:
    return float(np.std(np.linalg.norm(position - place, axis=1)))


def count_steps(size: Size) -> int:
    return len(LABELS)


FIELD = Experiment(paper=PAPER, table="Tables 1 and S1", run=run_field, steps=count_steps)
