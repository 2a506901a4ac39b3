"""Files of acoustic telemetry, as people have them, to arrays and back: detections."""

from tagtrack.eval.telemetry.detections import Reading, read_detections, read_telemetry, write_detections

__all__ = ["Reading", "read_detections", "read_telemetry", "write_detections"]
