"""Reading for the array commands: what a file made the reader remark is told to the user."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tagtrack.baselines.static_array.detections import Detections
from tagtrack.baselines.static_array.model import Floats
from tagtrack.eval.telemetry import Plane, read_receivers, read_telemetry


def read_aloud(paths: Sequence[Path]) -> Detections:
    """The detections of files, after a line for each remark (rows dropped, times too coarse)."""
    reading = read_telemetry(paths)
    for remark in reading.remarks:
        print(f"note: {remark}")
    return reading.detections


def read_places(path: Path | None) -> tuple[dict[str, Floats], Plane | None]:
    """Places (2,) [m] of receivers by name, none without a file, and the plane of those that were in degrees."""
    if path is None:
        return {}, None
    known = read_receivers(path)
    return dict(zip(known.names, known.position, strict=True)), known.plane


def describe_plane(plane: Plane | None) -> str:
    """What the note below a table says of its x and y; nothing of those that a file gave."""
    return f"; x and y are metres east and north of lon {plane.longitude:.7f}, lat {plane.latitude:.7f}" if plane else ""
