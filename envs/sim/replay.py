"""Recorded tracks as targets: cut at gaps, resampled to the steps of a task, and the row loop that replays them.

An episode takes a random stretch of an animal's track, turned by a random angle. All beginnings that leave a whole episode
before the next gap are equally likely, so that no episode crosses a gap or goes from one animal to another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import TRACK, uniform_pair
from tagtrack.envs.sim.motion import Replay
from tagtrack.envs.sim.tracks import Track, find_unbroken


class TrackTable(NamedTuple):
    """Where animals are at every step of a task: stretch after stretch in one table."""

    position: np.ndarray  # (K, 2) [m]
    last: np.ndarray  # (G,) int64: the row with which each stretch ends


NO_TRACKS = TrackTable(position=np.zeros((1, 2)), last=np.zeros(1, np.int64))


def cut_at_gaps(track: Track, longest_gap: float) -> list[Track]:
    """The unbroken stretches of a track, cut where two rows lie more than ``longest_gap`` [s] apart; lone rows are dropped."""
    pieces = [Track(time=track.time[rows], position=track.position[rows], tag=track.tag)
              for rows in find_unbroken(track.time, longest_gap)]
    return [piece for piece in pieces if piece.time.size > 1]


def find_stretches(tracks: Sequence[Track], replay: Replay, time_step: float, episode_steps: int) -> list[Track]:
    """The unbroken stretches that hold a whole episode.

    Raises:
        ValueError: where there is none.
    """
    stretches = [stretch for track in tracks for stretch in cut_at_gaps(track, replay.longest_gap)]
    if not stretches:
        raise ValueError(f"no two rows lie within {replay.longest_gap:g} s of each other; raise fish.longest_gap")
    step = time_step * replay.time_scale
    long_enough = [stretch for stretch in stretches if _count_rows(stretch, step) > episode_steps]
    if not long_enough:
        lasts = max(stretch.time[-1] - stretch.time[0] for stretch in stretches) / replay.time_scale
        whole = len(stretches) == 1
        raise ValueError(
            f"{'the track' if whole else f'the longest of {len(stretches)} unbroken stretches'} lasts {lasts:.0f} s at "
            f"time_scale={replay.time_scale:g}, an episode {episode_steps * time_step:.0f} s; lower time_scale or episode_steps"
            + ("" if whole else f", or raise fish.longest_gap ({replay.longest_gap:g} s)")
        )
    return long_enough


@lru_cache(maxsize=2)  # the simulations of one task share it: two months of sixteen animals take seconds and 600 MB
def make_table(tracks: tuple[Track, ...], replay: Replay, time_step: float, episode_steps: int) -> TrackTable:
    """The table that the loops below read, and nobody writes. Raises ValueError as ``find_stretches`` does."""
    stretches = find_stretches(tracks, replay, time_step, episode_steps)
    resampled = [resample_track(stretch, time_step * replay.time_scale) for stretch in stretches]
    rows = np.array([len(positions) for positions in resampled], np.int64)
    return TrackTable(position=np.concatenate(resampled), last=np.cumsum(rows) - 1)


def resample_track(track: Track, step: float) -> np.ndarray:
    """Positions (K, 2) [m] every ``step`` seconds of the recording, on the straight lines between its rows."""
    times = track.time[0] + step * np.arange(_count_rows(track, step))
    return np.stack([np.interp(times, track.time, track.position[:, k]) for k in range(2)], axis=1)


def _count_rows(track: Track, step: float) -> int:
    return int((track.time[-1] - track.time[0]) / step + 1e-9) + 1  # a whole number of steps may fall short by rounding


@compiled
def begin_replay(target, fish, stream, t, table, episode_steps):
    """Choose the stretch of the track and the angle by which it is turned; the fish stands at its starting place."""
    place, turn = uniform_pair(stream, TRACK, t)
    # The last episode_steps rows of each stretch begin no episode: count those that do, and pass over the others.
    row = int(place * (table.position.shape[0] - table.last.shape[0] * episode_steps))
    stretch = 0
    while row + episode_steps > table.last[stretch]:
        row += episode_steps
        stretch += 1
    target.start_row = row
    target.end_row = table.last[stretch]
    target.turn = 2.0 * math.pi * turn
    target.start_x = np.float64(fish[0, 0])
    target.start_y = np.float64(fish[1, 0])


@compiled
def follow_track(target, fish, position, step, time_step):
    """Put the fish (4, 1) where the turned track has it after ``step`` steps; beyond the end of its stretch it rests."""
    row = min(target.start_row + step, target.end_row)
    dx = position[row, 0] - position[target.start_row, 0]
    dy = position[row, 1] - position[target.start_row, 1]
    x = target.start_x + math.cos(target.turn) * dx - math.sin(target.turn) * dy
    y = target.start_y + math.sin(target.turn) * dx + math.cos(target.turn) * dy
    step_x = x - np.float64(fish[0, 0])
    step_y = y - np.float64(fish[1, 0])
    fish[0, 0] = x
    fish[1, 0] = y
    if step_x != 0.0 or step_y != 0.0:
        fish[2, 0] = math.atan2(step_y, step_x)
    fish[3, 0] = math.sqrt(step_x * step_x + step_y * step_y) / time_step
