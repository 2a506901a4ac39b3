"""How long sound takes from each sync tag to each receiver: known from places, or unknown but the same both ways.

With d_ij = d_ji (Masmitja et al. 2020, step iv) the clock offset of two receivers that carry tags follows from the times between
them alone; with known places it follows from any tag.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.detections import shorten
from tagtrack.eval.field.static_array.model import Floats


@dataclass(frozen=True, kw_only=True)
class SyncTag:
    """A tag that stays in its place: beside a receiver, at a known position, both, or just anywhere."""

    tag: str
    receiver: str | None  # that it hangs beside
    position: Floats | None  # (2,) [m]; by default its receiver's, where known


@dataclass(frozen=True, kw_only=True)
class TravelTimes:
    """From T tags to R receivers."""

    known: Floats  # (T, R) [s]; 0 where unknown
    unknown: NDArray[np.intp]  # (T, R): which of the unknown times it is; -1 where known

    @property
    def count(self) -> int:
        """How many unknown times there are."""
        return int(self.unknown.max(initial=-1)) + 1


def travel_times(
    tags: Sequence[str],
    receivers: Sequence[str],
    sync_tags: Sequence[SyncTag],
    places: Mapping[str, Floats],
    sound_speed: float,
) -> TravelTimes:
    """What is known of the times from ``tags`` to ``receivers``.

    Args:
        tags, receivers: names, in the order of the result; each tag among ``sync_tags``.
        places: (2,) of receivers, by name [m]; any may be absent. sound_speed: [m/s].
    Raises:
        ValueError: if a tag is listed twice or not at all.
    """
    listed = {sync.tag: sync for sync in sync_tags}
    if len(listed) < len(sync_tags):
        twice = sorted({sync.tag for sync in sync_tags if sum(other.tag == sync.tag for other in sync_tags) > 1})
        raise ValueError(f"sync tags are listed twice: {shorten(tuple(twice))}")
    known = np.zeros((len(tags), len(receivers)))
    unknown = np.full(known.shape, -1, dtype=np.intp)
    numbers: dict[frozenset[str], int] = {}
    for row, tag in enumerate(tags):
        if tag not in listed:
            raise ValueError(f"{tag!r} is no sync tag; there are {shorten(tuple(listed))}")
        host, place = listed[tag].receiver, listed[tag].position
        if place is None and host is not None:
            place = places.get(host)
        for column, receiver in enumerate(receivers):
            if place is not None and receiver in places:
                known[row, column] = np.hypot(*np.subtract(place, places[receiver])) / sound_speed
            elif receiver != host:
                path = frozenset((receiver, host)) if host is not None else frozenset((receiver, f"tag {tag}"))
                unknown[row, column] = numbers.setdefault(path, len(numbers))
    return TravelTimes(known=known, unknown=unknown)
