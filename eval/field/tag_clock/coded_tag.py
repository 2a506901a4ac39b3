"""A tag that sends bursts of codes and a receiver that writes down when each arrived (Lin et al. 2013, III.A and Table I).

All time differences of Table I are whole multiples of 1/4800 s, 16 cycles of the tag's 76.8 kHz carrier, written with five
decimals: the receiver counts in such ticks. With a small jitter this alone gives both sigmas of Table II. What Table I adds
are codes that were missed and codes read as the one before them in the burst. No water, no echoes: whether a distant tag is
heard is another model's business.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tagtrack.envs.sim.sound_speed import USUAL_SOUND_SPEED
from tagtrack.envs.validation import require, settle_numbers
from tagtrack.eval.field.tag_clock.arrivals import Arrivals

BURST = 3  # codes in a burst


@dataclass(frozen=True, kw_only=True)
class CodedTag:
    """Bursts of three codes, two kinds of bursts in turn.

    Six codes make two bursts without a code in common, so each code comes every second burst. Five make two bursts that share
    the first code, which therefore has half the period of the others.
    """

    codes: tuple[int, ...] = (117, 121, 124, 130, 133, 138)  # the paper names 117 only
    burst_period: float = 1.999893  # between bursts [s]; two make Table II's 3.99979 s (tag 55436, code 117)
    code_spacing: float = 0.04876  # between the codes of a burst [s] (Table I: 0.04875 and 0.04896)
    # Random walk of the clock's rate, tag against receiver [s/s per root s]: 1.5 m and 8 m in 22 h (V.C) are 5.8 m root mean
    # square, and the walk's phase error after t is wander * sqrt(t^3 / 3). At most: a period that is the mean of differences
    # over 100 minutes is uncertain enough to explain as much.
    wander: float = 3e-10

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("burst_period", "code_spacing"):
            require(getattr(self, name) > 0, self, name, "positive")
        require(self.wander >= 0, self, "wander", "at least 0")
        require(BURST * self.code_spacing < self.burst_period, self, "code_spacing", "below a third of the burst's period")
        require(len(set(self.codes)) == len(self.codes) in (5, 6), self, "codes", "five or six different numbers")

    @property
    def bursts(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The codes of the first burst and of the second, which alternate."""
        first, rest = self.codes[:BURST], self.codes[BURST:]
        return first, rest if len(rest) == BURST else (self.codes[0], *rest)

    def period(self, code: int) -> float:
        """Period T_c of a code [s]. Raises ValueError for a code that is not the tag's."""
        if code not in self.codes:
            raise ValueError(f"the tag has no code {code}; it has {', '.join(map(str, self.codes))}")
        return self.burst_period * (1 if all(code in burst for burst in self.bursts) else 2)


@dataclass(frozen=True, kw_only=True)
class CodeReceiver:
    """How arrivals are read and recorded; shares as in Table I, where 3 of 1546 codes were missed and 4 came from a neighbour."""

    jitter: float = 1.5e-5  # sigma of the detection [s]; gives Table I's 44 differences one tick too long
    tick: float = 1 / 4800  # of the clock that counts arrivals [s]
    resolution: float = 1e-5  # of the record [s] (III.A)
    missed: float = 0.002  # share of the codes that are not heard
    misread: float = 0.0026  # share of the codes that are read as the one before them in the burst

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("tick", "resolution"):
            require(getattr(self, name) > 0, self, name, "positive")
        require(self.jitter >= 0, self, "jitter", "at least 0")
        for name in ("missed", "misread"):
            require(0 <= getattr(self, name) <= 1, self, name, "within 0 to 1")


def simulate_arrivals(
    tag: CodedTag,
    receiver: CodeReceiver,
    *,
    duration: float,
    generator: np.random.Generator,
    distance: float | Callable[[NDArray[np.float64]], NDArray[np.float64]] = 0.0,
    sound_speed: float = USUAL_SOUND_SPEED,
    power_cycles: Sequence[float] = (),
) -> Arrivals:
    """What a receiver records of one tag.

    Args:
        duration: of the record [s].
        generator: the source of all chance, the phase of the first burst included.
        distance: from tag to hydrophone [m]; 0 when the two are taped together. Of a tag or receiver that moves, a function of
            the times (K, 3) at which codes are sent [s].
        sound_speed: [m/s].
        power_cycles: when the tag is turned off and on again [s], rising: its bursts start anew, at another phase.
    Returns:
        All codes that were heard, in the order of their arrival, on the receiver's clock.
    Raises:
        ValueError: if duration is not positive, or power cycles do not rise within it.
    """
    starts = np.array([0.0, *power_cycles])
    if not (duration > 0 and (np.diff([*starts, duration]) > 0).all()):
        raise ValueError(f"power cycles must rise within the record of {duration:g} s, got {list(power_cycles)}")
    sent, burst = _send_bursts(tag, starts, duration, generator)
    position = np.arange(BURST)
    codes = np.array(tag.bursts)[burst % 2]
    sending = sent[:, None] + tag.code_spacing * position
    arrival = sending + (distance(sending) if callable(distance) else distance) / sound_speed
    misread = (generator.random(codes.shape) < receiver.misread) & (position > 0)
    read = np.where(misread, np.roll(codes, 1, axis=1), codes)
    heard = generator.random(codes.shape) >= receiver.missed
    time = _record_time(arrival[heard], receiver, generator)
    order = np.argsort(time, kind="stable")  # a tag may be turned off within a burst
    return Arrivals(time[order], read[heard][order].astype(np.int64))


def _send_bursts(
    tag: CodedTag, starts: NDArray[np.float64], duration: float, generator: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """When each burst begins (K,) [s], and its number since the tag was last turned on (K,)."""
    times, numbers = [], []
    for start, end in zip(starts, [*starts[1:], duration], strict=True):
        first = start + tag.burst_period * generator.random()
        number = np.arange(max(int(np.ceil((end - first) / tag.burst_period)), 0))
        times.append(first + number * tag.burst_period)
        numbers.append(number)
    even = np.concatenate(times)
    return even + clock_wander(tag.wander, tag.burst_period, even.size, generator), np.concatenate(numbers)


def clock_wander(wander: float, time_step: float, count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Phase error (count,) [s] of a clock whose rate, right at first, walks at random (random-walk frequency noise)."""
    rate = np.cumsum(generator.normal(0.0, wander * np.sqrt(time_step), count))
    return np.cumsum(rate * time_step)


def _record_time(
    arrival: NDArray[np.float64], receiver: CodeReceiver, generator: np.random.Generator
) -> NDArray[np.float64]:
    """Arrival times as the receiver writes them: jittered, cut to whole ticks, rounded to the record's resolution."""
    ticks = np.floor((arrival + generator.normal(0.0, receiver.jitter, arrival.shape)) / receiver.tick)
    return np.round(ticks * receiver.tick / receiver.resolution) * receiver.resolution
