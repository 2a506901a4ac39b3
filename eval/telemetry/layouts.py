"""The kinds of detection files, told apart by their first line, and their rows as numbers.

Read are our own csv, the csv exports of VEMCO VUE and of GLATOS, and the text files of the RESNEP campaign (Masmitja et al.
2020), one for each receiver and tag. Refused are Fathom (VDAT) logs, whose kinds of records each have columns of their own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tagtrack.baselines.static_array.detections import Codes, Floats
from tagtrack.envs.csv_table import CsvTable, open_csv, printable_name, shown

LATEST = 1e11  # s since 1970: later times (year 5138) are in another unit
BLOCK = 1 << 16  # rows read at a time: some 20 MB as text
_UTC = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(\.\d{1,6})?", re.ASCII)
_RESNEP_FILE = re.compile(r"detections_([^_]+)_.+\.txt")

Block = tuple[Floats, Codes, Codes]


def unix_seconds(texts: Sequence[str]) -> Floats:
    """Seconds since 1970. The error speaks of the first text: it is for the reader who has narrowed it down to one row."""
    try:
        time = np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        raise ValueError(f"the time must be in seconds since 1970, got {shown(texts[0])}") from None
    if not ((time >= 0) & (time < LATEST)).all():
        raise ValueError(f"the time must be in seconds since 1970, from 0 to {LATEST:.0e}, got {shown(texts[0])}")
    return time


def utc_seconds(texts: Sequence[str]) -> Floats:
    """Seconds since 1970 of times in UTC, as the nearest float64: 2019-09-09 16:04:12.574 is 1568045052.574."""
    try:
        if all(map(_UTC.fullmatch, texts)):
            time = np.array(texts, dtype="datetime64[us]").astype(np.int64) / 1e6
            if (time >= 0).all():
                return time
    except ValueError:  # the 30th of February
        pass
    raise ValueError(f"the time must be in UTC from 1970 on, like 2019-09-09 16:04:11.123, got {shown(texts[0])}")


@dataclass(frozen=True, kw_only=True)
class Layout:
    """One kind of file: which columns tell time, receiver and tag (its parts are joined by a hyphen)."""

    name: str
    time: str
    receiver: str | None  # None: the name of the file tells
    tag: tuple[str, ...]
    to_seconds: Callable[[Sequence[str]], Floats] = utc_seconds

    @property
    def columns(self) -> tuple[str, ...]:
        return (self.time, *([self.receiver] if self.receiver else []), *self.tag)


OWN = Layout(name="csv", time="t_unix_s", receiver="receiver", tag=("tag",), to_seconds=unix_seconds)
VUE = Layout(name="VUE", time="Date and Time (UTC)", receiver="Receiver", tag=("Transmitter",))
GLATOS = Layout(
    name="GLATOS",
    time="detection_timestamp_utc",
    receiver="receiver_sn",
    tag=("transmitter_codespace", "transmitter_id"),
)
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

    def blocks(self, receivers: Names, tags: Names) -> Iterator[Block]:
        """Times and numbers of receivers and tags, block by block.

        Raises:
            ValueError: for a row that is no detection; names file, line and value.
        """
        for rows, lines in self.table.blocks(BLOCK):
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
        time = self.layout.to_seconds([row[place[self.layout.time]] for row in rows])
        if self.layout.receiver is None:
            heard_by = np.full(len(rows), receivers[self.receiver or ""], np.int32)
        else:
            heard_by = receivers.codes([row[place[self.layout.receiver]] for row in rows])
        parts = [[row[place[name]] for row in rows] for name in self.layout.tag]
        return time, heard_by, tags.codes(parts[0] if len(parts) == 1 else list(map(_joined, *parts)))


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
    for layout in (OWN, VUE, GLATOS):
        if set(layout.columns) <= set(table.columns):
            table.place(layout.columns)
            return DetectionFile(table, layout, None)
    if table.columns and table.columns[0].startswith("VEMCO DATA LOG"):
        raise ValueError(f"{table.path}: a Fathom (VDAT) log; export with VUE, or write {','.join(OWN.columns)}")
    if VUE.time not in table.columns and any(name.startswith("Date and Time") for name in table.columns):
        raise ValueError(f"{table.path}: line 1 must name the column {VUE.time}, got {table.header}; export times in UTC")
    raise ValueError(
        f"{table.path}: line 1 must name the columns {','.join(OWN.columns)} (or those of a VUE or GLATOS export), "
        f"got {table.header}"
    )


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
        with open_csv(file, "detection", OWN.columns) as table:
            source = recognize(table)
            for block in source.blocks(receivers, tags):
                empty = empty and not len(block[0])
                yield source.layout, block
    if empty:
        raise ValueError(f"{path} holds no detections; give one row for each")
