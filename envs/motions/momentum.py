"""Speed and heading drift at random (Clark et al. 2013, Alg. 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.motion_loops import change_momentum, scatter_velocities
from tagtrack.envs.kernels.random import bits_to_normals
from tagtrack.envs.motions.motion import CHOOSE, START, Motion
from tagtrack.envs.validation import FASTEST, require, settle_numbers

f32 = np.float32


@native(START)
def start(heading, speed, bits, parameters):
    max_speed, first_speed = parameters[2], parameters[3]
    scatter_velocities(heading, speed, bits, f32(first_speed if first_speed > 0.0 else max_speed), f32(1.0))


@native(CHOOSE)
def choose(heading, speed, bits, normal_1, normal_2, parameters, time_step):
    speed_sigma, turn_sigma, max_speed = parameters[0], parameters[1], parameters[2]
    root = math.sqrt(time_step)
    bits_to_normals(bits, normal_1, normal_2)
    change_momentum(heading, speed, normal_1, normal_2, f32(speed_sigma * root), f32(turn_sigma * root), f32(max_speed))


@dataclass(frozen=True, kw_only=True)
class MomentumRandomWalk(Motion):
    """Speed and heading drift at random (Alg. 2); defaults are Table I's, for one-second steps."""

    speed_sigma: float = 0.3  # change of speed [m/s per sqrt(s)]
    turn_sigma: float = np.pi / 2  # change of heading [rad per sqrt(s)]
    max_speed: float = 1.0  # [m/s]; the paper leaves the walk of the speed unbounded
    first_speed: float = 0.0  # speeds are uniform up to this at first [m/s]; 0: up to max_speed
    name: ClassVar[str] = "momentum"
    start: ClassVar[Native] = start
    choose: ClassVar[Native] = choose

    def __post_init__(self) -> None:
        settle_numbers(self, speed_sigma=FASTEST, max_speed=FASTEST, first_speed=FASTEST)
        for name in ("speed_sigma", "turn_sigma"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        require(self.max_speed > 0, self, "max_speed", "positive")
        require(0 <= self.first_speed <= self.max_speed, self, "first_speed", f"within 0 to max_speed ({self.max_speed:g} m/s)")
