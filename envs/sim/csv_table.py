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
_SHOWN = 200  # characters of a header in an error message


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
            raise ValueError(f"{self.where}: {column} must be a number, got {text!r}") from None
        if not math.isfinite(value):
            raise ValueError(f"{self.where}: {column} must be finite, got {text!r}")
        return value

    def name(self, column: str) -> str:
        """A name, without the blanks around it. Raises ValueError if it is empty or cannot be printed."""
        try:
            return printable_name(self.field[column], column)
        except ValueError as error:
            raise ValueError(f"{self.where}: {error}") from None


def printable_name(text: str, column: str) -> str:
    """The name in a field, without the blanks around it.

    Raises:
        ValueError: if it is empty, or holds control characters or bytes that are not UTF-8.
    """
    name = text.strip()
    if not name:
        raise ValueError(f"{column} must not be empty")
    if not name.isprintable():
        raise ValueError(f"{column} must be printable text in UTF-8, got {name!r:.{_SHOWN}}")
    return name


class CsvTable:
    """An open csv file: the fields of its first line, and then its rows, once."""

    def __init__(self, path: Path, lines: Iterator[str]) -> None:
        self.path = path
        self._reader = csv.reader(lines, strict=True)
        self.columns: tuple[str, ...] = ()
        for fields in self._guarded():
            if fields:
                self.columns = tuple(name.strip() for name in fields)
                return
        raise ValueError(f"{path} is empty; its first line must name the columns")

    def place(self, columns: Sequence[str]) -> list[int]:
        """Where these columns stand. Raises ValueError that lists the columns needed and those found."""
        missing = [name for name in columns if name not in self.columns]
        if missing:
            raise ValueError(f"{self.path}: line 1 must name the columns {','.join(columns)}, got {self.header}")
        twice = [name for name in columns if self.columns.count(name) > 1]
        if twice:
            raise ValueError(f"{self.path}: line 1 names {twice[0]} twice; remove one")
        return [self.columns.index(name) for name in columns]

    @property
    def header(self) -> str:
        """The first line, as an error message shows it."""
        text = ",".join(self.columns)
        return text[:_SHOWN] if text.isprintable() else f"{text!r:.{_SHOWN}}"

    def rows(self, columns: Sequence[str]) -> Iterator[Row]:
        """Row by row, these columns of it."""
        places = self.place(columns)
        for block, first_line in self.blocks(1 << 12):
            line = first_line
            for fields in block:
                line += line_breaks(fields)
                yield Row({name: fields[at] for name, at in zip(columns, places, strict=True)}, f"{self.path}: line {line}")
                line += 1

    def blocks(self, size: int) -> Iterator[tuple[list[list[str]], int]]:
        """Up to ``size`` rows at a time, each with as many fields as the first line, and the line of the first row.

        Raises:
            ValueError: for a row with another number of fields, or what is no csv text or a damaged gzip file.
        """
        width = len(self.columns)
        rows = self._guarded()
        while True:
            line = self._reader.line_num + 1
            block = list(itertools.islice(rows, size))
            if not block:
                return
            if set(map(len, block)) == {width}:
                yield block, line
            else:
                yield from self._even_out(block, line, width)

    def _even_out(self, block: list[list[str]], line: int, width: int) -> Iterator[tuple[list[list[str]], int]]:
        """The rows of a block one by one, without blank lines and without empty fields past the last column."""
        for fields in block:
            line += line_breaks(fields)
            if fields:
                if len(fields) < width or any(fields[width:]):
                    where = f"{self.path}: line {line}"
                    raise ValueError(f"{where}: expected {width} fields as in line 1, got {len(fields)}")
                yield [fields[:width]], line - line_breaks(fields)
            line += 1

    def _guarded(self) -> Iterator[list[str]]:
        """Rows as the csv module gives them, its troubles and those of the file below as one kind of error."""
        try:
            yield from self._reader
        except csv.Error as error:
            raise ValueError(f"{self.path}: line {self._reader.line_num}: not a csv text file ({error})") from None
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            line = self._reader.line_num
            raise ValueError(f"{self.path}: damaged gzip file after line {line} ({error}); copy it again") from None


def line_breaks(fields: Sequence[str]) -> int:
    """How many line ends stand inside (quoted) fields: by so much a row ends below the line it began on."""
    return sum(len(_LINE_END.findall(text)) for text in fields if "\n" in text or "\r" in text)


@contextmanager
def open_csv(path: str | Path, asked: str = "a csv file") -> Iterator[CsvTable]:
    """Open a csv file, plain or gzip.

    Args:
        asked: what the caller wants, for the message where there is none.
    Raises:
        FileNotFoundError: where there is no such file.
        ValueError: if it is empty, or no csv text.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no file {path}; give {asked}")
    with path.open("rb") as file:
        packed = file.read(2) == _GZIP
        file.seek(0)
        content = cast(BinaryIO, gzip.GzipFile(fileobj=file)) if packed else file
        # Bytes that are not UTF-8 become lone surrogates: harmless in a column nobody reads, refused in a name.
        text = io.TextIOWrapper(content, encoding="utf-8-sig", errors="surrogateescape", newline="")
        yield CsvTable(path, _lines(path, text))


def _lines(path: Path, text: io.TextIOWrapper) -> Iterator[str]:
    number = 1
    while line := text.readline(_LONGEST_LINE):
        if len(line) == _LONGEST_LINE or "\0" in line:
            raise ValueError(f"{path}: line {number}: not a csv text file; save it as csv in UTF-8")
        yield line
        number += 1
