"""The kinds of detection files, told apart by their first line, and their rows as numbers.

Read are our own csv, tables whose columns say in one of many ways when (UTC), by which receiver and of which tag (the exports of
VEMCO VUE, GLATOS, OTN, ETN, Thelma, actel, tables of Fathom's detections), Fathom (VDAT) logs, and the text files of the RESNEP
campaign (Masmitja et al. 2020), one for each receiver and tag.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from tagtrack.envs.csv_table import CsvTable, open_csv, printable_name, shown
from tagtrack.eval.field.static_array.detections import Codes, Floats
from tagtrack.eval.field.telemetry.stamps import is_time, unix_seconds, utc_seconds, zone_of_column

BLOCK = 1 << 16  # rows read at a time: some 20 MB as text
_RESNEP_FILE = re.compile(r"detections_([^_]+)_.+\.txt")

Block = tuple[Floats, Codes, Codes]


@dataclass(frozen=True, kw_only=True)
class Layout:
    """One kind of file: which columns tell time, receiver and tag (its parts are joined by a hyphen)."""

    name: str
    time: str
    receiver: str | None  # None: the name of the file tells
    tag: tuple[str, ...]
    corrected: str | None = None  # a column that goes before ``time`` where it is not empty
    zone: str | None = None  # a column that must say UTC
    to_seconds: Callable[[Sequence[str]], Floats] = utc_seconds

    @property
    def columns(self) -> tuple[str, ...]:
        more = [name for name in (self.receiver, self.corrected, self.zone) if name]
        return (self.time, *more, *self.tag)


OWN = Layout(name="csv", time="t_unix_s", receiver="receiver", tag=("tag",), to_seconds=unix_seconds)
VUE = Layout(name="VUE", time="Date and Time (UTC)", receiver="Receiver", tag=("Transmitter",))

# What columns are called, in small letters and digits alone, the surest first. Times are in UTC.
TIMES = (
    "dateandtimeutc", "detectiontimestamputc", "datecollectedutc", "devicetimeutc", "timeutc", "datetimeutc", "timestamputc",
    "datecollected", "datetime", "timestamp",
)  # fmt: skip
CORRECTED_TIMES = ("time",)  # beside another, and only where it says something: Fathom's
RECEIVERS = (
    "receiver", "receiversn", "receiverid", "receiverserial", "receiverserialnumber", "tbrserialnumber", "serialnumber",
)  # fmt: skip
TAGS: tuple[tuple[str, ...], ...] = (
    ("transmitter",), ("fullid",), ("transmittercodespace", "transmitterid"), ("tagname",), ("acoustictagid",), ("tagid",),
    ("protocol", "id"), ("codetype", "id"), ("codespace", "signal"), ("codespace", "id"), ("transmitterid",),
)  # fmt: skip
ZONES = ("timezone",)
RELEASE = "release"  # the receiver of rows that tell where an animal was let go: no detections
_ZONE_IS_UTC = {"utc", "gmt", "z", ""}
RESNEP = Layout(name="RESNEP", time="t_unix_s", receiver=None, tag=("tag",), to_seconds=unix_seconds)


class Names(dict[str, int]):
    """Numbers names in the order they are first met; a text seen before costs one look-up."""

    def __init__(self, column: str) -> None:
        self.column = column
        self.names: dict[str, int] = {}

    def __missing__(self, text: str) -> int:
        name = printable_name(text, self.column)
        self[text] = code = self.names.setdefault(name, len(self.names))
        return code

    def codes(self, texts: Sequence[str]) -> Codes:
        """Numbers (N,) of N texts. Raises ValueError for one that is no name."""
        return np.fromiter(map(self.__getitem__, texts), np.int32, len(texts))


@dataclass(frozen=True)
class DetectionFile:
    """One open file of detections, of a known kind."""

    table: CsvTable
    layout: Layout
    receiver: str | None  # where the name of the file tells it
    rows: Sequence[tuple[list[list[str]], Sequence[int]]] = ()  # of a file that has been read already

    def blocks(self, receivers: Names, tags: Names) -> Iterator[Block]:
        """Times and numbers of receivers and tags, block by block.

        Raises:
            ValueError: for a row that is no detection; names file, line and value.
        """
        for rows, lines in self.rows or self.table.blocks(BLOCK):
            try:
                yield self._convert(rows, receivers, tags)
            except ValueError:
                for row, line in zip(rows, lines, strict=True):
                    try:
                        self._convert([row], receivers, tags)
                    except ValueError as error:
                        raise ValueError(f"{self.table.path}: line {line}: {error}") from None
                raise

    def _convert(self, rows: list[list[str]], receivers: Names, tags: Names) -> Block:
        place = {name: self.table.columns.index(name) for name in self.layout.columns}
        rows = self._detections_among(rows, place)
        times = [row[place[self.layout.time]] for row in rows]
        if self.layout.corrected is not None:
            better = [row[place[self.layout.corrected]] for row in rows]
            times = [other or time for other, time in zip(better, times, strict=True)]
        time = self.layout.to_seconds(times) if rows else np.empty(0)
        if self.layout.receiver is None:
            heard_by = np.full(len(rows), receivers[self.receiver or ""], np.int32)
        else:
            heard_by = receivers.codes([row[place[self.layout.receiver]] for row in rows])
        parts = [[row[place[name]] for row in rows] for name in self.layout.tag]
        return time, heard_by, tags.codes(parts[0] if len(parts) == 1 else list(map(_joined, *parts)))


    def _detections_among(self, rows: list[list[str]], place: dict[str, int]) -> list[list[str]]:
        """Without rows that tell of an animal's release. Raises ValueError for a row in another time zone than UTC."""
        zone, receiver = self.layout.zone, self.layout.receiver
        if zone is not None:
            for row in rows:
                if row[place[zone]].strip().lower() not in _ZONE_IS_UTC:
                    raise ValueError(f"times must be in UTC, got {zone} {shown(row[place[zone]])}; export them so")
        if receiver is None:
            return rows
        return [row for row in rows if row[place[receiver]] != RELEASE]


def _joined(*parts: str) -> str:
    """Codespace and id as one name; none if a part is missing."""
    return "-".join(part.strip() for part in parts) if all(map(str.strip, parts)) else ""


def recognize(table: CsvTable) -> DetectionFile:
    """What kind of file this is.

    Raises:
        ValueError: for none of those above, with the columns needed and those found.
    """
    if table.columns and table.columns[0].startswith("#"):
        match = _RESNEP_FILE.fullmatch(table.path.name)
        if match is None:
            raise ValueError(f"{table.path}: begins with a comment; only files detections_RECEIVER_TAG.txt may")
        table.columns = RESNEP.columns
        return DetectionFile(table, RESNEP, match[1])
    if set(OWN.columns) <= set(table.columns):
        table.place(OWN.columns)
        return DetectionFile(table, OWN, None)
    layout = find_layout(table.columns)
    if layout is not None:
        table.place(layout.columns)
        return DetectionFile(table, layout, None)
    if len(table.columns) == 1 and ";" in table.columns[0]:
        raise ValueError(f"{table.path}: fields are divided by semicolons; save it as csv with commas, and points in numbers")
    plain = {_plain(name) for name in table.columns}
    local = [name for name in table.columns if is_time(name) and _plain(name) not in (*CORRECTED_TIMES, *ZONES)]
    if local and plain & set(RECEIVERS) and not plain & set(TIMES):
        raise ValueError(
            f"{table.path}: line 1: {local[0]!r} may be in a local time zone, which summer time shifts; export times in UTC, as "
            f"{VUE.time!r}, or name the offset, as 'Date and Time (UTC-05:00)'"
        )
    raise ValueError(
        f"{table.path}: line 1 must name the columns {','.join(OWN.columns)} (or those of an export of VUE, Fathom, GLATOS, OTN, "
        f"ETN, Thelma or actel), got {table.header}"
    )


def find_layout(columns: Sequence[str]) -> Layout | None:
    """Which columns tell time, receiver and tag, by their names; None where one of the three is not there."""
    by_name: dict[str, str] = {}
    for column in columns:
        by_name.setdefault(_plain(column), column)

    def first(names: Sequence[str]) -> str | None:
        return next((by_name[name] for name in names if name in by_name), None)

    time, receiver, offset = first(TIMES), first(RECEIVERS), 0.0
    if time is None:
        time, offset = next(((name, ahead) for name in columns if (ahead := zone_of_column(name)) is not None), (None, 0.0))
    tag = next((tuple(by_name[part] for part in parts) for parts in TAGS if all(part in by_name for part in parts)), None)
    if time is None or receiver is None or tag is None:
        return None
    return Layout(
        name="VUE" if (time, receiver, tag) == (VUE.time, VUE.receiver, VUE.tag) else f"{time}, {receiver}, {' and '.join(tag)}",
        time=time,
        receiver=receiver,
        tag=tag,
        corrected=first(CORRECTED_TIMES),
        zone=first(ZONES),
        to_seconds=partial(utc_seconds, zone=offset) if offset else utc_seconds,
    )


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def is_fathom(table: CsvTable) -> bool:
    return bool(table.columns) and table.columns[0].startswith("VEMCO DATA LOG")


def recognize_fathom(table: CsvTable) -> DetectionFile:
    """A Fathom (VDAT) log. Raises ValueError for one without detections."""
    rows = list(fathom_rows(table))
    layout = find_layout(table.columns)
    if layout is None:
        raise ValueError(f"{table.path}: DET_DESC must name time, receiver and tag, got {table.header}; export them")
    return DetectionFile(table, layout, None, rows)


def fathom_rows(table: CsvTable) -> Iterator[tuple[list[list[str]], Sequence[int]]]:
    """The detections of an open Fathom (VDAT) log, whose rows begin with their kind, and their lines; sets its columns.

    Raises:
        ValueError: where the log does not say what its detections' columns are.
    """
    columns: list[str] | None = None
    rows: list[list[str]] = []
    lines: list[int] = []
    for row, line in table.raw():
        if row and row[0] == "DET_DESC":
            columns = [name.strip() for name in row[1:]]
            table.columns = tuple(columns)
        elif row and row[0] == "DET":
            if columns is None:
                raise ValueError(f"{table.path}: line {line}: a detection before the line DET_DESC, which names its columns")
            rows.append((row[1:] + [""] * len(columns))[: len(columns)])
            lines.append(line)
    if columns is None:
        raise ValueError(f"{table.path}: a Fathom log without the line DET_DESC; export detections with it")
    yield rows, lines


def detection_files(path: Path) -> list[Path]:
    """The files a path stands for: itself, or the ``detections_RECEIVER_TAG.txt`` of a folder or of the folders in it.

    Raises:
        ValueError: for a folder without any.
    """
    if not path.is_dir():
        return [path]
    found = sorted(each for each in [*path.glob("*.txt"), *path.glob("*/*.txt")] if _RESNEP_FILE.fullmatch(each.name))
    if not found:
        raise ValueError(f"{path} holds no files detections_RECEIVER_TAG.txt; name csv files one by one")
    return found


def read_blocks(path: Path, receivers: Names, tags: Names) -> Iterator[tuple[Layout, Block]]:
    """All blocks of a file or folder. Raises ValueError where there is no detection at all."""
    empty = True
    for file in detection_files(path):
        with open_csv(file, "detection", OWN.columns, ragged=True) as table:
            source = recognize_fathom(table) if is_fathom(table) else recognize(table)
            for block in source.blocks(receivers, tags):
                empty = empty and not len(block[0])
                yield source.layout, block
    if empty:
        raise ValueError(f"{path} holds no detections; give one row for each")
