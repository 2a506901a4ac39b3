"""The stereo hydrophone of Clark et al. 2013: a bearing without sign and a signal strength (Eqs. 5-10)."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from tagtrack.envs.feature import Feature, Scale
from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.maths import fast_exp, fast_log
from tagtrack.envs.model import BELIEF, read_by
from tagtrack.envs.sensors.bearing import (
    LAST_UNITS,
    NEAREST,
    bearing_units,
    density_by_bearing,
    pose_of,
    read_units,
    side_angles,
)
from tagtrack.envs.sensors.sensor import OBSERVE, READ, WEIGH, Glimpse, Prospect, Sensor
from tagtrack.envs.validation import require, settle_numbers

f32 = np.float32
UNITS, STRENGTH = range(2)  # places in the readings


class Weighting(enum.IntEnum):
    """Which reading of a stereo hydrophone weighs the particles: h_alpha (Eq. 6), h_ss (Eq. 9) or h_mod (Eq. 10)."""

    BEARING = 0
    STRENGTH = 1
    COMBINED = 2


@compiled
def expected_strength(distance, slope, scale):
    """Signal strength at a distance [m] (Eq. 8)."""
    return 10.0**scale * max(distance, 1e-3) ** slope


@native(READ)
def read(measurement, encounter, normal_1, normal_2, uniform_1, uniform_2, parameters):
    """Bearing, rounded to whole units, and strength."""
    bearing_sigma, strength_sigma, slope, scale = parameters[0], parameters[1], parameters[2], parameters[3]
    measurement.readings[UNITS] = read_units(encounter, bearing_sigma * normal_1)
    measurement.readings[STRENGTH] = expected_strength(encounter.range, slope, scale) + strength_sigma * normal_2


@compiled
def weigh_bearing(weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, floor):
    """Multiply by h_alpha (Eq. 6). ``ahead`` is the unit vector of the vehicle's heading."""
    precision = f32(-0.5) / (sigma * sigma)
    peak = f32(1.0 / math.sqrt(2.0 * math.pi)) / sigma
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        sine = (dx * ahead_x + dy * ahead_y) / np.sqrt(dx * dx + dy * dy + NEAREST)
        miss = bearing_units(sine) - units
        weight[i] *= floor + peak * fast_exp(precision * miss * miss)


@compiled
def weigh_strength(weight, x, y, own_x, own_y, strength, slope, log_scale, sigma, floor):
    """Multiply by h_ss (Eqs. 8, 9); the expected strength is exp(log_scale + slope * ln(distance))."""
    precision = f32(-0.5) / (sigma * sigma)
    peak = f32(1.0 / math.sqrt(2.0 * math.pi)) / sigma
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        expected = fast_exp(log_scale + f32(0.5) * slope * fast_log(dx * dx + dy * dy + NEAREST))
        miss = expected - strength
        weight[i] *= floor + peak * fast_exp(precision * miss * miss)


@compiled
def expect_strength(expected, x, y, own_x, own_y, slope, log_scale):
    """Expected signal strength of each particle (Eq. 8)."""
    for i in range(expected.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        expected[i] = fast_exp(log_scale + f32(0.5) * slope * fast_log(dx * dx + dy * dy + NEAREST))


@compiled
def weigh_combined(weight, misfit, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, strength, strength_sigma, floor):
    """Multiply by h_mod (Eq. 10, with a sigma where the paper prints an expected value: a density needs its width).

    ``misfit`` holds the expected strengths on entry.
    """
    precision = f32(-0.5) / (sigma * sigma)
    strength_precision = f32(-0.5) / (strength_sigma * strength_sigma)
    peak = f32(0.5 / math.pi) / (sigma * strength_sigma)
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        sine = (dx * ahead_x + dy * ahead_y) / np.sqrt(dx * dx + dy * dy + NEAREST)
        miss = bearing_units(sine) - units
        strength_miss = misfit[i] - strength
        weight[i] *= floor + peak * fast_exp(
            precision * miss * miss + strength_precision * strength_miss * strength_miss
        )


@native(WEIGH)
def weigh(weight, particles, measurement, floor, work, parameters):
    sigma, strength_sigma, slope = f32(parameters[0]), f32(parameters[1]), f32(parameters[2])
    log_scale, weighting = f32(parameters[3] * math.log(10.0)), int(parameters[4])
    x, y = particles[0], particles[1]
    own_x, own_y, ahead_x, ahead_y = pose_of(measurement)
    units, strength = f32(measurement.readings[UNITS]), f32(measurement.readings[STRENGTH])
    if weighting == Weighting.BEARING:
        weigh_bearing(weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, floor)
    elif weighting == Weighting.STRENGTH:
        weigh_strength(weight, x, y, own_x, own_y, strength, slope, log_scale, strength_sigma, floor)
    else:
        expect_strength(work, x, y, own_x, own_y, slope, log_scale)
        weigh_combined(
            weight, work, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, strength, strength_sigma, floor
        )  # fmt: skip


@native(OBSERVE)
def observe(out, listener, dx, dy, estimated, estimated_spread, length, spread, parameters):
    out[0] = 0.0
    out[1] = 0.0
    if not math.isnan(listener.readings[UNITS]):
        out[0] = listener.readings[UNITS] / 9.0
    if not math.isnan(listener.readings[STRENGTH]):  # which some receivers do not tell
        out[1] = min(max(listener.readings[STRENGTH] / 50.0, -2.0), 4.0)


@dataclass(frozen=True, kw_only=True)
class StereoHydrophone(Sensor):
    """Noise and calibration of Clark's receiver (Table I; Eq. 8)."""

    bearing_sigma: float = 1.0  # sigma_alpha [Lotek units]
    strength_sigma: float = 15.0  # sigma_ss [Lotek strength units]
    strength_slope: float = -0.871  # a of Eq. 8
    strength_scale: float = 2.18  # b of Eq. 8 (a power of ten)
    weighting: Weighting = read_by(BELIEF, Weighting.BEARING)  # which reading weighs the particles
    name: ClassVar[str] = "stereo"
    readings: ClassVar[tuple[str, ...]] = ("units", "strength")
    hydrophones: ClassVar[int] = 2
    in_plane: ClassVar[bool] = True
    legend: ClassVar[str] = "last bearing, both sides"
    read: ClassVar[Native | None] = read
    weigh: ClassVar[Native | None] = weigh
    observe: ClassVar[Native | None] = observe

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("bearing_sigma", "strength_sigma"):
            require(getattr(self, name) > 0, self, name, "positive")

    def unread(self, side: str) -> dict[str, str]:
        unread = dict(super().unread(side))
        if side == BELIEF and self.weighting == Weighting.BEARING:
            for name in ("strength_sigma", "strength_slope", "strength_scale"):
                unread[name] = "its weighting is by bearing alone"
        if side == BELIEF and self.weighting == Weighting.STRENGTH:
            unread["bearing_sigma"] = "its weighting is by strength alone"
        return unread

    @property
    def weighed(self) -> tuple[int, ...]:
        return {Weighting.BEARING: (UNITS,), Weighting.STRENGTH: (STRENGTH,)}.get(self.weighting, (UNITS, STRENGTH))

    def features(self, scale: Scale) -> tuple[Feature, ...]:
        return (
            LAST_UNITS,
            Feature("last_strength", "last signal strength / 50; 0 before the first", -2.0, 4.0),
        )

    def glimpse(self, measurement: Any, estimated: float) -> Glimpse:
        units = float(measurement["readings"][UNITS])
        return Glimpse(words=f"{units:+.0f}", fan=side_angles(units, self.bearing_sigma))

    def prospect(self, distance: np.ndarray, floor: float) -> Prospect:
        """By bearing: what the strength tells is left out."""
        return Prospect(by_distance=False, likelihood=floor + density_by_bearing(self.bearing_sigma))
