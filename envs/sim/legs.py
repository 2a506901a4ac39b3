"""A fish that swims straight legs with a turn between them, as the targets of today's two learning systems do.

Legs last a while that the fish remembers, so that this is a motion for the true fish alone; a belief assumes a random walk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.motion_loops import advance
from tagtrack.envs.kernels.random import LEG, uniform_pair
from tagtrack.envs.sim.geometry import wrap_angle
from tagtrack.envs.sim.motion import MotionKind, MotionRule
from tagtrack.envs.sim.validation import require, settle_numbers

f32 = np.float32


@dataclass(frozen=True, kw_only=True)
class StraightLegs:
    """One speed for an episode, uniform between two; legs and turns uniform likewise, the turns to either side."""

    least_speed: float = 0.0  # [m/s]
    max_speed: float = 0.6  # [m/s]
    shortest_leg: float = 0.0  # [s]
    longest_leg: float = 0.0  # [s]; 0: one leg without end
    least_turn: float = 0.0  # [rad]
    largest_turn: float = 0.0  # [rad]

    def __post_init__(self) -> None:
        settle_numbers(self)
        for least, largest in (("least_speed", "max_speed"), ("shortest_leg", "longest_leg"), ("least_turn", "largest_turn")):
            low = getattr(self, least)
            require(low >= 0, self, least, "at least 0")
            require(getattr(self, largest) >= low, self, largest, f"at least {least} ({low:g})")

    def rule(self, time_step: float) -> MotionRule:
        return MotionRule(
            kind=int(MotionKind.LEGS),
            max_speed=self.max_speed,
            least_speed=self.least_speed,
            shortest_leg=self.shortest_leg,
            longest_leg=self.longest_leg,
            least_turn=self.least_turn,
            largest_turn=self.largest_turn,
        )


@compiled
def draw_leg(target, stream, t, rule):
    """The end of a leg [s] and a unit for its turn, keyed by the number of the leg."""
    k0, k1, episode, _ = stream
    length, turn = uniform_pair((k0, k1, episode, np.uint64(target.legs)), LEG, 2 * t)
    target.legs += 1
    target.leg_end += rule.shortest_leg + (rule.longest_leg - rule.shortest_leg) * length
    return turn


@compiled
def begin_legs(target, fish, stream, t, rule):
    """The first leg: a course uniform on the circle. ``fish`` is a row (4, 1)."""
    course, speed = uniform_pair(stream, LEG, 2 * t + 1)
    target.legs = 0
    target.leg_end = 0.0
    draw_leg(target, stream, t, rule)
    fish[2, 0] = wrap_angle(2.0 * math.pi * course)
    fish[3, 0] = rule.least_speed + (rule.max_speed - rule.least_speed) * speed


@compiled
def follow_legs(target, fish, stream, t, rule, time, time_step):
    """Turn where a leg ends at ``time`` or before, and swim on for one step."""
    while 0.0 < rule.longest_leg and target.leg_end <= time:
        unit = 2.0 * draw_leg(target, stream, t, rule) - 1.0
        turn = rule.least_turn + (rule.largest_turn - rule.least_turn) * abs(unit)
        fish[2, 0] = wrap_angle(np.float64(fish[2, 0]) + math.copysign(turn, unit))
    advance(fish[0], fish[1], fish[2], fish[3], f32(time_step))
