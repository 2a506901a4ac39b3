"""What a receiver tells of a ping that it hears, as the truth draws it (``readings.py``) and as a filter scores it.

The stereo hydrophone of Clark et al. 2013 gives a bearing without sign and a signal strength; with the clock of the tag known it
gives bearing and one-way range (Lin et al. 2013); a ranging receiver a slant range (Masmitja et al. 2020, Eq. 21); a presence
receiver only that a ping was heard and, by its silence, that one was not (Eq. 22).
The same classes serve truth and belief: give the two different parameters and you have an experiment on model mismatch.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.sim.sound_speed import USUAL_SOUND_SPEED
from tagtrack.envs.sim.validation import require, settle_numbers

LARGEST_UNIT = 9.0  # Lotek bearing units run from -9 to 9
RATIOS, RATIO_STEP = 64, 8.0  # a table of reception: so many ratios, so many metres apart


class ReceiverKind(enum.IntEnum):
    """Which readings a receiver gives."""

    STEREO = 0
    RANGE = 1
    PRESENCE = 2
    TIME_OF_FLIGHT = 3


@dataclass(frozen=True, kw_only=True)
class ReceiverRule:
    """What compiled code reads of any receiver; fields that a kind does not use stay zero."""

    kind: int
    bearing_sigma: float = 0.0
    strength_sigma: float = 0.0
    strength_slope: float = 0.0
    strength_scale: float = 0.0
    range_sigma: float = 0.0
    range_tolerance: float = 0.0
    range_factor: float = 1.0
    sound_speed: float = USUAL_SOUND_SPEED
    clock_sigma: float = 0.0
    tick: float = 0.0
    misread: float = 0.0
    code_spacing: float = 0.0
    max_range: float = 0.0
    max_range_spread: float = 0.0
    max_range_walk: float = 0.0
    detection_sigma: float = 0.0
    silence_sigma: float = 0.0
    reception: float = 0.0
    reception_spread: float = 0.0
    measured: bool = False
    ratios: tuple[float, ...] = (0.0,) * RATIOS


@dataclass(frozen=True, kw_only=True)
class StereoHydrophone:
    """Noise and calibration of Clark's receiver (Table I; Eq. 8)."""

    bearing_sigma: float = 1.0  # sigma_alpha [Lotek units]
    strength_sigma: float = 15.0  # sigma_ss [Lotek strength units]
    strength_slope: float = -0.871  # a of Eq. 8
    strength_scale: float = 2.18  # b of Eq. 8 (a power of ten)
    kind: ClassVar[ReceiverKind] = ReceiverKind.STEREO

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("bearing_sigma", "strength_sigma"):
            require(getattr(self, name) > 0, self, name, "positive")

    def rule(self) -> ReceiverRule:
        return ReceiverRule(
            kind=int(self.kind),
            bearing_sigma=self.bearing_sigma,
            strength_sigma=self.strength_sigma,
            strength_slope=self.strength_slope,
            strength_scale=self.strength_scale,
        )


@dataclass(frozen=True, kw_only=True)
class TimeOfFlightReceiver:
    """Bearing and one-way range of one heard ping (Lin et al. 2013). A belief scores by the first three values alone (Eq. 8).

    The truth draws the time of arrival: flight, error of the clocks, noise, and now and then a code that is read as the one
    before it in the burst, so that it seems to have left earlier. The range is what Eqs. 5-7 make of it.
    """

    bearing_sigma: float = 1.0  # sigma_alpha [Lotek units], some 10 degrees (III.B)
    range_sigma: float = 2.0  # sigma_d [m]: arrival noise times v (Table III, GPS errors included: 2.34 and 2.63)
    range_factor: float = 1.0  # reading / true range: the error of the assumed sound speed
    sound_speed: float = USUAL_SOUND_SPEED  # v [m/s], as assumed
    # Since t_0 was set [h]; the paper's ranges were good after four. What the clock is off by then is drawn for each episode:
    # 1.5 and 8 m in 22 h (V.C) are 5.8 m root mean square. Within an episode it grows by no more than 0.1 m, which is left out.
    hours_since_calibration: float = 4.0
    wander: float = 3e-10  # of the clocks' rate [s/s per root s]: what that drift amounts to (V.C)
    tick: float = 1 / 4800  # of the clock that counts arrivals [s]: every difference of Table I is a multiple
    misread: float = 0.0026  # share of the codes that are read as the one before them (Table I: 4 of 1546)
    code_spacing: float = 0.04876  # between the codes of a burst [s] (Table I: 0.04875 and 0.04896): 73 m
    kind: ClassVar[ReceiverKind] = ReceiverKind.TIME_OF_FLIGHT

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("bearing_sigma", "range_factor", "sound_speed", "tick"):
            require(getattr(self, name) > 0, self, name, "positive")
        for name in ("range_sigma", "hours_since_calibration", "wander", "code_spacing"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        require(0 <= self.misread <= 1, self, "misread", "within 0 to 1")

    @property
    def clock_sigma(self) -> float:
        """Standard deviation of the clock's error by now [s]: of a phase whose rate walks at random."""
        return self.wander * math.sqrt((3600.0 * self.hours_since_calibration) ** 3 / 3.0)

    def rule(self) -> ReceiverRule:
        return ReceiverRule(
            kind=int(self.kind),
            bearing_sigma=self.bearing_sigma,
            range_sigma=self.range_sigma,
            range_factor=self.range_factor,
            sound_speed=self.sound_speed,
            clock_sigma=self.clock_sigma,
            tick=self.tick,
            misread=self.misread,
            code_spacing=self.code_spacing,
        )


@dataclass(frozen=True, kw_only=True)
class RangeReceiver:
    """Slant range, by modem or synchronized tag. A belief scores by ``range_sigma`` and ``range_factor`` (Eq. 21).

    With a ``max_range`` it scores silence too: a ping that was due and not heard says that the fish may be farther than that.
    """

    range_sigma: float = 5.0  # of the Gaussian noise [m]
    range_tolerance: float = 0.0  # half width of a further, uniform noise [m]
    range_factor: float = 1.0  # reading / true range: the error of the assumed sound speed
    max_range: float = 0.0  # of a belief: where the chance to be heard has fallen to half [m]; 0: silence says nothing
    silence_sigma: float = 10.0  # how soft that edge is [m]
    reception: float = 0.9  # share of the pings from within that are heard
    kind: ClassVar[ReceiverKind] = ReceiverKind.RANGE

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("range_sigma", "range_tolerance", "max_range"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        for name in ("range_factor", "silence_sigma"):
            require(getattr(self, name) > 0, self, name, "positive")
        require(0 < self.reception <= 1, self, "reception", "more than 0 and at most 1")

    def rule(self) -> ReceiverRule:
        return ReceiverRule(
            kind=int(self.kind),
            range_sigma=self.range_sigma,
            range_tolerance=self.range_tolerance,
            range_factor=self.range_factor,
            max_range=self.max_range,
            silence_sigma=self.silence_sigma,
            reception=self.reception,
        )


@dataclass(frozen=True, kw_only=True)
class PresenceReceiver:
    """A receiver that logs which tag it hears, and no more. The defaults are the filter of Masmitja et al. 2020 (AOTT).

    The truth hears with the chance ``reception`` times the survival function of the distance about ``max_range``. A ``_spread``
    is half the width of the interval from which the truth draws a value for each episode. A belief spreads its particles over
    that of ``max_range`` and assumes the middle of that of ``reception``.
    """

    max_range: float = 250.0  # mu of Eq. 22: where the chance has fallen to half [m]
    max_range_spread: float = 0.0  # [m]; in a belief more than 0: estimated together with the position
    max_range_walk: float = 3.0  # of an estimated range, at each correction [m]: lest its particles become all alike
    detection_sigma: float = 4.5  # sigma_w of the survival function [m]: how soft the edge is
    silence_sigma: float = 9.0  # sigma_w of the CDF, by which a belief scores silence [m]
    reception: float = 1.0  # successful receptions over transmissions within range; 1 in a belief is the paper's Eq. 22
    reception_spread: float = 0.0
    kind: ClassVar[ReceiverKind] = ReceiverKind.PRESENCE

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("max_range", "detection_sigma", "silence_sigma"):
            require(getattr(self, name) > 0, self, name, "positive")
        require(self.max_range_walk >= 0, self, "max_range_walk", "at least 0")
        require(0 <= self.max_range_spread < self.max_range, self, "max_range_spread", "at least 0 and below max_range")
        require(0 < self.reception <= 1, self, "reception", "more than 0 and at most 1")
        widest = min(self.reception, 1.0 - self.reception) + 1e-9
        require(0 <= self.reception_spread <= widest, self, "reception_spread", "such that reception stays within 0 to 1")

    @property
    def working_range(self) -> float:
        """Distance [m] at which nine tenths of what is heard near by are still heard."""
        return self.max_range - 1.2816 * self.detection_sigma

    def rule(self) -> ReceiverRule:
        return ReceiverRule(
            kind=int(self.kind),
            max_range=self.max_range,
            max_range_spread=self.max_range_spread,
            max_range_walk=self.max_range_walk,
            detection_sigma=self.detection_sigma,
            silence_sigma=self.silence_sigma,
            reception=self.reception,
            reception_spread=self.reception_spread,
        )


@dataclass(frozen=True, kw_only=True)
class MeasuredReception:
    """A presence receiver that hears as often as was measured at sea; for the truth: a belief assumes a ``PresenceReceiver``.

    The defaults are the whole campaign of Masmitja et al. 2020: canister C and moorings A and B at receivers A, B, D and E, means
    where several pairs lie at one distance. They do not fall with it. Beyond 217 m nothing was measured; there the ratio runs to
    the 20 % that the text gives for 400 m.
    """

    distances: tuple[float, ...] = (0.0, 48.0, 95.0, 133.0, 144.0, 164.0, 193.0, 217.0, 400.0)  # rising [m]; none is heard beyond
    ratios: tuple[float, ...] = (0.365, 0.31, 0.47, 0.375, 0.443, 0.32, 0.53, 0.43, 0.2)
    kind: ClassVar[ReceiverKind] = ReceiverKind.PRESENCE

    def __post_init__(self) -> None:
        distances, ratios = (np.asarray(column, float) for column in (self.distances, self.ratios))
        rises = distances.ndim == 1 and distances.size > 0 and bool((np.diff(distances) > 0).all()) and distances[0] >= 0
        require(rises and distances[-1] < RATIOS * RATIO_STEP, self, "distances", f"rising, from 0 to {RATIOS * RATIO_STEP:g} m")
        within = ratios.shape == distances.shape and bool(((ratios >= 0) & (ratios <= 1)).all())
        require(within, self, "ratios", "as many as distances, each within 0 to 1")

    def rule(self) -> ReceiverRule:
        distance = RATIO_STEP * (np.arange(RATIOS) + 0.5)
        ratios = np.interp(distance, self.distances, self.ratios, right=0.0)
        return ReceiverRule(
            kind=int(self.kind), max_range=float(self.distances[-1]), reception=1.0, measured=True, ratios=tuple(ratios.tolist())
        )


Receiver = StereoHydrophone | TimeOfFlightReceiver | RangeReceiver | PresenceReceiver
RECEIVERS = {
    "stereo": StereoHydrophone,
    "time_of_flight": TimeOfFlightReceiver,
    "range": RangeReceiver,
    "presence": PresenceReceiver,
    "measured": MeasuredReception,
}
