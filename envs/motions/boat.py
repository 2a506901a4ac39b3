"""A boat, or a second vehicle that carries the tag: straight legs at one speed with idle spells between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.motion_loops import choose_boat, scatter_velocities
from tagtrack.envs.motions.motion import CHOOSE, START, Motion
from tagtrack.envs.validation import FASTEST, require, settle_numbers

f32 = np.float32


@native(START)
def start(heading, speed, bits, parameters):
    cruise, leg, idle = parameters[0], parameters[1], parameters[2]
    scatter_velocities(heading, speed, bits, f32(cruise), f32(leg / (leg + idle)))
    for i in range(speed.shape[0]):
        speed[i] = f32(cruise) if speed[i] > f32(0.0) else f32(0.0)  # a mover has the one speed of its legs


@native(CHOOSE)
def choose(heading, speed, bits, normal_1, normal_2, parameters, time_step):
    cruise, leg, idle = parameters[0], parameters[1], parameters[2]
    choose_boat(heading, speed, bits, f32(cruise), f32(min(1.0, time_step / leg)), f32(min(1.0, time_step / idle)))


@dataclass(frozen=True, kw_only=True)
class StraightAndIdle(Motion):
    """A boat, or a second vehicle that carries the tag: straight legs at one speed with idle spells between them."""

    speed: float = 0.7  # on a leg [m/s]
    leg_duration: float = 90.0  # mean [s]
    idle_duration: float = 30.0  # mean [s]
    name: ClassVar[str] = "boat"
    start: ClassVar[Native] = start
    choose: ClassVar[Native] = choose

    def __post_init__(self) -> None:
        settle_numbers(self, speed=FASTEST)
        for name in ("speed", "leg_duration", "idle_duration"):
            require(getattr(self, name) > 0, self, name, "positive")
