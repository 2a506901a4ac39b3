"""`tagtrack eval array`: moored receivers, from raw detections to clocks, places, positions and tracks."""
