"""Detections of coded tags by receivers as three parallel columns: what readers give and clocks, matching and survey take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Codes = NDArray[np.int32]


@dataclass(frozen=True, kw_only=True)
class Detections:
    """D detections in order of time; receivers and tags by their place in the two lists of names."""

    time: Floats  # (D,) on the receiver's clock [s, Unix epoch]
    receiver: Codes  # (D,) index into ``receivers``
    tag: Codes  # (D,) index into ``tags``
    receivers: tuple[str, ...]
    tags: tuple[str, ...]

    def of_tag(self, tag: str) -> Detections:
        """Those of one tag. Raises ValueError that lists the tags there are."""
        if tag not in self.tags:
            raise ValueError(f"no detection of tag {tag!r}; there are {shorten(self.tags)}")
        return self.take(self.tag == self.tags.index(tag))

    def take(self, kept: NDArray[np.bool_]) -> Detections:
        """Those of a mask (D,), under the same lists of names."""
        return Detections(
            time=self.time[kept],
            receiver=self.receiver[kept],
            tag=self.tag[kept],
            receivers=self.receivers,
            tags=self.tags,
        )


def time_resolution(time: Floats) -> float:
    """Step in which times (D,) were written: the coarsest of 1, 0.1 ... 0.0001 s that all are multiples of; 0 for a finer one."""
    for digits in range(5):
        scaled = time * 10.0**digits
        if np.all(np.abs(scaled - np.round(scaled)) < 0.01):
            return float(10.0**-digits)
    return 0.0


def shorten(names: tuple[str, ...], most: int = 12) -> str:
    """Names as an error message lists them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more if names else "none"
