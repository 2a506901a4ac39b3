"""What is known beforehand of an array: where its receivers and sync tags are, and where reference tags truly were."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.baselines.static_array.detections import Floats, shorten
from tagtrack.baselines.static_array.travel import SyncTag
from tagtrack.envs.sim.csv_table import Row, open_csv
from tagtrack.envs.sim.tracks import Track
from tagtrack.eval.telemetry.tracks import read_tracks

RECEIVER_COLUMNS = ("receiver", "x", "y")
SYNC_TAG_COLUMNS = ("tag", "receiver", "x", "y")
REFERENCE_COLUMNS = ("tag", "x", "y")
LONGEST_BRIDGE = 120.0  # [s] between two rows of a reference track: a boat or a vehicle does much in two minutes


@dataclass(frozen=True, kw_only=True)
class ReceiverPlaces:
    """R receivers: ``names``, and ``position`` (R, 2) [m]."""

    names: tuple[str, ...]
    position: Floats


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Where tags truly were: places (2,) [m] of those that stay, by tag, or the track of any tag."""

    places: dict[str, Floats] = field(default_factory=dict)
    track: Track | None = None

    def position(self, tag: str, time: ArrayLike) -> Floats:
        """Places (K, 2) [m] of a tag at times (K,) [s]; NaN before and after its track and in gaps of over two minutes.

        Raises:
            ValueError: for a tag without a reference, with those that have one.
        """
        times = np.asarray(time, dtype=np.float64)
        if self.track is None:
            if tag not in self.places:
                raise ValueError(f"no reference position of tag {tag!r}; there are {shorten(tuple(self.places))}")
            return np.tile(self.places[tag], (len(times), 1))
        known = self.track.time
        after = np.searchsorted(known, times).clip(1, len(known) - 1)
        sure = (times >= known[0]) & (times <= known[-1])
        sure &= (known[after] - known[after - 1] <= LONGEST_BRIDGE) | (times == known[after]) | (times == known[after - 1])
        places = np.stack([np.interp(times, known, axis) for axis in self.track.position.T], axis=1)
        return np.where(sure[:, None], places, np.nan)


def read_receivers(path: str | Path) -> ReceiverPlaces:
    """Receivers in the order of a csv with columns ``receiver,x,y`` [m in any plane], others ignored.

    Raises:
        ValueError: for missing columns, no rows, a name that is empty or given twice, a coordinate that is no finite number;
            names file and line.
        FileNotFoundError: where there is no such file.
    """
    places: dict[str, tuple[float, float]] = {}
    with open_csv(path, "receiver", RECEIVER_COLUMNS) as table:
        for row in table.rows(RECEIVER_COLUMNS):
            if not row.field["receiver"].strip():
                raise ValueError(f"{row.where}: receiver must not be empty; leave out rows of moorings without a receiver")
            places[_new_name(row, "receiver", places)] = row.number("x"), row.number("y")
    if not places:
        raise ValueError(f"{path} holds no receivers; give one row for each")
    return ReceiverPlaces(names=tuple(places), position=np.array(list(places.values())))


def read_sync_tags(path: str | Path) -> list[SyncTag]:
    """Sync tags of a csv with columns ``tag,receiver,x,y``, others ignored.

    ``receiver`` is empty for a tag that hangs alone; ``x,y`` [m] may both be empty where there is a receiver.

    Raises:
        ValueError: for missing columns, no rows, a tag that is empty or given twice, a row with neither receiver nor place,
            a coordinate that is no finite number; names file and line.
        FileNotFoundError: where there is no such file.
    """
    tags: dict[str, SyncTag] = {}
    with open_csv(path, "sync tag", SYNC_TAG_COLUMNS) as table:
        for row in table.rows(SYNC_TAG_COLUMNS):
            tag = _new_name(row, "tag", tags)
            receiver = row.name("receiver") if row.field["receiver"].strip() else None
            placed = bool(row.field["x"].strip() or row.field["y"].strip())
            if receiver is None and not placed:
                raise ValueError(f"{row.where}: tag {tag!r} needs the receiver it hangs by, or its place x,y")
            position = np.array([row.number("x"), row.number("y")]) if placed else None
            tags[tag] = SyncTag(tag=tag, receiver=receiver, position=position)
    if not tags:
        raise ValueError(f"{path} holds no sync tags; give one row for each")
    return list(tags.values())


def read_reference(path: str | Path) -> Reference:
    """True positions: a csv with columns ``tag,x,y`` [m] of tags that stay, or ``t_unix_s,x,y`` of a moving one.

    Raises:
        ValueError: for missing columns, no rows, a tag given twice, times that do not rise, values that are no finite
            numbers; names file and line.
        FileNotFoundError: where there is no such file.
    """
    places: dict[str, Floats] = {}
    with open_csv(path, "reference", REFERENCE_COLUMNS) as table:
        moving = "t_unix_s" in table.columns
        if moving:
            table.place(("t_unix_s", "x", "y"))
        if moving and "tag" in table.columns:
            raise ValueError(f"{path}: line 1 names both tag and t_unix_s; give the track of one tag, without its name")
        if not moving:
            for row in table.rows(REFERENCE_COLUMNS):
                places[_new_name(row, "tag", places)] = np.array([row.number("x"), row.number("y")])
    if moving:
        (track,) = read_tracks(path).of.values()
        return Reference(track=track)
    if not places:
        raise ValueError(f"{path} holds no positions; give one row for each tag")
    return Reference(places=places)


def _new_name(row: Row, column: str, known: dict) -> str:
    name = row.name(column)
    if name in known:
        raise ValueError(f"{row.where}: {column} {name!r} is given twice; remove one")
    return name
