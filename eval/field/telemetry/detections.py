"""Detections from files of several kinds, in order and each once; and back to a csv.

Files are read in blocks, so that a campaign of 10^7 rows needs some three times its arrays (16 bytes a row).
"""

from __future__ import annotations

import csv
import gzip
import io
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from tagtrack.envs.csv_table import name_cell
from tagtrack.eval.field.static_array.detections import Codes, Detections
from tagtrack.eval.field.telemetry.layouts import OWN, Block, Names, read_blocks
from tagtrack.eval.field.telemetry.stamps import LATEST, name_days
from tagtrack.eval.field.telemetry.zones import remark_on_zones
from tagtrack.policies.files import replace_file

_BLOCK = 1 << 16  # rows written at a time


@dataclass(frozen=True, kw_only=True)
class Reading:
    """What files held: the detections, and what a person should know of them."""

    detections: Detections
    rows: int
    duplicates: int  # rows dropped: same time, receiver and tag as another
    layouts: tuple[str, ...]  # csv, VUE, GLATOS, RESNEP: the kinds of files met

    @property
    def remarks(self) -> list[str]:
        """Sentences for the user; none where all is as it should be."""
        remarks = []
        if self.duplicates:
            remarks.append(f"{self.duplicates} of {self.rows} rows repeat another (time, receiver, tag) and were dropped")
        time = self.detections.time
        if (time == np.floor(time)).all():
            remarks.append("all times are whole seconds: sound travels 1.5 km in one, too far to localize anything")
        if days := name_days(float(time[0]), float(time[-1])):
            remarks.append(f"times from {time[0]:.2f} to {time[-1]:.2f} s, all in 1970, look like {days}: if so, give seconds")
        return remarks + remark_on_zones(self.detections)


def read_detections(paths: Sequence[Path]) -> Detections:
    """Detections as ``read_telemetry`` reads them; its remarks become warnings."""
    reading = read_telemetry(paths)
    for remark in reading.remarks:
        warnings.warn(remark, stacklevel=2)
    return reading.detections


Reader = Callable[[Path], tuple[Sequence[float], Sequence[str], Sequence[str]]]


def read_telemetry(paths: Sequence[Path], reader: Reader | None = None) -> Reading:
    """All detections of these files, in order of time, then of receiver and tag; each once, whatever the order of the rows.

    Receivers and tags are listed in alphabetical order. Names stand as in the files: a VUE export says ``VR2W-128344``, so
    must a table of receivers.

    Args:
        paths: csv files, plain or gzip, with columns ``t_unix_s,receiver,tag`` (seconds since 1970) among any others, or as
            exported by VUE, Fathom, GLATOS, OTN, ETN, Thelma or actel (``layouts.py``); or folders in the form of the RESNEP
            campaign: ``..._BS1/detections_BS1_TAG.txt``.
        reader: for files of another kind: takes a path, returns times (N,) [s since 1970], and N names of receivers and of tags.
    Raises:
        ValueError: for a file that is none of these or holds no detection, and for a row without a finite time from 1970
            on, a receiver and a tag; names file and line.
        FileNotFoundError: where there is no such file.
    """
    if not paths:
        raise ValueError("give at least one file of detections")
    receivers, tags = Names("receiver"), Names("tag")
    blocks: list[Block] = []
    layouts: dict[str, None] = {}
    for path in paths:
        if reader is not None:
            blocks.append(_read_own(Path(path), reader, receivers, tags))
            continue
        for layout, block in read_blocks(Path(path), receivers, tags):
            layouts[layout.name] = None
            blocks.append(block)
    detections = _in_order(blocks, receivers, tags)
    rows = len(detections.time)
    detections = _each_once(detections)
    return Reading(
        detections=detections, rows=rows, duplicates=rows - len(detections.time), layouts=tuple(layouts)
    )


def _read_own(path: Path, reader: Reader, receivers: Names, tags: Names) -> Block:
    """What a user's own reader makes of a file. Raises ValueError for something that is no detections."""
    name = getattr(reader, "__name__", repr(reader))
    found = reader(path)
    if not (isinstance(found, tuple) and len(found) == 3):
        raise ValueError(f"{name} must return times, receivers and tags of {path}, got {type(found).__name__}")
    lengths = [len(column) for column in found]
    if len(set(lengths)) > 1 or not lengths[0]:
        raise ValueError(f"{name} must return one time, receiver and tag for each detection of {path}, got {lengths}")
    time = np.asarray(found[0], dtype=np.float64)
    if not ((time >= 0) & (time < LATEST)).all():
        wrong = time[~((time >= 0) & (time < LATEST))][0]
        raise ValueError(f"{name}: times of {path} must be in seconds since 1970, from 0 to {LATEST:.0e}, got {wrong:g}")
    return time, receivers.codes([str(each) for each in found[1]]), tags.codes([str(each) for each in found[2]])


def _in_order(blocks: list[Block], receivers: Names, tags: Names) -> Detections:
    """Blocks as one, sorted. ``blocks`` is emptied on the way, column by column, to hold no row twice for long."""
    times, heard_by, sent_by = (list(column) for column in zip(*blocks, strict=True))
    blocks.clear()
    time = _concatenated(times)
    receiver = _concatenated(heard_by, _alphabetical(receivers))
    tag = _concatenated(sent_by, _alphabetical(tags))
    if not (time[1:] > time[:-1]).all():
        order = np.lexsort((tag, receiver, time))
        time = time[order]
        receiver = receiver[order]
        tag = tag[order]
    return Detections(
        time=time, receiver=receiver, tag=tag, receivers=tuple(sorted(receivers.names)), tags=tuple(sorted(tags.names))
    )


def _concatenated(parts: list[NDArray], places: Codes | None = None) -> NDArray:
    """Parts as one array, numbers changed to their ``places``; the parts are let go."""
    whole = np.concatenate(parts if places is None else [places[part] for part in parts])
    parts.clear()
    return whole


def _alphabetical(names: Names) -> Codes:
    """(N,): where each name stands among all in alphabetical order."""
    place = {name: index for index, name in enumerate(sorted(names.names))}
    return np.array([place[name] for name in names.names], dtype=np.int32)


def _each_once(detections: Detections) -> Detections:
    """Without those that repeat the one before."""
    new = np.ones(len(detections.time), dtype=bool)
    new[1:] = detections.time[1:] != detections.time[:-1]
    new[1:] |= detections.receiver[1:] != detections.receiver[:-1]
    new[1:] |= detections.tag[1:] != detections.tag[:-1]
    return detections if new.all() else detections.take(new)


def write_detections(path: str | Path, detections: Detections) -> None:
    """Write a csv as ``read_detections`` takes it, gzip if the name ends in ``.gz``; times to the last bit (2.4e-7 s).

    Raises:
        OSError: if it cannot be written; an old file then stays.
    """
    receivers, tags = (np.array([*map(name_cell, names)], dtype=object) for names in (detections.receivers, detections.tags))
    with replace_csv(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(OWN.columns)
        for begin in range(0, len(detections.time), _BLOCK):
            part = slice(begin, begin + _BLOCK)
            names = receivers[detections.receiver[part]], tags[detections.tag[part]]
            writer.writerows(zip(detections.time[part].tolist(), *names, strict=True))


@contextmanager
def replace_csv(path: str | Path) -> Iterator[TextIO]:
    """A text file to write, gzip if its name ends in ``.gz``; it takes the place of ``path`` when the block is done."""
    with replace_file(path) as partial, partial.open("wb") as raw:
        # No name and no time in the gzip head: equal data make equal files.
        packed = gzip.GzipFile(filename="", fileobj=raw, mode="wb", mtime=0) if partial.suffix == ".gz" else None
        with io.TextIOWrapper(packed or raw, encoding="utf-8", newline="") as file:
            yield file
