"""A fish that swims straight legs with a turn between them, as the targets of today's two learning systems do.

Legs last a while that the fish remembers, so that this is a motion for the true fish alone; a belief assumes a random walk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.geometry import wrap_angle
from tagtrack.envs.kernels.motion_loops import advance
from tagtrack.envs.kernels.random import LEG, uniform_pair
from tagtrack.envs.motions.motion import BEGIN, FOLLOW, Path
from tagtrack.envs.validation import FASTEST, require, settle_numbers

f32 = np.float32
LEG_END, LEGS = range(2)  # places in the memory: when the next leg begins [s], and how many there were


@compiled
def draw_leg(memory, key_0, key_1, episode, tag, shortest, longest):
    """The end of a leg [s] and a unit for its turn, keyed by the number of the leg."""
    length, turn = uniform_pair((key_0, key_1, episode, np.uint64(memory[LEGS])), LEG, 2 * tag)
    memory[LEGS] += 1.0
    memory[LEG_END] += shortest + (longest - shortest) * length
    return turn


@native(BEGIN)
def begin(fish, memory, key_0, key_1, episode, tag, parameters, positions, last, episode_steps):
    """The first leg: a course uniform on the circle."""
    least_speed, max_speed, shortest, longest = parameters[0], parameters[1], parameters[2], parameters[3]
    course, speed = uniform_pair((key_0, key_1, episode, np.uint64(0)), LEG, 2 * tag + 1)
    memory[LEGS] = 0.0
    memory[LEG_END] = 0.0
    draw_leg(memory, key_0, key_1, episode, tag, shortest, longest)
    fish[2, 0] = wrap_angle(2.0 * math.pi * course)
    fish[3, 0] = least_speed + (max_speed - least_speed) * speed


@native(FOLLOW)
def follow(fish, memory, key_0, key_1, episode, tag, parameters, positions, last, step, time_step):
    """Turn where a leg ends before the step or with its beginning, and swim on."""
    shortest, longest, least_turn, largest_turn = parameters[2], parameters[3], parameters[4], parameters[5]
    time = (step - 1) * time_step
    while 0.0 < longest and memory[LEG_END] <= time:
        unit = 2.0 * draw_leg(memory, key_0, key_1, episode, tag, shortest, longest) - 1.0
        turn = least_turn + (largest_turn - least_turn) * abs(unit)
        fish[2, 0] = wrap_angle(np.float64(fish[2, 0]) + math.copysign(turn, unit))
    advance(fish[0], fish[1], fish[2], fish[3], f32(time_step))


@dataclass(frozen=True, kw_only=True)
class StraightLegs(Path):
    """One speed for an episode, uniform between two; legs and turns uniform likewise, the turns to either side."""

    least_speed: float = 0.0  # [m/s]
    max_speed: float = 0.6  # [m/s]
    shortest_leg: float = 0.0  # [s]
    longest_leg: float = 0.0  # [s]; 0: one leg without end
    least_turn: float = 0.0  # [rad]
    largest_turn: float = 0.0  # [rad]
    name: ClassVar[str] = "legs"
    begin: ClassVar[Native] = begin
    follow: ClassVar[Native] = follow

    def __post_init__(self) -> None:
        settle_numbers(self, least_speed=FASTEST, max_speed=FASTEST)
        for least, largest in (("least_speed", "max_speed"), ("shortest_leg", "longest_leg"), ("least_turn", "largest_turn")):
            low = getattr(self, least)
            require(low >= 0, self, least, "at least 0")
            require(getattr(self, largest) >= low, self, largest, f"at least {least} ({low:g})")
