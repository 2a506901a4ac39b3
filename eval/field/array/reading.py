"""Reading for the array commands: what a file made the reader remark is told to the user."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tagtrack.envs.model import import_object
from tagtrack.eval.field.static_array.detections import Detections, shorten
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.telemetry import Plane, ReceiverPlaces, read_receivers, read_telemetry


def read_aloud(paths: Sequence[Path], layout: str | None = None) -> Detections:
    """The detections of files, after a line for each remark (rows dropped, times too coarse).

    Args:
        layout: ``MODULE:FUNCTION`` that reads a file of the user's own kind; None for the kinds that are known.
    """
    reader = None if layout is None else import_object(layout)
    reading = read_telemetry(paths, reader)
    for remark in reading.remarks:
        print(f"note: {remark}")
    return reading.detections


def fit_names(detections: Detections, names: Sequence[str], source: Path) -> Detections:
    """The detections under the names that a table gives receivers: by serial number alone, or with the model before it.

    Says which receivers are in one of both only, and how many detections that leaves out.

    Raises:
        ValueError: where no receiver is in both.
    """
    known = set(names)
    by_serial = {name.rpartition("-")[2]: name for name in names}
    fitted = []
    for name in detections.receivers:
        other = by_serial.get(name.rpartition("-")[2])
        one_is_bare = other is not None and (other == name.rpartition("-")[2] or name == other.rpartition("-")[2])
        free = other not in detections.receivers
        fitted.append(other if name not in known and one_is_bare and free and other is not None else name)
    if len(set(fitted)) < len(fitted):
        fitted = list(detections.receivers)
    heard = [name for name in names if name in fitted]
    if not heard:
        there = shorten(detections.receivers)
        raise ValueError(f"no receiver of {source} ({shorten(tuple(names))}) is in the detections ({there})")
    strange = [place for place, name in enumerate(fitted) if name not in known]
    if strange:
        count = int(np.isin(detections.receiver, strange).sum())
        listed = shorten(tuple(fitted[place] for place in strange))
        print(f"note: {count} detections of {listed} are left out: not in {source}")
    if silent := [name for name in names if name not in fitted]:
        print(f"note: no detections of {shorten(tuple(silent))}")
    return replace(detections, receivers=tuple(fitted))


def by_deployment(detections: Detections, places: ReceiverPlaces) -> Detections:
    """The detections with the receivers numbered as ``places`` has them, at the place where each stood then.

    Without those by receivers that are not there, and, after a note, by ones that did not stand anywhere at that time.
    """
    receiver = np.full(len(detections.time), -1, np.int32)
    strange = np.zeros(len(detections.time), bool)
    for number, name in enumerate(detections.receivers):
        own = detections.receiver == number
        rows = [k for k, called in enumerate(places.called) if called == name]
        for k in rows:
            start, stop = places.periods[k] if places.periods else (-np.inf, np.inf)
            receiver[own & (detections.time >= start) & (detections.time < stop)] = k
        strange |= own & (receiver < 0) & bool(rows)
    if strange.any():
        print(f"note: {int(strange.sum())} detections are left out: their receivers were not deployed then")
    kept = receiver >= 0
    return Detections(
        time=detections.time[kept],
        receiver=receiver[kept],
        tag=detections.tag[kept],
        receivers=places.names,
        tags=detections.tags,
    )


def read_places(path: Path | None) -> tuple[dict[str, Floats], Plane | None]:
    """Places (2,) [m] of receivers by name, none without a file, and the plane of those that were in degrees."""
    if path is None:
        return {}, None
    known = read_receivers(path)
    if moved := [name for name, serial in zip(known.names, known.called, strict=True) if name != serial]:
        raise ValueError(f"{path}: {moved[0]}: here each receiver has one place; give its deployments one at a time")
    return dict(zip(known.names, known.position, strict=True)), known.plane


def describe_plane(plane: Plane | None) -> str:
    """What the note below a table says of its x and y; nothing of those that a file gave."""
    return f"; x and y are metres east and north of lon {plane.longitude:.7f}, lat {plane.latitude:.7f}" if plane else ""
