"""Detections from csv files of several kinds, read in blocks: a campaign of 10^7 rows needs little more than its arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tagtrack.baselines.static_array.detections import Codes, Detections, Floats
from tagtrack.envs.sim.csv_table import CsvTable, line_breaks, open_csv, printable_name

COLUMNS = ("t_unix_s", "receiver", "tag")
LATEST = 1e11  # s since 1970: times beyond it (the year 5138) are in another unit
_BLOCK = 1 << 18  # rows

Block = tuple[Floats, Codes, Codes]


class Names(dict[str, int]):
    """Numbers names in the order they are first met; a field seen before costs one look-up."""

    def __init__(self, column: str) -> None:
        self.column = column
        self.names: dict[str, int] = {}

    def __missing__(self, text: str) -> int:
        name = printable_name(text, self.column)
        self[text] = code = self.names.setdefault(name, len(self.names))
        return code

    def codes(self, texts: Sequence[str]) -> Codes:
        return np.fromiter(map(self.__getitem__, texts), np.int32, len(texts))


def read_detections(paths: Sequence[Path]) -> Detections:
    """Detections of all the files, in order of time and then of receiver and tag; each of them once.

    Receivers and tags are in alphabetical order, so that the result does not depend on the order of files and rows.

    Raises:
        ValueError: for a file that holds no detections, or a row that is none; names file and line.
        FileNotFoundError: where there is no such file.
    """
    receivers, tags = Names("receiver"), Names("tag")
    blocks = [block for path in paths for block in _read_csv(Path(path), receivers, tags)]
    return _in_order(blocks, receivers, tags)


def _read_csv(path: Path, receivers: Names, tags: Names) -> Iterator[Block]:
    with open_csv(path, f"a csv with columns {','.join(COLUMNS)}") as table:
        places = table.place(COLUMNS)
        empty = True
        for rows, line in table.blocks(_BLOCK):
            empty = False
            try:
                block = _convert(rows, places, receivers, tags)
            except ValueError:
                _name_bad_row(table, rows, line, places, receivers, tags)
                raise
            yield block
        if empty:
            raise ValueError(f"{path} holds no detections; give one row for each")


def _convert(rows: list[list[str]], places: Sequence[int], receivers: Names, tags: Names) -> Block:
    time, receiver, tag = ([row[at] for row in rows] for at in places)
    return seconds(time), receivers.codes(receiver), tags.codes(tag)


def _name_bad_row(
    table: CsvTable, rows: list[list[str]], line: int, places: Sequence[int], receivers: Names, tags: Names
) -> None:
    for row in rows:
        line += line_breaks(row)
        try:
            _convert([row], places, receivers, tags)
        except ValueError as error:
            raise ValueError(f"{table.path}: line {line}: {error}") from None
        line += 1


def seconds(texts: Sequence[str]) -> Floats:
    """Times in seconds since 1970 from their text; the error speaks of the first one: it is meant for a single row."""
    try:
        time = np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        raise ValueError(f"t_unix_s must be a number of seconds since 1970, got {texts[0]!r}") from None
    if not ((time >= 0) & (time < LATEST)).all():
        raise ValueError(f"t_unix_s must be seconds since 1970 from 0 to {LATEST:.0e}, got {texts[0]!r}")
    return time


def _in_order(blocks: list[Block], receivers: Names, tags: Names) -> Detections:
    columns = [list(column) for column in zip(*blocks, strict=True)] if blocks else [[], [], []]
    blocks.clear()
    time = _joined(columns[0], np.float64)
    receiver = _alphabetical(receivers)[_joined(columns[1], np.int32)]
    tag = _alphabetical(tags)[_joined(columns[2], np.int32)]
    order = np.lexsort((tag, receiver, time))
    time, receiver, tag = time[order], receiver[order], tag[order]
    kept = np.ones(len(time), dtype=bool)
    kept[1:] = (np.diff(time) != 0) | (np.diff(receiver) != 0) | (np.diff(tag) != 0)
    return Detections(
        time=time, receiver=receiver, tag=tag, receivers=tuple(sorted(receivers.names)), tags=tuple(sorted(tags.names))
    ).take(kept)


def _joined(parts: list[NDArray], dtype: type) -> NDArray:
    """Parts in one array; they are let go."""
    joined = np.concatenate(parts) if parts else np.empty(0, dtype)
    parts.clear()
    return joined


def _alphabetical(names: Names) -> Codes:
    """(N,): where each name stands among all in alphabetical order."""
    return np.argsort(np.argsort(np.array(list(names.names), dtype=str))).astype(np.int32)
