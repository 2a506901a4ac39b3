"""Logs of missions: what a vehicle believed of itself, and what its receiver heard, as csv or JSON lines.

A csv names its columns in its first line. A row with a ``tag`` is a reading, a row with a place is navigation, a row may be both:

    navigation  t [s], x, y [m] (or lon, lat [degrees]), heading [degrees clockwise from north], speed [m/s]
    readings    t [s], tag, and what the receiver tells: bearing_units [Lotek units], strength, range [m],
                arrival [s], depth [m] of the tag below the vehicle, heard (0: asked, and no answer)

Empty fields say nothing. Lines of JSON are objects with the same names. A line ``# headings: mathematical`` before the header, or
``{"headings": "mathematical"}`` as the first object, changes a convention (see ``Conventions``); so does ``speeds: knots``.
Order does not matter: rows are sorted by time. A row that is there twice counts once.
"""

from __future__ import annotations

import csv
import difflib
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tagtrack.envs.csv_table import Row, open_csv
from tagtrack.policies.files import replace_file

NAVIGATION_COLUMNS = ("t", "x", "y", "heading", "speed")
READING_COLUMNS = ("t", "tag", "bearing_units", "strength", "range", "arrival", "depth", "heard")
DEGREES = ("lon", "lat")
# Other names under which a column is known.
ALIASES: Mapping[str, str] = {
    "time": "t", "t_s": "t", "t_unix_s": "t", "x_m": "x", "y_m": "y", "longitude": "lon", "latitude": "lat", "id": "tag",
    "heading_deg": "heading", "speed_m_s": "speed", "range_m": "range",
}  # fmt: skip
CONVENTIONS = ("headings", "speeds")
MOST_ROWS = 50_000_000


@dataclass(frozen=True)
class Navigation:
    """Where the vehicle believed to be; units are the log's."""

    t: float
    x: float  # or longitude
    y: float  # or latitude
    heading: float | None
    speed: float | None


@dataclass(frozen=True)
class Reading:
    """A ping that was heard, or an answer that did not come."""

    t: float
    tag: str
    heard: bool
    arrival: float | None
    depth: float | None
    values: tuple[tuple[str, float], ...]  # readings by name


@dataclass(frozen=True)
class MissionLog:
    """A whole mission, in order of time."""

    navigation: tuple[Navigation, ...]
    readings: tuple[Reading, ...]
    in_degrees: bool  # whether places are longitude and latitude
    conventions: dict[str, str]  # what the files themselves say
    disordered: int = 0  # rows that stood before an earlier one
    doubled: int = 0

    @property
    def tags(self) -> tuple[str, ...]:
        """Every tag that was heard, in order of name: numbers by their value."""
        names = {reading.tag for reading in self.readings}
        return tuple(sorted(names, key=lambda name: (0, float(name), name) if name.isdecimal() else (1, 0.0, name)))


def read_log(paths: Sequence[str | Path], reading_names: Iterable[str] = ()) -> MissionLog:
    """Read the files of one mission.

    Args:
        reading_names: further columns that hold readings, of a sensor of one's own.
    Raises:
        ValueError: for a file or row that is no log, naming file, line and value; a log without navigation; places that are
            neither metres nor degrees in all files alike.
        FileNotFoundError: where there is no such file.
    """
    names = (*READING_COLUMNS[2:5], *(name for name in reading_names if name not in READING_COLUMNS))
    navigation: list[Navigation] = []
    readings: list[Reading] = []
    said: dict[str, str] = {}
    kinds: set[bool] = set()
    for path in map(Path, paths):
        rows = 0
        for field, where in _rows(path, said):
            rows += 1
            if rows > MOST_ROWS:
                raise ValueError(f"{path} has more than {MOST_ROWS:,} rows; divide it")
            found = _read_row(field, where, names)
            if isinstance(found[0], Navigation):
                kinds.add(_is_in_degrees(field))
            navigation += [each for each in found if isinstance(each, Navigation)]
            readings += [each for each in found if isinstance(each, Reading)]
        if rows == 0:
            raise ValueError(f"{path} is empty; a log has rows of navigation ({','.join(NAVIGATION_COLUMNS)}) or readings")
    listed = ", ".join(map(str, paths))
    if not navigation:
        raise ValueError(f"{listed}: no row of navigation ({','.join(NAVIGATION_COLUMNS)}); name its file, too")
    if len(kinds) > 1:
        raise ValueError(f"{listed}: some places are x,y and some lon,lat; give one kind")
    disordered = _count_disorder(navigation) + _count_disorder(readings)
    by_time = {row.t: row for row in navigation}  # of two fixes of one time the later line holds
    fixes = tuple(by_time[t] for t in sorted(by_time))
    heard = tuple(sorted(dict.fromkeys(readings), key=lambda row: (row.t, row.tag)))
    doubled = len(navigation) - len(fixes) + len(readings) - len(heard)
    log = MissionLog(fixes, heard, kinds == {True}, said, disordered, doubled)
    _refuse_degrees_as_metres(log, listed)
    return log


def _rows(path: Path, said: dict[str, str]) -> Iterator[tuple[dict[str, Any], str]]:
    """Rows by their own names of columns, with where they stand; what a file says of itself goes to ``said``."""
    if not path.is_file():
        raise FileNotFoundError(f"no log {path}; give a csv or JSON lines")
    with path.open("rb") as file:
        start = file.read(1 << 12).lstrip(b"\xef\xbb\xbf \t\r\n")
    if start.startswith(b"{"):
        yield from _json_rows(path, said)
        return
    with open_csv(path, "log", NAVIGATION_COLUMNS) as table:
        for name, value in table.remarks.items():
            if name in CONVENTIONS:
                said[name] = value
            elif near := difflib.get_close_matches(name, CONVENTIONS, cutoff=0.7):
                raise ValueError(f"{path}: the remark {name!r} is not known; write # {near[0]}: {value}")
        columns = _known_columns(path, table.columns)
        for row in table.rows(tuple(columns)):
            yield {columns[name]: text for name, text in row.field.items()}, row.where


def _known_columns(path: Path, columns: Sequence[str]) -> dict[str, str]:
    """Our name of each column."""
    if not columns:
        raise ValueError(f"{path} is empty; a log has rows of navigation ({','.join(NAVIGATION_COLUMNS)}) or readings")
    known = {name: ALIASES.get(name.lower(), name) for name in columns}
    for name in set(known.values()):
        if sum(other == name for other in known.values()) > 1:
            both = " and ".join(column for column, other in known.items() if other == name)
            raise ValueError(f"{path}: {both} both mean {name}; remove one of these columns")
    if "t" not in known.values():
        raise ValueError(f"{path}: the first line must name a column t, got {','.join(columns)[:200]}; rename or add it")
    return known


def _json_rows(path: Path, said: dict[str, str]) -> Iterator[tuple[dict[str, Any], str]]:
    with path.open(encoding="utf-8-sig", errors="surrogateescape") as file:
        for number, line in enumerate(file, start=1):
            if not line.strip():
                continue
            where = f"{path}: line {number}"
            try:
                row = json.loads(line)
            except (ValueError, RecursionError):
                raise ValueError(f"{where}: is no line of JSON: {line[:80]!r}") from None
            if not isinstance(row, dict):
                raise ValueError(f"{where}: must be an object, got {line[:80]!r}")
            if set(row) <= set(CONVENTIONS) and row:
                said.update({name: str(value) for name, value in row.items()})
                continue
            yield {ALIASES.get(name.lower(), name): value for name, value in row.items()}, where


def _read_row(field: Mapping[str, Any], where: str, names: Sequence[str]) -> list[Navigation | Reading]:
    t = _number(field, "t", where)
    if t is None:
        raise ValueError(f"{where}: t is empty; every row needs a time")
    found: list[Navigation | Reading] = []
    axes = DEGREES if _is_in_degrees(field) else ("x", "y")
    place = [_number(field, axis, where) for axis in axes]
    if any(part is not None for part in place):
        if place[0] is None or place[1] is None:
            raise ValueError(f"{where}: a place needs {axes[0]} and {axes[1]}, got one of them")
        found.append(Navigation(t, place[0], place[1], _number(field, "heading", where), _number(field, "speed", where)))
    tag = field.get("tag")
    if tag is not None and str(tag).strip():
        heard = _number(field, "heard", where)
        if heard not in (None, 0.0, 1.0):
            raise ValueError(f"{where}: heard must be 0 or 1, got {heard:g}")
        values = {name: value for name in names if (value := _number(field, name, where)) is not None}
        if values.get("range", 0.0) < 0:
            raise ValueError(f"{where}: range must be at least 0, got {values['range']:g}")
        depth, arrival = _number(field, "depth", where), _number(field, "arrival", where)
        if isinstance(tag, bool) or not isinstance(tag, (str, int, float)):
            raise ValueError(f"{where}: tag must be a name or a number, got {tag!r:.80}")
        name = str(int(tag)) if isinstance(tag, float) and tag.is_integer() else str(tag)
        found.append(Reading(t, Row({"tag": name}, where).name("tag"), heard != 0.0, arrival, depth, tuple(values.items())))
    if not found:
        raise ValueError(f"{where}: has neither a place (x,y or lon,lat) nor a tag")
    return found


def _is_in_degrees(field: Mapping[str, Any]) -> bool:
    return all(field.get(axis) not in (None, "") for axis in DEGREES)


def _number(field: Mapping[str, Any], name: str, where: str) -> float | None:
    """A finite number, None where nothing is said: an empty field, null or NaN."""
    value = field.get(name)
    if value is None or (isinstance(value, str) and not value.strip()):
        return None
    if isinstance(value, bool):
        return float(value)
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{where}: {name} must be a number, got {value!r:.80}") from None
    if math.isnan(number):
        return None
    if math.isinf(number):
        raise ValueError(f"{where}: {name} must be finite, got {value!r:.80}")
    return number


def _count_disorder(rows: Sequence[Navigation | Reading]) -> int:
    return sum(later.t < earlier.t for earlier, later in zip(rows, rows[1:], strict=False))


def _refuse_degrees_as_metres(log: MissionLog, listed: str) -> None:
    """x and y that stay within a degree or so, while the vehicle says that it went much further."""
    fixes = log.navigation
    if log.in_degrees or len(fixes) < 2 or not all(abs(fix.x) <= 360.0 and abs(fix.y) <= 90.0 for fix in fixes):
        return
    pairs = list(zip(fixes, fixes[1:], strict=False))
    way = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairs)
    told = [(a.speed, b.t - a.t) for a, b in pairs if a.speed is not None]
    said = sum(speed * min(seconds, 60.0) for speed, seconds in told)
    if not told and 0.0 < way < 1e-3 * (fixes[-1].t - fixes[0].t):
        raise ValueError(f"{listed}: x,y move by less than a millimetre a second: if they are degrees, name the columns lon,lat")
    if said > 20.0 and way < 0.01 * said:
        raise ValueError(
            f"{listed}: the vehicle says that it went {said:.0f} m, and x,y moved by {way:.3g}: if they are degrees, "
            "name the columns lon,lat"
        )


def write_navigation(path: Path, rows: Iterable[Sequence[float]], conventions: Mapping[str, str]) -> None:
    """A csv of navigation: t, x, y, heading, speed of each row, in full precision."""
    _write(path, NAVIGATION_COLUMNS, rows, conventions)


def write_readings(path: Path, rows: Iterable[Mapping[str, Any]], names: Sequence[str]) -> None:
    """A csv of readings; ``names`` are the sensor's own columns."""
    columns = ("t", "tag", *names, "arrival", "depth", "heard")
    _write(path, columns, ([row.get(name, "") for name in columns] for row in rows), {})


def _write(path: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]], conventions: Mapping[str, str]) -> None:
    text = io.StringIO()
    for name, value in conventions.items():
        text.write(f"# {name}: {value}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([[repr(value) if isinstance(value, float) else value for value in row] for row in rows])
    with replace_file(path) as partial:
        partial.write_text(text.getvalue(), encoding="utf-8")
