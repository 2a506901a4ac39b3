"""Bearing and one-way range of one heard ping (Lin et al. 2013): the clock of the tag is known."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from tagtrack.envs.feature import Feature, Scale
from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.maths import fast_exp
from tagtrack.envs.model import BELIEF, TRUTH, read_by
from tagtrack.envs.sensors.bearing import (
    LAST_UNITS,
    NEAREST,
    bearing_units,
    density_by_bearing,
    pose_of,
    read_units,
    side_angles,
)
from tagtrack.envs.sensors.ranging import require_factor, weigh_range
from tagtrack.envs.sensors.sensor import OBSERVE, READ, WEIGH, Gate, Glimpse, Prospect, Sensor
from tagtrack.envs.sensors.stereo import weigh_bearing
from tagtrack.envs.validation import require, settle_numbers

f32 = np.float32
UNITS, SLANT_RANGE = range(2)  # places in the readings
USUAL_SOUND_SPEED = 1500.0


class Measurements(enum.IntEnum):
    """Which reading of a time-of-flight receiver weighs the particles (Lin et al. 2013, Table IV)."""

    BOTH = 0
    ANGLE = 1
    DISTANCE = 2


@native(READ)
def read(measurement, encounter, normal_1, normal_2, uniform_1, uniform_2, parameters):
    """Bearing and, by the time of arrival, slant range within +-v*T_c/2 (Lin et al. 2013, Eqs. 5-7)."""
    bearing_sigma, range_sigma, factor, sound_speed = parameters[0], parameters[1], parameters[2], parameters[3]
    tick, misread, code_spacing = parameters[6], parameters[7], parameters[8]
    measurement.readings[UNITS] = read_units(encounter, bearing_sigma * normal_1)
    flight = (factor * encounter.distance + range_sigma * normal_2) / sound_speed
    arrival = encounter.ping + flight + encounter.clock_error
    if uniform_1 < misread:
        arrival += code_spacing
    late = tick * math.floor(arrival / tick + 0.5) - encounter.first_ping
    measurement.readings[SLANT_RANGE] = sound_speed * (late - encounter.period * math.floor(late / encounter.period + 0.5))


@compiled
def weigh_bearing_range(
    weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, slant_range, factor, range_sigma, floor
):
    """Multiply by the likelihood of a bearing and a range together (Lin et al. 2013, Eq. 8)."""
    precision = f32(-0.5) / (sigma * sigma)
    range_precision = f32(-0.5) / (range_sigma * range_sigma)
    peak = f32(0.5 / math.pi) / (sigma * range_sigma)
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        distance = np.sqrt(dx * dx + dy * dy + NEAREST)
        miss = bearing_units((dx * ahead_x + dy * ahead_y) / distance) - units
        range_miss = factor * distance - slant_range
        weight[i] *= floor + peak * fast_exp(precision * miss * miss + range_precision * range_miss * range_miss)


@native(WEIGH)
def weigh(weight, particles, measurement, floor, work, parameters):
    """A bearing, a one-way range or both (Lin et al. 2013, Eq. 8)."""
    sigma, range_sigma, factor, which = f32(parameters[0]), f32(parameters[1]), f32(parameters[2]), int(parameters[9])
    x, y = particles[0], particles[1]
    own_x, own_y, ahead_x, ahead_y = pose_of(measurement)
    units, slant_range = f32(measurement.readings[UNITS]), f32(measurement.readings[SLANT_RANGE])
    if which == Measurements.ANGLE:
        weigh_bearing(weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, floor)
    elif which == Measurements.DISTANCE:
        weigh_range(weight, x, y, own_x, own_y, f32(0.0), slant_range, factor, range_sigma, floor)
    else:
        weigh_bearing_range(
            weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, slant_range, factor, range_sigma, floor
        )  # fmt: skip


@native(OBSERVE)
def observe(out, listener, dx, dy, estimated, estimated_spread, length, spread, parameters):
    out[0] = 0.0
    out[1] = 0.0
    if not math.isnan(listener.readings[UNITS]):
        out[0] = listener.readings[UNITS] / 9.0
    if not math.isnan(listener.readings[SLANT_RANGE]):
        out[1] = min(max(listener.readings[SLANT_RANGE] / length, -1.0), 10.0)


@dataclass(frozen=True, kw_only=True)
class TimeOfFlightReceiver(Sensor):
    """Bearing and one-way range of one heard ping (Lin et al. 2013). A belief scores by the first three values alone (Eq. 8).

    The truth draws the time of arrival: flight, error of the clocks, noise, and now and then a code that is read as the one
    before it in the burst, so that it seems to have left earlier. The range is what Eqs. 5-7 make of it.
    """

    bearing_sigma: float = 1.0  # sigma_alpha [Lotek units], some 10 degrees (III.B)
    range_sigma: float = 2.0  # sigma_d [m]: arrival noise times v (Table III, GPS errors included: 2.34 and 2.63)
    range_factor: float = 1.0  # reading / true range: the error of the assumed sound speed
    sound_speed: float = read_by(TRUTH, USUAL_SOUND_SPEED)  # v [m/s], as assumed
    # Since t_0 was set [h]; the paper's ranges were good after four. What the clock is off by then is drawn for each episode:
    # 1.5 and 8 m in 22 h (V.C) are 5.8 m root mean square. Within an episode it grows by no more than 0.1 m, which is left out.
    hours_since_calibration: float = read_by(TRUTH, 4.0)
    wander: float = read_by(TRUTH, 3e-10)  # of the clocks' rate [s/s per root s]: what that drift amounts to (V.C)
    tick: float = read_by(TRUTH, 1 / 4800)  # of the clock that counts arrivals [s]: every difference of Table I is a multiple
    misread: float = read_by(TRUTH, 0.0026)  # share of the codes that are read as the one before them (Table I: 4 of 1546)
    code_spacing: float = read_by(TRUTH, 0.04876)  # between the codes of a burst [s] (Table I: 0.04875 and 0.04896): 73 m
    measurements: Measurements = read_by(BELIEF, Measurements.BOTH)  # which reading weighs the particles
    largest_jump: float = read_by(BELIEF, 50.0)  # Delta d_max of Alg. 1: from range to range [m]; a ping beyond is not used
    name: ClassVar[str] = "time_of_flight"
    readings: ClassVar[tuple[str, ...]] = ("units", "slant_range")
    hydrophones: ClassVar[int] = 2
    in_plane: ClassVar[bool] = True
    needs_period: ClassVar[bool] = True
    legend: ClassVar[str] = "last bearing and range"
    read: ClassVar[Native | None] = read
    weigh: ClassVar[Native | None] = weigh
    observe: ClassVar[Native | None] = observe

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("bearing_sigma", "sound_speed", "tick", "largest_jump"):
            require(getattr(self, name) > 0, self, name, "positive")
        require_factor(self)
        for name in ("range_sigma", "hours_since_calibration", "wander", "code_spacing"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        require(0 <= self.misread <= 1, self, "misread", "within 0 to 1")

    def unread(self, side: str) -> dict[str, str]:
        unread = dict(super().unread(side))
        if side == BELIEF and self.measurements == Measurements.ANGLE:
            unread |= dict.fromkeys(("range_sigma", "range_factor", "largest_jump"), "its measurements are angles alone")
        if side == BELIEF and self.measurements == Measurements.DISTANCE:
            unread["bearing_sigma"] = "its measurements are distances alone"
        return unread

    def require_belief(self) -> None:
        require(self.range_sigma > 0, self, "range_sigma", "positive in a belief")

    @property
    def clock_sigma(self) -> float:
        """Standard deviation of the clock's error by now [s]: of a phase whose rate walks at random."""
        return self.wander * math.sqrt((3600.0 * self.hours_since_calibration) ** 3 / 3.0)

    @property
    def weighed(self) -> tuple[int, ...]:
        return {Measurements.ANGLE: (UNITS,), Measurements.DISTANCE: (SLANT_RANGE,)}.get(self.measurements, (UNITS, SLANT_RANGE))

    @property
    def gate(self) -> Gate | None:
        """Alg. 1: of a ping whose range jumps the bearing goes with it."""
        return None if self.measurements == Measurements.ANGLE else Gate(reading=SLANT_RANGE, largest_jump=self.largest_jump)

    def features(self, scale: Scale) -> tuple[Feature, ...]:
        return (
            LAST_UNITS,
            Feature("last_range", f"last time-of-flight range / {scale.length:g} m; 0 before the first", -1.0, 10.0),
        )

    def glimpse(self, measurement: Any, estimated: float) -> Glimpse:
        units, slant_range = (float(measurement["readings"][place]) for place in (UNITS, SLANT_RANGE))
        fan = side_angles(units, self.bearing_sigma)
        return Glimpse(words=f"{units:+.0f}, {abs(slant_range):.0f} m", fan=fan, radius=abs(slant_range))

    def prospect(self, distance: np.ndarray, floor: float) -> Prospect:
        """By bearing: what the range tells is left out."""
        return Prospect(by_distance=False, likelihood=floor + density_by_bearing(self.bearing_sigma))
