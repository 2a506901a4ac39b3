"""What is known beforehand of an array: where its receivers and sync tags are, and where reference tags truly were.

Each is given in metres of any plane, or as longitude and latitude [degrees, WGS84]. The plane is that of the receivers:
what is in metres has another origin, and is never put beside what is in degrees.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.envs.csv_table import CsvTable, Row, open_csv
from tagtrack.envs.motions.tracks import Track, collect_tracks
from tagtrack.eval.field.static_array.detections import Floats, shorten
from tagtrack.eval.field.static_array.travel import SyncTag
from tagtrack.eval.field.telemetry.stamps import name_days, utc_seconds
from tagtrack.live.plane import Plane, check_geodetic, degree_columns, position_columns

Pair = tuple[str, str]
METRES = ("x", "y")
RECEIVER_COLUMNS = ("receiver", *METRES)
OWN_TAG_COLUMNS = ("tag", "receiver")
SYNC_TAG_COLUMNS = (*OWN_TAG_COLUMNS, *METRES)
REFERENCE_COLUMNS = ("tag", *METRES)
# Columns that tell how deep a receiver is, downwards, or its height, in small letters and digits alone; in metres.
DEPTHS = ("depth", "depthm", "receiverdepth", "receiverdepthm", "instrumentdepth", "instrumentdepthm", "deploydepth")
HEIGHTS = ("z", "zm", "height", "heightm", "elevation", "elevationm")
# Columns of deployment tables that tell when a receiver stood where it is said to, in small letters alone.
STARTS = ("start", "deploydatetime", "deploymentstart", "deploydate", "deployed", "from", "begin")
STOPS = ("stop", "recoverdatetime", "deploymentend", "recoverdate", "recovered", "until", "end", "to")
LONGEST_BRIDGE = 120.0  # [s] between two rows of a reference track: a boat or a vehicle does much in two minutes


@dataclass(frozen=True, kw_only=True)
class ReceiverPlaces:
    """R receivers: ``names``, and ``position`` (R, 2) [m] in ``plane``: None where a file gave x and y without saying of what.

    A receiver that was put down anew stands there once for each time, as ``R0`` and ``R0 (2)``.
    """

    names: tuple[str, ...]
    position: Floats
    plane: Plane | None = None
    serials: tuple[str, ...] = ()  # what detections call each; the names if empty
    periods: tuple[tuple[float, float], ...] = ()  # from when to when each stood there [s]; always if empty
    height: Floats | None = None  # (R,) z [m], upwards; NaN where it is not told; None without a column of depths

    @property
    def called(self) -> tuple[str, ...]:
        """What detections call each receiver."""
        return self.serials or self.names

    def in_space(self) -> Floats:
        """Places (R, 3) [m]. Raises ValueError where a receiver's depth is not known."""
        if self.height is None:
            raise ValueError("positions at depth take receivers with a column z or depth [m]; add it")
        if not np.isfinite(self.height).all():
            missing = tuple(name for name, z in zip(self.names, self.height, strict=True) if not np.isfinite(z))
            raise ValueError(f"positions at depth take the depth of every receiver; add that of {shorten(missing)}")
        return np.column_stack([self.position, self.height])


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
    """Receivers in the order of a csv with columns ``receiver`` and ``x,y`` [m in any plane], others ignored.

    Or else, without x and y, ``lon,lat`` or ``longitude,latitude`` [degrees, WGS84]: in the plane about their mean. With columns
    ``start,stop`` (UTC, or seconds since 1970; empty: open) a receiver may have several rows, one for each deployment. A column
    ``depth`` [m, downwards] or ``z`` [m, upwards] tells heights; what it holds is looked at when they are asked for.

    Raises:
        ValueError: for missing columns, no rows, a name that is empty or given twice at one time, a coordinate that is no finite
            number, degrees there are none of; names file and line. Or for receivers over 100 km from their mean.
        ImportError: for longitude and latitude without pymap3d.
        FileNotFoundError: where there is no such file.
    """
    places: dict[str, Floats] = {}
    deployments: dict[str, list[tuple[float, float]]] = {}
    serials: list[str] = []
    heights: list[float] = []
    with open_csv(path, "receiver", RECEIVER_COLUMNS) as table:
        _require_places(table, RECEIVER_COLUMNS)
        axes, period, told = position_columns(table.columns), _period_columns(table.columns), read_height(table.columns)
        for row in table.rows(("receiver", *axes, *(period or ()), *((told[0],) if told else ()))):
            if not row.field["receiver"].strip():
                raise ValueError(f"{row.where}: receiver must not be empty; leave out rows of moorings without a receiver")
            serial = row.name("receiver") if period else _new_name(row, "receiver", places)
            earlier = deployments.setdefault(serial, [])
            if period:
                earlier.append(_new_period(row, period, serial, earlier))
            serials.append(serial)
            if told:
                heights.append(told[1] * _number_or_nan(row.field[told[0]]))
            places[serial if len(earlier) < 2 else f"{serial} ({len(earlier)})"] = _coordinates(row, axes)
    if not places:
        raise ValueError(f"{path} holds no receivers; give one row for each")
    taken = {serial: iter(each) for serial, each in deployments.items()}
    whole = ReceiverPlaces(
        names=tuple(places),
        position=np.array(list(places.values())),
        serials=tuple(serials),
        periods=tuple(next(taken[serial]) for serial in serials) if period else (),
        height=np.array(heights) if told else None,
    )
    if axes == METRES:
        return whole
    plane = Plane.amid(whole.position)
    return replace(whole, position=_lay(whole.position, plane, path), plane=plane)


def read_height(columns: Sequence[str]) -> tuple[str, float] | None:
    """Which column tells z, and by what to multiply it: 1 where it is z, -1 where it is a depth; None where none does."""
    by_name = {re.sub(r"[^a-z0-9]", "", name.lower()): name for name in columns}
    found = [(by_name[name], sign) for names, sign in ((HEIGHTS, 1.0), (DEPTHS, -1.0)) for name in names if name in by_name]
    return found[0] if found else None


def _number_or_nan(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _period_columns(columns: Sequence[str]) -> tuple[str, str] | None:
    """Which columns tell from when to when a receiver stood at its place."""
    by_name = {re.sub(r"[^a-z]", "", name.lower()): name for name in columns}
    found = [next((by_name[name] for name in names if name in by_name), None) for names in (STARTS, STOPS)]
    return None if found[0] is None or found[1] is None else (found[0], found[1])


def _new_period(row: Row, columns: tuple[str, str], serial: str, earlier: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """From when to when [s]. Raises ValueError for a time that is none, or deployments of one receiver at one time."""
    times = []
    for column, open_end in zip(columns, (-math.inf, math.inf), strict=True):
        text = row.field[column].strip()
        if not text or text.upper() in ("NA", "NULL"):
            times.append(open_end)
            continue
        try:
            times.append(_seconds_of(text))
        except ValueError as error:
            raise ValueError(f"{row.where}: {column}: {error}") from None
    start, stop = times
    if not start < stop:
        raise ValueError(f"{row.where}: {columns[0]} {row.field[columns[0]]} must be before {columns[1]} {row.field[columns[1]]}")
    if any(start < other_stop and other_start < stop for other_start, other_stop in earlier):
        raise ValueError(f"{row.where}: receiver {serial!r} is given twice at one time; correct {columns[0]} and {columns[1]}")
    return start, stop


def _seconds_of(text: str) -> float:
    """Seconds since 1970 of a number of them, a date or a stamp. Raises ValueError for what is none, or a number of days."""
    if text.replace(".", "", 1).isdigit():
        if days := name_days(float(text), float(text)):
            raise ValueError(f"{text} looks like {days}, not seconds since 1970; give a date, as 2024-05-01")
        return float(text)
    return float(utc_seconds([f"{text} 00:00:00" if len(text) == len("2019-09-09") else text])[0])


def read_sync_tags(path: str | Path, plane: Plane | None = None) -> list[SyncTag]:
    """Sync tags of a csv with columns ``tag,receiver`` and ``x,y``, ``lon,lat`` or ``longitude,latitude``, others ignored.

    ``receiver`` is empty for a tag that hangs alone. The place may be empty: that of the receiver is then taken; else it
    is unknown, and the tag tells of the drift of clocks, not of their offsets.

    Args:
        plane: of the receivers, if theirs is in degrees; places must then be in degrees too, and otherwise in metres.
    Raises:
        ValueError: for missing columns, no rows, a tag that is empty or given twice, a coordinate that is no finite number,
            degrees there are none of, a place in other units than the receivers' or too far from them; names file and line.
        ImportError: for longitude and latitude without pymap3d.
        FileNotFoundError: where there is no such file.
    """
    tags: dict[str, SyncTag] = {}
    with open_csv(path, "sync tag", SYNC_TAG_COLUMNS) as table:
        _require_places(table, SYNC_TAG_COLUMNS)
        axes, unfit = _axes(table, plane)
        for row in table.rows((*OWN_TAG_COLUMNS, *(axes or ()), *(unfit or ()))):
            tag = _new_name(row, "tag", tags)
            receiver = row.name("receiver") if row.field["receiver"].strip() else None
            position = None
            if axes and _any_filled(row, axes):
                position = _lay(_coordinates(row, axes)[None], plane, row.where)[0]
            elif _any_filled(row, unfit):
                raise ValueError(f"{row.where}: {_misfit(unfit)}")
            tags[tag] = SyncTag(tag=tag, receiver=receiver, position=position)
    if not tags:
        raise ValueError(f"{path} holds no sync tags; give one row for each")
    return list(tags.values())


def read_reference(path: str | Path, plane: Plane | None = None) -> Reference:
    """True positions: a csv with columns ``tag,x,y`` [m] of tags that stay, or ``t_unix_s,x,y`` of a moving one.

    Or with ``lon,lat`` or ``longitude,latitude`` [degrees, WGS84] in place of x and y.

    Args:
        plane: of the receivers, if theirs is in degrees; the reference must then be in degrees too, and otherwise in metres.
    Raises:
        ValueError: for missing columns, no rows, a tag given twice, times that do not rise, values that are no finite
            numbers, degrees there are none of, other units than the receivers' or places too far from them; names file and line.
        ImportError: for longitude and latitude without pymap3d.
        FileNotFoundError: where there is no such file.
    """
    places: dict[str, Floats] = {}
    tracks: tuple[Track, ...] = ()
    with open_csv(path, "reference", REFERENCE_COLUMNS) as table:
        moving = "t_unix_s" in table.columns
        _require_places(table, ("t_unix_s" if moving else "tag", *METRES))
        axes, unfit = _axes(table, plane)
        if axes is None:
            raise ValueError(f"{path}: line 1: {_misfit(unfit)}")
        if moving and "tag" in table.columns:
            raise ValueError(f"{path}: line 1 names both tag and t_unix_s; give the track of one tag, without its name")
        if moving:
            tracks = collect_tracks(table, axes)
        else:
            for row in table.rows(("tag", *axes)):
                places[_new_name(row, "tag", places)] = _lay(_coordinates(row, axes)[None], plane, row.where)[0]
    if not (places or tracks):
        raise ValueError(f"{path} holds no positions; give one row for each {'time' if moving else 'tag'}")
    track = next((Track(time=each.time, position=_lay(each.position, plane, path)) for each in tracks), None)
    return Reference(places=places, track=track)


def read_own_tags(path: str | Path) -> dict[str, tuple[str, ...]]:
    """The tags beside each receiver: ``tag,receiver`` of a csv of sync tags, whose places, if any, are not looked at.

    Raises:
        ValueError: for missing columns, no rows, a tag that is empty or given twice; names file and line.
        FileNotFoundError: where there is no such file.
    """
    beside: dict[str, str] = {}
    with open_csv(path, "sync tag", OWN_TAG_COLUMNS) as table:
        for row in table.rows(OWN_TAG_COLUMNS):
            beside[_new_name(row, "tag", beside)] = row.name("receiver") if row.field["receiver"].strip() else ""
    if not beside:
        raise ValueError(f"{path} holds no sync tags; give one row for each")
    receivers = dict.fromkeys(receiver for receiver in beside.values() if receiver)
    return {receiver: tuple(tag for tag, host in beside.items() if host == receiver) for receiver in receivers}


def _require_places(table: CsvTable, needed: Sequence[str]) -> None:
    """Raise ValueError that lists the columns ``needed`` if a table has neither metres nor degrees."""
    if not set(METRES) <= set(table.columns) and degree_columns(table.columns) is None:
        columns = f"{','.join(needed)}, got {table.header}; rename or add them (degrees: lon,lat for x,y)"
        raise ValueError(f"{table.path}: line 1 must name the columns {columns}")


def _axes(table: CsvTable, plane: Plane | None) -> tuple[Pair | None, Pair | None]:
    """Columns of places in the units of the receivers, and columns in the other units; None where not named."""
    metres, degrees = METRES if set(METRES) <= set(table.columns) else None, degree_columns(table.columns)
    return (metres, degrees) if plane is None else (degrees, metres)


def _misfit(unfit: Pair | None) -> str:
    """Why places in these columns do not go with the receivers'."""
    if unfit == METRES:
        return "x,y have another origin than receivers in longitude and latitude; give lon,lat here too, or receivers in x,y"
    return f"{','.join(unfit or ())} take receivers in degrees too: a file with columns receiver,lon,lat, and without x,y"


def _any_filled(row: Row, columns: Pair | None) -> bool:
    return any(row.field[column].strip() for column in columns or ())


def _coordinates(row: Row, axes: Pair) -> Floats:
    """The two numbers (2,) of a row, in degrees if that is what the columns hold."""
    place = np.array([row.number(axes[0]), row.number(axes[1])])
    if axes != METRES:
        with _named(row.where):
            check_geodetic(place[None])
    return place


def _lay(position: Floats, plane: Plane | None, where: str | Path) -> Floats:
    """Degrees (K, 2) in the plane [m]; without one they are metres as they stand."""
    with _named(where):
        return position if plane is None else plane.to_plane(position)


@contextmanager
def _named(where: str | Path) -> Iterator[None]:
    """What is wrong inside is said to be wrong there."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def _new_name(row: Row, column: str, known: dict) -> str:
    name = row.name(column)
    if name in known:
        raise ValueError(f"{row.where}: {column} {name!r} is given twice; remove one")
    return name
