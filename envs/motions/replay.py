"""Recorded tracks as targets: cut at gaps, resampled to the steps of a task, and the row loop that replays them.

An episode takes a random stretch of an animal's track, turned by a random angle. All beginnings that leave a whole episode
before the next gap are equally likely, so that no episode crosses a gap or goes from one animal to another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.random import TRACK, uniform_pair
from tagtrack.envs.motions.motion import BEGIN, FOLLOW, Path
from tagtrack.envs.motions.tracks import LONGEST_GAP, Track, find_unbroken
from tagtrack.envs.validation import require, settle_numbers

# Places in the memory: rows of the table, the angle by which the track is turned [rad], where the fish starts [m].
START_ROW, END_ROW, TURN, START_X, START_Y = range(5)


@native(BEGIN)
def begin(fish, memory, key_0, key_1, episode, tag, parameters, positions, last, episode_steps):
    """Choose the stretch of the track and the angle by which it is turned; the fish stands at its starting place."""
    place, turn = uniform_pair((key_0, key_1, episode, np.uint64(0)), TRACK, tag)
    # The last episode_steps rows of each stretch begin no episode: count those that do, and pass over the others.
    row = int(place * (positions.shape[0] - last.shape[0] * episode_steps))
    stretch = 0
    while row + episode_steps > last[stretch]:
        row += episode_steps
        stretch += 1
    memory[START_ROW] = row
    memory[END_ROW] = last[stretch]
    memory[TURN] = 2.0 * math.pi * turn
    memory[START_X] = np.float64(fish[0, 0])
    memory[START_Y] = np.float64(fish[1, 0])


@native(FOLLOW)
def follow(fish, memory, key_0, key_1, episode, tag, parameters, positions, last, step, time_step):
    """Put the fish where the turned track has it after ``step`` steps; beyond the end of its stretch it rests."""
    start = int(memory[START_ROW])
    row = min(start + step, int(memory[END_ROW]))
    dx = positions[row, 0] - positions[start, 0]
    dy = positions[row, 1] - positions[start, 1]
    x = memory[START_X] + math.cos(memory[TURN]) * dx - math.sin(memory[TURN]) * dy
    y = memory[START_Y] + math.sin(memory[TURN]) * dx + math.cos(memory[TURN]) * dy
    step_x = x - np.float64(fish[0, 0])
    step_y = y - np.float64(fish[1, 0])
    fish[0, 0] = x
    fish[1, 0] = y
    if step_x != 0.0 or step_y != 0.0:
        fish[2, 0] = math.atan2(step_y, step_x)
    fish[3, 0] = math.sqrt(step_x * step_x + step_y * step_y) / time_step


@dataclass(frozen=True, kw_only=True)
class Replay(Path):
    """Recorded tracks move the true fish; never a model for particles.

    Each episode takes a random stretch of a track, turned by a random angle.
    """

    time_scale: float = 1.0  # 0.5 lets an animal swim its track at half the recorded speed
    longest_gap: float = LONGEST_GAP  # between two rows of a track [s]; a longer one cuts it, and no episode crosses a cut
    name: ClassVar[str] = "replay"
    begin: ClassVar[Native] = begin
    follow: ClassVar[Native] = follow

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("time_scale", "longest_gap"):
            require(getattr(self, name) > 0, self, name, "positive")


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
