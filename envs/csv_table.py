"""Csv files as rows of text with their line numbers: the one place that opens them, and says where they are wrong.

Plain or gzip (known by its first bytes, not by the name), UTF-8 with or without a byte order mark, any line ends, quoted
fields. Blank lines are passed over. What the fields mean is for the readers above.
"""

from __future__ import annotations

import csv
import gzip
import io
import itertools
import math
import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, cast

_GZIP = b"\x1f\x8b"
_LINE_END = re.compile(r"\r\n|\r|\n")
_LONGEST_LINE = 1 << 20  # characters: what is longer is no csv
_SHOWN = 200  # characters of a field in an error message
_MOST_ROWS = 10_000_000  # of a table that is read row by row: 2 GB in memory
_SWELLS, _MOST_SWOLLEN = 1 << 26, 200  # a gzip file may unpack to the first [characters], or so many times its size; data do 30
_FORMULA = ("=", "+", "-", "@")  # what a spreadsheet takes a cell for a formula by


@dataclass(frozen=True)
class Row:
    """One row: its fields by column, and where it stands (``track.csv: line 7``), for error messages."""

    field: dict[str, str]
    where: str

    def number(self, column: str) -> float:
        """A finite number. Raises ValueError that names file, line and value."""
        text = self.field[column]
        try:
            value = float(text)
        except ValueError:
            raise ValueError(f"{self.where}: {column} must be a number, got {shown(text)}") from None
        if not math.isfinite(value):
            raise ValueError(f"{self.where}: {column} must be finite, got {shown(text)}")
        return value

    def name(self, column: str) -> str:
        """A name, without the blanks around it. Raises ValueError if it is empty or cannot be printed."""
        try:
            return printable_name(self.field[column], column)
        except ValueError as error:
            raise ValueError(f"{self.where}: {error}") from None


def shown(text: str) -> str:
    """A field as an error message shows it: quoted, on one line, and not all of a long one."""
    return repr(text) if len(text) <= _SHOWN else f"{text[:_SHOWN]!r}..."


def printable_name(text: str, column: str) -> str:
    """The name in a field, without the blanks around it.

    Raises:
        ValueError: if it is empty, or holds control characters or bytes that are not UTF-8.
    """
    name = text.strip()
    if name.startswith("'") and _is_formula(name):
        name = name[1:]  # as ``name_cell`` wrote it
    if not name:
        raise ValueError(f"{column} must not be empty")
    if not name.isprintable():
        raise ValueError(f"{column} must be printable text in UTF-8, got {shown(name)}")
    return name


def name_cell(name: str) -> str:
    """A name as it is written into a csv file: no spreadsheet takes it for a formula. ``printable_name`` reads it back."""
    return f"'{name}" if _is_formula(name) else name


def _is_formula(name: str) -> bool:
    """Whether a spreadsheet would take it for one, or it looks like one that was kept from being one."""
    return name.lstrip("'").startswith(_FORMULA)


def name_field(name: str) -> str:
    """The same with quotes where it holds a comma or quotes, for a line that is put together by hand."""
    cell = name_cell(name)
    return '"' + cell.replace('"', '""') + '"' if set(cell) & set(',"') else cell


class CsvTable:
    """An open csv file: the fields of its first line, and then its rows, once. Lines ``# name: value`` before are ``remarks``."""

    def __init__(self, path: Path, lines: Iterator[str], *, ragged: bool = False) -> None:
        self.path = path
        self.ragged = ragged
        self._reader = csv.reader(lines, strict=True)
        self.columns: tuple[str, ...] = ()  # none: an empty file
        self.remarks: dict[str, str] = {}
        for fields in self._guarded():
            name, colon, value = ",".join(fields).partition(":")
            if colon and name.startswith("#"):
                self.remarks[name[1:].strip()] = value.strip()
            elif fields:
                self.columns = tuple(name.strip() for name in fields)
                break

    def place(self, columns: Sequence[str]) -> list[int]:
        """Where these columns stand. Raises ValueError that lists the columns needed and those found."""
        if not set(columns) <= set(self.columns):
            needed = ",".join(columns)
            raise ValueError(f"{self.path}: line 1 must name the columns {needed}, got {self.header}; rename or add them")
        for name in columns:
            if self.columns.count(name) > 1:
                raise ValueError(f"{self.path}: line 1 names {name} twice; remove one of these columns")
        return [self.columns.index(name) for name in columns]

    @property
    def header(self) -> str:
        """The first line, as an error message shows it."""
        text = ",".join(self.columns) or "nothing"
        return text if text.isprintable() and len(text) <= _SHOWN else shown(text)

    def rows(self, columns: Sequence[str]) -> Iterator[Row]:
        """Row by row, these columns of it."""
        places = self.place(columns)
        for block, lines in self.blocks(1 << 12):
            if lines[-1:] and lines[-1] > _MOST_ROWS:
                raise ValueError(f"{self.path} has more than {_MOST_ROWS:,} rows; divide it")
            for fields, line in zip(block, lines, strict=True):
                yield Row({name: fields[at] for name, at in zip(columns, places, strict=True)}, f"{self.path}: line {line}")

    def blocks(self, size: int) -> Iterator[tuple[list[list[str]], Sequence[int]]]:
        """Up to ``size`` rows at a time, each with as many fields as there are columns, and the line on which each ends.

        Raises:
            ValueError: for a row with another number of fields, or what is no csv text or a damaged gzip file.
        """
        rows = self._guarded()
        while True:
            begin = self._reader.line_num + 1
            block = list(itertools.islice(rows, size))
            if not block:
                return
            lines: Sequence[int] = range(begin, begin + len(block))
            if self._reader.line_num >= begin + len(block):  # line ends inside of quotes
                lines = list(itertools.accumulate((1 + _line_ends(fields) for fields in block), initial=begin - 1))[1:]
            if set(map(len, block)) != {len(self.columns)}:
                block, lines = self._even_out(block, lines)
            yield block, lines

    def raw(self) -> Iterator[tuple[list[str], int]]:
        """Rows of whatever length, with the line on which each ends."""
        for fields in self._guarded():
            yield fields, self._reader.line_num

    def _even_out(self, block: list[list[str]], lines: Sequence[int]) -> tuple[list[list[str]], Sequence[int]]:
        """A block without blank lines, and without empty fields past the last column."""
        width = len(self.columns)
        kept = [index for index, fields in enumerate(block) if fields]
        for index in kept:
            got = len(block[index])
            if (got < width and not self.ragged) or any(block[index][width:]):
                raise ValueError(f"{self.path}: line {lines[index]}: expected {width} fields as in line 1, got {got}")
            block[index] += [""] * (width - got)
        return [block[index][:width] for index in kept], [lines[index] for index in kept]

    def _guarded(self) -> Iterator[list[str]]:
        """Rows as the csv module gives them, its troubles and those of the file below as one kind of error."""
        try:
            yield from self._reader
        except csv.Error as error:
            raise ValueError(f"{self.path}: line {self._reader.line_num}: not a csv text file ({error})") from None
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            line = self._reader.line_num
            raise ValueError(f"{self.path}: damaged gzip file after line {line} ({error}); copy it again") from None


def _line_ends(fields: Sequence[str]) -> int:
    return sum(len(_LINE_END.findall(text)) for text in fields)


@contextmanager
def open_csv(path: str | Path, kind: str, columns: Sequence[str], *, ragged: bool = False) -> Iterator[CsvTable]:
    """Open a csv file, plain or gzip.

    Args:
        kind: what it is (track) and the columns it should have, for the message where there is none.
        ragged: rows may end before the last columns, which are then empty.
    Raises:
        FileNotFoundError: where there is no such file.
        ValueError: if it is no csv text.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no {kind} file {path}; give a csv with columns {','.join(columns)}")
    with path.open("rb") as file:
        packed = file.read(2) == _GZIP
        file.seek(0)
        content = cast(BinaryIO, gzip.GzipFile(fileobj=file)) if packed else file
        # Bytes that are not UTF-8 become lone surrogates: harmless in a column nobody reads, refused in a name.
        text = io.TextIOWrapper(content, encoding="utf-8-sig", errors="surrogateescape", newline="")
        most = max(_SWELLS, _MOST_SWOLLEN * path.stat().st_size) if packed else math.inf
        yield CsvTable(path, _lines(path, text, most), ragged=ragged)


def _lines(path: Path, text: io.TextIOWrapper, most: float) -> Iterator[str]:
    number, read = 1, 0
    while line := text.readline(_LONGEST_LINE):
        read += len(line)
        if read > most:
            raise ValueError(
                f"{path}: unpacks to more than {_MOST_SWOLLEN} times its size, as no data do; if it is sound, give it unpacked"
            )
        if len(line) == _LONGEST_LINE or "\0" in line:
            raise ValueError(f"{path}: line {number}: not a csv text file; save it as csv in UTF-8")
        yield line
        number += 1
