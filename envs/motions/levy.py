"""Many short steps and a few long ones (Clark et al. 2013, Alg. 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.motion_loops import choose_levy, scatter_velocities
from tagtrack.envs.motions.motion import CHOOSE, START, Motion
from tagtrack.envs.validation import require, settle_numbers

f32 = np.float32


@native(START)
def start(heading, speed, bits, parameters):
    scatter_velocities(heading, speed, bits, f32(parameters[1]), f32(1.0))


@native(CHOOSE)
def choose(heading, speed, bits, normal_1, normal_2, parameters, time_step):
    gamma, max_speed = parameters[0], parameters[1]
    choose_levy(heading, speed, bits, f32(gamma), f32(max_speed))


@dataclass(frozen=True, kw_only=True)
class LevyFlight(Motion):
    """Many short steps and a few long ones, each in a new direction (Alg. 4, Eq. 4)."""

    gamma: float = 0.1  # scale of the step length [m] for a step of one second (Table III: 1e-3 to 1e0)
    max_speed: float = 5.0  # cuts the tail of the step length [m/s]
    name: ClassVar[str] = "levy"
    start: ClassVar[Native] = start
    choose: ClassVar[Native] = choose

    def __post_init__(self) -> None:
        settle_numbers(self)  # any speed: Alg. 4 cuts no step
        for name in ("gamma", "max_speed"):
            require(getattr(self, name) > 0, self, name, "positive")
