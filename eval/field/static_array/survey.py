"""Where moored receivers are, from the sound between them (Masmitja et al. 2020, "Receiver clock drift adjustment").

A receiver that logs the pings of the tag beside it knows when they left, and another that hears them how long they took. The mean
of both ways is free of the offset between the two clocks, half their difference is that offset (step iv). Places follow from the
distances, and are turned and moved onto reference points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tagtrack.eval.field.static_array.detections import Detections, shorten, time_resolution
from tagtrack.eval.field.static_array.matching import DEFAULT_WINDOW, match_pings
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.static_array.outliers import is_regular

SMALLEST_CUT = 1e-3  # no time is an outlier that is this near to the median [s]
BATCHES = 20  # of a mean's standard error: errors of neighbouring pings are alike where a clock wanders


@dataclass(frozen=True, kw_only=True)
class OneWay:
    """The time sound takes from a receiver's own tag to another receiver, on their two clocks."""

    seconds: float  # mean; NaN without pings
    standard_error: float  # [s]
    pings: int
    outliers: int


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Two receivers: their distance, from the two-way mean where both hear the other's tag."""

    receivers: tuple[str, str]
    distance: float  # [m]
    sd: float  # of it, without the error of the sound speed [m]
    there: OneWay  # from the first's tag to the second
    back: OneWay
    sound_speed: float  # [m/s]

    @property
    def asymmetry(self) -> float:
        """By how much the way there is longer than the way back [m]; NaN for one way alone."""
        return (self.there.seconds - self.back.seconds) * self.sound_speed

    @property
    def clock_offset(self) -> float:
        """By how much the second's clock is ahead of the first's, C_ij of step iv [s]; NaN for one way alone."""
        return (self.there.seconds - self.back.seconds) / 2


def one_way(own: Floats, other: Floats, resolution: float = 0.0) -> OneWay:
    """The mean time between arrivals (K,) of the same pings at a tag's own receiver and another [s], NaN where not heard.

    Rounded times take two or three values, whose median absolute deviation can be nil: what lies within twice the
    ``resolution`` [s] is regular, whatever the others do.
    """
    taken = (other - own)[np.isfinite(own) & np.isfinite(other)]
    if not taken.size:
        return OneWay(seconds=float("nan"), standard_error=float("nan"), pings=0, outliers=0)
    near = taken[is_regular(taken - np.median(taken), max(SMALLEST_CUT, 2.1 * resolution))]
    batches = min(BATCHES, near.size)
    means = np.array([batch.mean() for batch in np.array_split(near, batches)])
    error = float(means.std(ddof=1) / np.sqrt(batches)) if batches > 1 else float("nan")
    return OneWay(seconds=float(near.mean()), standard_error=error, pings=near.size, outliers=taken.size - near.size)


def survey_distances(
    detections: Detections, own_tags: Mapping[str, str | tuple[str, ...]], sound_speed: float, window: float = DEFAULT_WINDOW
) -> tuple[Baseline, ...]:
    """Distances between receivers with own tags: every pair of which at least one heard the other.

    Args:
        detections: on corrected clocks, or on clocks apart by a constant less than ``window`` [s].
        own_tags: tag beside a receiver, or several, by receiver; the pings of several count alike. sound_speed: [m/s].
    Raises:
        ValueError: for fewer than two receivers with own tags, or if none heard another's.
    """
    receivers = [name for name in detections.receivers if name in own_tags]
    if len(receivers) < 2:
        raise ValueError(f"distances take two receivers with own sync tags, got {shorten(tuple(receivers))}")
    resolution = time_resolution(detections.time)
    arrivals = {}
    for name in receivers:
        beside = own_tags[name]
        heard = [tag for tag in ((beside,) if isinstance(beside, str) else beside) if tag in detections.tags]
        matched = [match_pings(detections.of_tag(tag), window, least_receivers=2).pings.arrival for tag in heard]
        arrivals[name] = np.concatenate(matched) if matched else np.empty((0, len(detections.receivers)))
    found = []
    for pair in combinations(receivers, 2):
        ways = []
        for source, sink in (pair, pair[::-1]):
            own, other = (arrivals[source][:, detections.receivers.index(name)] for name in (source, sink))
            ways.append(one_way(own, other, resolution))
        if ways[0].pings + ways[1].pings:
            found.append(_baseline(pair, ways[0], ways[1], sound_speed))
    if not found:
        raise ValueError(f"of {shorten(tuple(receivers))} none logged its own tag's pings together with another receiver")
    return tuple(found)


def _baseline(pair: tuple[str, str], there: OneWay, back: OneWay, sound_speed: float) -> Baseline:
    """The mean of both ways, or the one there is."""
    ways = [way for way in (there, back) if way.pings]
    seconds = np.mean([way.seconds for way in ways])
    error = np.sqrt(np.sum([way.standard_error**2 for way in ways])) / len(ways)
    return Baseline(
        receivers=pair,
        distance=float(sound_speed * seconds),
        sd=float(sound_speed * error),
        there=there,
        back=back,
        sound_speed=sound_speed,
    )


def survey_receivers(baselines: Sequence[Baseline]) -> tuple[str, ...]:
    """Names of the receivers in distances, each once, in their order."""
    return tuple(dict.fromkeys(name for baseline in baselines for name in baseline.receivers))
