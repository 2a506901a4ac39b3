"""Recorded tracks as files and as arrays: one or many animals, read, checked and split into training and held-out animals.

A file is a csv with columns ``t_unix_s,x,y`` (seconds, metres in any plane coordinates) and, where it holds more than one
animal, ``tag``. Gaps need no mark: ``replay.py`` cuts tracks where they last too long.
"""

from __future__ import annotations

import csv
import hashlib
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

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
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no track file {path}; give a csv with columns {','.join(COLUMNS)}")
    animals: dict[str, list[tuple[float, float, float]]] = {}
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            columns = set(reader.fieldnames or ())
            if not set(COLUMNS) <= columns:
                raise ValueError(f"{path}: line 1 must name the columns {','.join(COLUMNS)}, got {reader.fieldnames}")
            for line in reader:
                where = f"{path}: line {reader.line_num}"
                rows = animals.setdefault(_read_tag(line, where) if TAG_COLUMN in columns else "", [])
                rows.append(_read_row(line, rows[-1] if rows else None, where))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: not a csv text file ({error})") from None
    count = sum(len(rows) for rows in animals.values())
    if count < 2:
        raise ValueError(f"{path}: a track needs at least two rows, got {count}")
    tables = {tag: np.array(rows) for tag, rows in animals.items()}
    return tuple(Track(time=table[:, 0], position=table[:, 1:], tag=tag) for tag, table in tables.items())


def _read_tag(line: dict[str, str], where: str) -> str:
    tag = (line[TAG_COLUMN] or "").strip()
    if not tag:
        raise ValueError(f"{where}: {TAG_COLUMN} must not be empty; leave the column out if there is one animal")
    return tag


def _read_row(line: dict[str, str], before: tuple[float, float, float] | None, where: str) -> tuple[float, float, float]:
    values = []
    for column in COLUMNS:
        try:
            value = float(line[column])
        except (TypeError, ValueError):
            raise ValueError(f"{where}: {column} must be a number, got {line[column]!r}") from None
        if not math.isfinite(value):
            raise ValueError(f"{where}: {column} must be finite, got {line[column]!r}")
        values.append(value)
    if before is not None and values[0] <= before[0]:
        order = f"sort the file, and tell several animals apart in a column {TAG_COLUMN}"
        raise ValueError(f"{where}: times must rise, got {values[0]:.3f} after {before[0]:.3f}; {order}")
    return values[0], values[1], values[2]


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
