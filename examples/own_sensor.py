"""A sensor of one's own: a bearing with Gaussian noise that knows port from starboard. Nothing in the package is touched.

    tagtrack train --env LeopardShark-v0 --set receiver=own_sensor:SidedBearing belief.receiver=own_sensor:SidedBearing
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.feature import Feature
from tagtrack.envs.kernels.calling import native
from tagtrack.envs.kernels.geometry import relative_bearing, wrap_angle
from tagtrack.envs.kernels.maths import fast_exp
from tagtrack.envs.sensors.sensor import OBSERVE, READ, WEIGH, Glimpse, Sensor

f32 = np.float32


@native(READ)
def read(measurement, encounter, normal_1, normal_2, uniform_1, uniform_2, parameters):
    """What the truth draws of a heard ping: the bearing [rad], positive to port."""
    bearing = relative_bearing(encounter.x, encounter.y, encounter.heading, encounter.fish_x, encounter.fish_y)
    measurement.readings[0] = wrap_angle(bearing + parameters[0] * normal_1)


@native(WEIGH)
def weigh(weight, particles, measurement, floor, work, parameters):
    """How a belief scores: by the offset across the line of the bearing over that along it, one loop over all particles."""
    line = measurement.heading + measurement.readings[0]
    ahead_x, ahead_y = f32(math.cos(line)), f32(math.sin(line))
    own_x, own_y = f32(measurement.x), f32(measurement.y)
    precision = f32(-0.5 / (parameters[0] * parameters[0]))
    for i in range(weight.shape[0]):
        dx, dy = particles[0, i] - own_x, particles[1, i] - own_y
        along, across = dx * ahead_x + dy * ahead_y, dy * ahead_x - dx * ahead_y
        miss = f32(2.0) * across / (np.sqrt(dx * dx + dy * dy) + abs(along) + f32(1e-3))  # 2 tan(angle / 2)
        weight[i] *= floor + (fast_exp(precision * miss * miss) if along > f32(0.0) else f32(0.0))


@native(OBSERVE)
def observe(out, listener, dx, dy, estimated, estimated_spread, length, spread, parameters):
    """What a policy sees of it: the last bearing."""
    bearing = listener.readings[0]
    out[0] = 0.0 if math.isnan(bearing) else math.cos(bearing)
    out[1] = 0.0 if math.isnan(bearing) else math.sin(bearing)


@dataclass(frozen=True, kw_only=True)
class SidedBearing(Sensor):
    """Parameters travel to the functions above as one row, in the order of the fields."""

    sigma: float = 0.15  # of the bearing [rad]
    readings: ClassVar[tuple[str, ...]] = ("bearing",)
    in_plane: ClassVar[bool] = True
    read = read
    weigh = weigh
    observe = observe

    def features(self, scale):
        return (
            Feature("last_bearing_cos", "of the last bearing; 0 before the first", -1.0, 1.0),
            Feature("last_bearing_sin", "the same; positive to port", -1.0, 1.0),
        )

    def glimpse(self, measurement, estimated):
        return Glimpse(words=f"{math.degrees(measurement['readings'][0]):+.0f} degrees")
