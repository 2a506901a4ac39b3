"""Arrivals of pings become ranges by the calibration of the tag's clock (``tagtrack eval calibrate``; Lin et al. 2013, IV)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from tagtrack.command import tagtrack_here
from tagtrack.eval.field.tag_clock.time_of_flight import TagClock, time_of_flight_range


@dataclass(frozen=True)
class RangeFinder:
    """The clocks of tags, on the receiver's clock."""

    clock: TagClock
    sound_speed: float  # [m/s]
    tag: str  # the code that was calibrated

    def range_of(self, tag: str, arrival: float) -> float:
        """Slant range [m] of a ping that came at a time [s]. Raises ValueError for a tag that was not calibrated."""
        if tag != self.tag:
            raise ValueError(f"tag {tag} was not calibrated, {self.tag} was; leave it out (--tags {self.tag})")
        return float(time_of_flight_range([[arrival]], self.clock, self.sound_speed)[0, 0])


def read_range_finder(path: str | Path) -> RangeFinder:
    """The calibration.json, or the folder with it, that ``eval calibrate --out`` has written.

    Raises:
        FileNotFoundError: where there is none. ValueError: if it is something else.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "calibration.json"
    if not path.is_file():
        raise FileNotFoundError(f"no calibration {path}; make one: {tagtrack_here()} eval calibrate --arrivals FILE --out DIR")
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        clock = TagClock(period=float(document["by_line"]["period"]), first_ping=float(document["first_ping_s"]))
        return RangeFinder(clock, float(document["sound_speed_m_s"]), str(document["code"]))
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise ValueError(f"{path} is no calibration that eval calibrate has written ({error}); calibrate again") from None
