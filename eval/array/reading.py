"""Reading for the array commands: what a file made the reader remark is told to the user."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tagtrack.baselines.static_array.detections import Detections
from tagtrack.baselines.static_array.model import Floats
from tagtrack.eval.telemetry import read_receivers, read_telemetry


def read_aloud(paths: Sequence[Path]) -> Detections:
    """The detections of files, after a line for each remark (rows dropped, times too coarse)."""
    reading = read_telemetry(paths)
    for remark in reading.remarks:
        print(f"note: {remark}")
    return reading.detections


def read_places(path: Path | None) -> dict[str, Floats]:
    """Places (2,) [m] of receivers by name; none without a file."""
    if path is None:
        return {}
    known = read_receivers(path)
    return dict(zip(known.names, known.position, strict=True))
