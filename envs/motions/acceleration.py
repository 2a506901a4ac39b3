"""White acceleration: the state of Masmitja et al. 2020, Eqs. 8 and 9, by which their particles move."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.motion_loops import scatter_velocities
from tagtrack.envs.kernels.random import bits_to_normals
from tagtrack.envs.motions.motion import CHOOSE, START, Motion
from tagtrack.envs.validation import FASTEST, require, settle_numbers

f32 = np.float32


@native(START)
def start(heading, speed, bits, parameters):
    scatter_velocities(heading, speed, bits, f32(parameters[1]), f32(1.0))


@native(CHOOSE)
def choose(heading, speed, bits, normal_1, normal_2, parameters, time_step):
    change = f32(parameters[0] * math.sqrt(time_step))
    bits_to_normals(bits, normal_1, normal_2)
    for i in range(heading.shape[0]):
        along = speed[i] * f32(math.cos(heading[i])) + change * normal_1[i]
        across = speed[i] * f32(math.sin(heading[i])) + change * normal_2[i]
        speed[i] = f32(math.sqrt(along * along + across * across))
        heading[i] = f32(math.atan2(across, along))


@dataclass(frozen=True, kw_only=True)
class WhiteAcceleration(Motion):
    """Velocity changes along each axis by independent normal numbers (Eq. 8 with the transition matrix of Eq. 9)."""

    sigma: float = 0.001  # change of velocity along each axis [m/s per sqrt(s)]; the paper prints no covariance
    first_speed: float = 0.35  # speeds are uniform up to this at first [m/s]
    name: ClassVar[str] = "acceleration"
    start: ClassVar[Native] = start
    choose: ClassVar[Native] = choose

    def __post_init__(self) -> None:
        settle_numbers(self, sigma=FASTEST, first_speed=FASTEST)
        require(self.sigma >= 0, self, "sigma", "at least 0")
        require(self.first_speed >= 0, self, "first_speed", "at least 0")
