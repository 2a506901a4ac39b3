"""Files of acoustic telemetry, as people have them, to arrays and back: detections, known places, tracks."""

from tagtrack.eval.field.telemetry.detections import Reading, read_detections, read_telemetry, write_detections
from tagtrack.eval.field.telemetry.places import (
    ReceiverPlaces,
    Reference,
    SyncTag,
    read_own_tags,
    read_receivers,
    read_reference,
    read_sync_tags,
)
from tagtrack.eval.field.telemetry.tracks import TrackFile, read_tracks, write_movebank, write_tracks
from tagtrack.live.plane import Plane

__all__ = [
    "Plane",
    "Reading",
    "ReceiverPlaces",
    "Reference",
    "SyncTag",
    "TrackFile",
    "read_detections",
    "read_own_tags",
    "read_receivers",
    "read_reference",
    "read_sync_tags",
    "read_telemetry",
    "read_tracks",
    "write_detections",
    "write_movebank",
    "write_tracks",
]
