"""A new speed and a new direction at every step (Clark et al. 2013, Alg. 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.motion_loops import choose_brownian, scatter_velocities
from tagtrack.envs.motions.motion import CHOOSE, START, Motion
from tagtrack.envs.validation import FASTEST, require, settle_numbers

f32 = np.float32


@native(START)
def start(heading, speed, bits, parameters):
    scatter_velocities(heading, speed, bits, f32(parameters[0]), f32(1.0))


@native(CHOOSE)
def choose(heading, speed, bits, normal_1, normal_2, parameters, time_step):
    max_speed, diffusion = parameters[0], parameters[1]
    if diffusion > 0.0:  # a speed uniform up to v has the mean square v^2 / 3, half of it along each axis
        max_speed = math.sqrt(12.0 * diffusion / time_step)
    choose_brownian(heading, speed, bits, f32(max_speed))


@dataclass(frozen=True, kw_only=True)
class BrownianWalk(Motion):
    """A new speed, uniform up to the largest, and a new direction at every step (Alg. 3).

    As printed, how fast it spreads depends on the step: the variance along each axis grows by max_speed^2 / 6 * time_step in a
    second, in 300 s to 12 m with steps of 1 s and to 39 m with steps of 10 s (max_speed 1 m/s). With a ``diffusion`` it
    grows by twice that, whatever the step; the speeds of a step then follow from it.
    """

    max_speed: float = 1.0  # v_max [m/s]
    diffusion: float = 0.0  # D: the variance along each axis grows by 2*D*t [m^2/s]; 0: as printed
    name: ClassVar[str] = "brownian"
    start: ClassVar[Native] = start
    choose: ClassVar[Native] = choose

    def __post_init__(self) -> None:
        settle_numbers(self, max_speed=FASTEST)
        require(self.max_speed > 0, self, "max_speed", "positive")
        require(self.diffusion >= 0, self, "diffusion", "at least 0")
