"""Files of acoustic telemetry, as people have them, to arrays and back: detections."""

from tagtrack.eval.telemetry.detections import read_detections

__all__ = ["read_detections"]
