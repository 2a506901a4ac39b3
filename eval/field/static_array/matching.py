"""Which receptions of a tag at several receivers are one ping: the association that time differences need (Masmitja et al. 2020).

Clocks must agree to less than the tag's shortest interval before (``clocks.py``). Sound that comes by the surface or the bottom
arrives after the direct one, so a receiver's first arrival of a ping counts and its later ones are echoes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import pdist, squareform

from tagtrack.eval.field.static_array.detections import Detections
from tagtrack.eval.field.static_array.model import Pings

DEFAULT_WINDOW = 1.0  # [s]; sound crosses 1.5 km, and the tags of such studies wait a minute
ECHO = 0.1  # [s] after a reception: what follows sooner is its echo
USUAL_GAP = 0.25  # quantile of the gaps at a receiver that are one interval: three pings of four may be missed
DEFAULT_MARGIN = 0.05  # what clocks and echoes may add to the largest possible time difference [s]


@dataclass(frozen=True, kw_only=True)
class Matching:
    """The pings of one tag, and the receptions that made none of them."""

    pings: Pings
    echoes: int  # later arrivals of a ping at a receiver that had heard it
    too_few: int  # receptions in pings that fewer receivers heard than asked for
    impossible: int = 0  # arrivals removed: farther from others than sound takes between the receivers


def array_window(receivers: ArrayLike, sound_speed: float, margin: float = DEFAULT_MARGIN) -> float:
    """Largest possible time difference of arrival between receivers (R, n), plus a margin [s]."""
    places = np.asarray(receivers, dtype=np.float64)
    return float(pdist(places).max(initial=0.0)) / sound_speed + margin


def usual_interval(detections: Detections) -> float | None:
    """How long a tag waits between two pings [s], from when each receiver heard it; None where nobody heard it twice."""
    gaps = []
    for receiver in np.unique(detections.receiver):
        gap = np.diff(np.sort(detections.time[detections.receiver == receiver]))
        gaps.append(gap[gap > ECHO])
    every = np.concatenate(gaps) if gaps else np.empty(0)
    return float(np.quantile(every, USUAL_GAP)) if every.size else None


def group_pings(time: ArrayLike, window: float) -> NDArray[np.intp]:
    """Number (D,) of the ping that each of D receptions of one tag belongs to, from 0 in order of time.

    The earliest reception opens a ping, which takes all within ``window`` of it; the next one opens another.

    Args:
        time: (D,) [s] on a common clock, in order. window: [s].
    """
    value = np.asarray(time, dtype=np.float64)
    opens = np.ones(value.size, dtype=np.bool_)
    opens[1:] = np.diff(value) > window  # a longer gap always opens one; denser stretches are cut below, all at once
    undecided = np.flatnonzero(opens)
    while undecided.size:
        start = value[undecided]
        following = np.searchsorted(value, start + window, side="right")
        following = following[following < value.size]
        undecided = np.unique(following[~opens[following]])
        opens[undecided] = True
    return np.cumsum(opens) - 1


def match_pings(detections: Detections, window: float = DEFAULT_WINDOW, *, least_receivers: int = 1) -> Matching:
    """Put together what several receivers heard of one tag.

    Args:
        detections: of one tag, on corrected clocks. window: longest time between the first and the last arrival of a ping [s],
            below the tag's shortest interval; ``array_window`` gives it from the places.
        least_receivers: pings heard by fewer are left out, and counted.
    Returns:
        The pings, a column for each of ``detections.receivers``, and the receptions that were left out.
    Raises:
        ValueError: for detections of several tags, a window that is not positive, or less than one receiver.
    """
    if not (np.isfinite(window) and window > 0):
        raise ValueError(f"the window of a ping must be positive, got {window!r} s")
    if least_receivers < 1:
        raise ValueError(f"least_receivers must be at least 1, got {least_receivers}")
    if np.unique(detections.tag).size > 1:
        raise ValueError("pings are matched tag by tag, got detections of several; take one: detections.of_tag(name)")
    order = np.argsort(detections.time, kind="stable")
    time, receiver = detections.time[order], detections.receiver[order]
    ping = group_pings(time, window)
    arrival = np.full((ping[-1] + 1 if ping.size else 0, len(detections.receivers)), np.nan)
    first = np.unique(ping * len(detections.receivers) + receiver, return_index=True)[1]
    arrival[ping[first], receiver[first]] = time[first]
    heard = np.isfinite(arrival).sum(axis=1)
    kept = heard >= least_receivers
    pings = Pings(time=np.nanmin(arrival[kept], axis=1), arrival=arrival[kept])
    return Matching(pings=pings, echoes=time.size - int(heard.sum()), too_few=int(heard[~kept].sum()))


def impossible_differences(
    arrival: ArrayLike, receivers: ArrayLike, sound_speed: float, margin: float = DEFAULT_MARGIN
) -> NDArray[np.int64]:
    """From how many other arrivals (K, R) each lies farther than sound takes between the receivers (R, n), plus a margin [s]."""
    value = np.asarray(arrival, dtype=np.float64)
    most = squareform(pdist(np.asarray(receivers, dtype=np.float64))) / sound_speed + margin
    blamed = np.zeros(value.shape, dtype=np.int64)
    for index in range(value.shape[1]):
        blamed[:, index] = np.sum(np.abs(value - value[:, [index]]) > most[index], axis=1)
    return blamed


def remove_impossible(
    matching: Matching, receivers: ArrayLike, sound_speed: float, margin: float = DEFAULT_MARGIN, *, least_receivers: int = 1
) -> Matching:
    """Without arrivals that no place of the tag explains: of a ping the one in most impossible differences first.

    Of two that blame each other alone the later goes, since what is not the direct sound comes late. Pings that fewer than
    ``least_receivers`` are left of are left out. Both are counted.
    """
    arrival = matching.pings.arrival.copy()
    removed = 0
    while True:
        blamed = impossible_differences(arrival, receivers, sound_speed, margin)
        rows = np.flatnonzero(blamed.any(axis=1))
        if not rows.size:
            break
        worst = blamed[rows] == blamed[rows].max(axis=1, keepdims=True)
        arrival[rows, np.argmax(np.where(worst, arrival[rows], -np.inf), axis=1)] = np.nan
        removed += rows.size
    heard = np.isfinite(arrival).sum(axis=1)
    kept = heard >= least_receivers
    pings = Pings(time=np.nanmin(arrival[kept], axis=1), arrival=arrival[kept])
    too_few = matching.too_few + int(heard[~kept].sum())
    return Matching(pings=pings, echoes=matching.echoes, too_few=too_few, impossible=matching.impossible + removed)
