"""`tagtrack live compile`: what a mission needs, compiled before it begins."""

from __future__ import annotations

import argparse
import resource
import sys
import time

from tagtrack.live.steer import warm_up


def run(options: argparse.Namespace) -> None:
    """The command."""
    begun = time.perf_counter()
    asked = {name: getattr(options, name) for name in ("env", "filter", "particles", "set", "seed", "policy", "headings")}
    missing = {"safe": "hold", "depth": 0.0, "late": 60.0, "stale": 15.0, "stamp": "receiver", "speed": 1.0}
    warm_up({**missing, **asked, "tags": options.tags or ["1"]})
    unit = 1 if sys.platform == "darwin" else 1024  # bytes of what the system counts
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
    print(f"ready after {time.perf_counter() - begun:.1f} s, at most {most:.0f} MB; the next start is a quick one")
