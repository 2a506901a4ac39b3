"""Recorded tracks as targets: reading, checking and resampling; and the row loop that replays them.

A file is a csv, plain or gzip, with columns ``t_unix_s,x,y`` (seconds, metres in any plane coordinates).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import TRACK, uniform_pair
from tagtrack.envs.sim.csv_table import Row, open_csv

COLUMNS = ("t_unix_s", "x", "y")
LONGEST_GAP = 120.0  # s: interpolating across more would invent a track


@dataclass(frozen=True)
class Track:
    """A recorded track: ``time`` (K,) [s], rising; ``position`` (K, 2) [m]."""

    time: np.ndarray
    position: np.ndarray


def read_track(path: str | Path) -> Track:
    """Read a track from a csv file.

    Raises:
        ValueError: for missing columns, empty files, values that are not finite numbers, times that do not rise, or a gap of
            more than ``LONGEST_GAP``; the message names file and line.
        FileNotFoundError: where there is no such file.
    """
    rows: list[tuple[float, float, float]] = []
    with open_csv(path, "track", COLUMNS) as table:
        for row in table.rows(COLUMNS):
            rows.append(_read_row(row, rows[-1] if rows else None))
    if len(rows) < 2:
        raise ValueError(f"{path}: a track needs at least two rows, got {len(rows)}")
    fixes = np.array(rows)
    return Track(time=fixes[:, 0], position=fixes[:, 1:])


def _read_row(row: Row, before: tuple[float, float, float] | None) -> tuple[float, float, float]:
    time, x, y = (row.number(column) for column in COLUMNS)
    if before is not None and time <= before[0]:
        raise ValueError(f"{row.where}: times must rise, got {time:.3f} after {before[0]:.3f}; sort the file")
    if before is not None and time - before[0] > LONGEST_GAP:
        gap = time - before[0]
        raise ValueError(f"{row.where}: a gap of {gap:.0f} s (at most {LONGEST_GAP:.0f} s); split the file there")
    return time, x, y


def resample_track(track: Track, time_step: float, time_scale: float, episode_steps: int) -> np.ndarray:
    """Positions (K, 2) [m] at every step of an animal that swims its track at ``time_scale`` times the recorded speed.

    Raises:
        ValueError: where the track is too short for one episode.
    """
    step = time_step * time_scale
    count = int((track.time[-1] - track.time[0]) / step + 1e-9) + 1
    if count < episode_steps + 1:
        lasts = (track.time[-1] - track.time[0]) / time_scale
        raise ValueError(
            f"the track lasts {lasts:.0f} s at time_scale={time_scale:g}, an episode {episode_steps * time_step:.0f} s; "
            f"lower time_scale or episode_steps"
        )
    times = track.time[0] + step * np.arange(count)
    return np.stack([np.interp(times, track.time, track.position[:, k]) for k in range(2)], axis=1)


@compiled
def begin_replay(target, fish, stream, t, track, episode_steps):
    """Choose the stretch of the track and the angle by which it is turned; the fish stands at its starting place."""
    place, turn = uniform_pair(stream, TRACK, t)
    target.start_row = int(place * (track.shape[0] - episode_steps))
    target.turn = 2.0 * math.pi * turn
    target.start_x = np.float64(fish[0, 0])
    target.start_y = np.float64(fish[1, 0])


@compiled
def follow_track(target, fish, track, step, time_step):
    """Put the fish (4, 1) where the turned track has it after ``step`` steps; beyond the end it rests."""
    row = min(target.start_row + step, track.shape[0] - 1)
    dx = track[row, 0] - track[target.start_row, 0]
    dy = track[row, 1] - track[target.start_row, 1]
    x = target.start_x + math.cos(target.turn) * dx - math.sin(target.turn) * dy
    y = target.start_y + math.sin(target.turn) * dx + math.cos(target.turn) * dy
    step_x = x - np.float64(fish[0, 0])
    step_y = y - np.float64(fish[1, 0])
    fish[0, 0] = x
    fish[1, 0] = y
    if step_x != 0.0 or step_y != 0.0:
        fish[2, 0] = math.atan2(step_y, step_x)
    fish[3, 0] = math.sqrt(step_x * step_x + step_y * step_y) / time_step
