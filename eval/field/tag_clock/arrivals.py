"""Arrival records: what code a receiver heard, and when. As arrays, and as csv files with columns ``t_s,code``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tagtrack.envs.csv_table import Row, open_csv, shown

ARRIVAL_COLUMNS = ("t_s", "code")


@dataclass(frozen=True)
class Arrivals:
    """What a receiver heard, in order: ``time`` (N,) on its own clock [s], and ``code`` (N,), the number of each code."""

    time: NDArray[np.float64]
    code: NDArray[np.int64]

    def of_code(self, code: int) -> NDArray[np.float64]:
        """Times (M,) at which one code arrived [s]."""
        return self.time[self.code == code]

    @property
    def codes(self) -> list[int]:
        """The codes that were heard, in rising order."""
        return [int(code) for code in np.unique(self.code)]


def write_arrivals(path: str | Path, arrivals: Arrivals) -> None:
    """Write a csv file as ``read_arrivals`` takes it, the times to 1e-6 s."""
    rows = [f"{time:.6f},{code}\n" for time, code in zip(arrivals.time, arrivals.code, strict=True)]
    Path(path).write_text(",".join(ARRIVAL_COLUMNS) + "\n" + "".join(rows), encoding="utf-8")


def read_arrivals(path: str | Path) -> Arrivals:
    """Read a csv file of arrivals; columns beside ``t_s,code`` are ignored.

    Gaps are no mistake: nothing may have been heard for hours.

    Raises:
        ValueError: for missing columns, no rows, a time that is no finite number, a code that is no whole number, times that
            fall, or the same code twice at one time; the message names file and line.
        FileNotFoundError: where there is no such file.
    """
    rows: list[tuple[float, int]] = []
    heard: dict[int, float] = {}  # the last time of each code
    with open_csv(path, "arrival", ARRIVAL_COLUMNS) as table:
        for row in table.rows(ARRIVAL_COLUMNS):
            time, code = row.number("t_s"), _read_code(row)
            _require_later(time, rows[-1][0] if rows else -math.inf, code, heard, row.where)
            rows.append((time, code))
            heard[code] = time
    if not rows:
        raise ValueError(f"{path} holds no arrivals; give one row for each code that was heard")
    return Arrivals(np.array([time for time, _ in rows]), np.array([code for _, code in rows], dtype=np.int64))


def _read_code(row: Row) -> int:
    text = row.field["code"]
    try:
        code = int(text)
    except ValueError:
        code = -1
    if not 0 <= code < 2**31:
        raise ValueError(f"{row.where}: code must be a whole number from 0 to {2**31 - 1}, got {shown(text)}")
    return code


def _require_later(time: float, last: float, code: int, heard: dict[int, float], where: str) -> None:
    if time < last:
        raise ValueError(f"{where}: times must rise, got {time:.5f} after {last:.5f}; sort the file")
    if time == heard.get(code):
        raise ValueError(f"{where}: code {code} arrives twice at {time:.5f} s; remove the duplicate")
