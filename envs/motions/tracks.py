"""Recorded tracks as files and as arrays: one or many animals, read, checked and split into training and held-out animals.

A file is a csv with columns ``t_unix_s,x,y`` (seconds, metres in any plane coordinates) and, where it holds more than one
animal, ``tag``. Gaps need no mark: ``replay.py`` cuts tracks where they last too long.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tagtrack.envs.csv_table import CsvTable, open_csv

COLUMNS = ("t_unix_s", "x", "y")
TAG_COLUMN = "tag"
# Interpolating across a longer gap would invent a track [s]. It suits slow animals whose tags ping every 60-120 s and that are
# located from windows of up to 600 s: one window may be followed late, none may be missing.
LONGEST_GAP = 900.0


@dataclass(frozen=True, eq=False)
class Track:
    """The recorded track of one animal, gaps and all: ``time`` (K,) [s], rising; ``position`` (K, 2) [m]; its tag's name."""

    time: np.ndarray
    position: np.ndarray
    tag: str = ""  # empty for the only animal of a file without the column


def read_tracks(path: str | Path) -> tuple[Track, ...]:
    """Read the tracks of a csv file, one for each tag, in the order in which the tags first appear. Tags may be interleaved.

    Raises:
        ValueError: for missing columns, fewer than two rows, an empty tag, values that are not finite numbers, or times that do
            not rise from one row of a tag to its next; the message names file and line.
        FileNotFoundError: where there is no such file.
    """
    with open_csv(path, "track", COLUMNS) as table:
        tracks = collect_tracks(table, ("x", "y"))
    if sum(track.time.size for track in tracks) < 2:
        raise ValueError(f"{path}: a track needs at least two rows, got {sum(track.time.size for track in tracks)}")
    return tracks


def collect_tracks(table: CsvTable, axes: tuple[str, str]) -> tuple[Track, ...]:
    """The tracks of an open table, positions from its columns ``axes``; one without a name where there is no column ``tag``.

    Raises:
        ValueError: as ``read_tracks``, but for the number of rows.
    """
    animals: dict[str, list[tuple[float, float, float]]] = {}
    tagged = TAG_COLUMN in table.columns
    for row in table.rows((*((TAG_COLUMN,) if tagged else ()), "t_unix_s", *axes)):
        fixes = animals.setdefault(row.name(TAG_COLUMN) if tagged else "", [])
        time = row.number("t_unix_s")
        if fixes and time <= fixes[-1][0]:
            order = f"sort the file, and tell several animals apart in a column {TAG_COLUMN}"
            raise ValueError(f"{row.where}: times must rise, got {time:.3f} after {fixes[-1][0]:.3f}; {order}")
        fixes.append((time, row.number(axes[0]), row.number(axes[1])))
    rows = {tag: np.array(fixes) for tag, fixes in animals.items()}
    return tuple(Track(time=fixes[:, 0], position=fixes[:, 1:], tag=tag) for tag, fixes in rows.items())


def find_unbroken(time: np.ndarray, longest_gap: float) -> list[slice]:
    """The stretches of rising times (K,) [s] that no gap longer than ``longest_gap`` [s] interrupts."""
    if time.size == 0:
        return []
    edges = [0, *(np.flatnonzero(np.diff(time) > longest_gap) + 1).tolist(), time.size]
    return [slice(begin, end) for begin, end in zip(edges, edges[1:], strict=False)]


def split_tracks(
    tracks: Sequence[Track], held_out: float = 0.25, seed: int = 0
) -> tuple[tuple[Track, ...], tuple[Track, ...]]:
    """Training and held-out animals: whole animals, so that a policy is judged on animals it never met.

    Animals are ranked by a hash (SHA-256) of seed and tag: the same split on every machine, whatever the order of the tracks.

    Args:
        tracks: one for each animal, as ``read_tracks`` gives them.
        held_out: share of the animals to hold out; at least one animal is held out and at least one is kept.
        seed: another number, another split.
    Returns:
        the two parts, each in the given order.
    Raises:
        ValueError: for a share outside (0, 1), a tag that occurs twice, or fewer than two animals.
    """
    if not 0.0 < held_out < 1.0:
        raise ValueError(f"held_out must be a share between 0 and 1, got {held_out!r}")
    tags = [track.tag for track in tracks]
    tag, times = Counter(tags).most_common(1)[0] if tags else ("", 0)
    if times > 1:
        raise ValueError(f"each animal must come once, got {times} tracks of tag {tag!r}")
    if len(tags) < 2:
        raise ValueError(f"there must be two animals or more to hold one out, got {len(tags)}")
    ranked = sorted(tags, key=lambda tag: hashlib.sha256(f"{seed}:{tag}".encode()).digest())
    chosen = set(ranked[: min(max(round(held_out * len(tags)), 1), len(tags) - 1)])
    kept = tuple(track for track in tracks if track.tag not in chosen)
    return kept, tuple(track for track in tracks if track.tag in chosen)
