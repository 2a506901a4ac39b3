"""How a fish moves: the random walks of Clark et al. 2013 (Algs. 2-4) and a boat that runs straight and idles.

The same object moves the true fish and the particles of a belief: a fish is a row of one particle. Give the two different
parameters and you have an experiment on model mismatch.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.motion_loops import (
    advance,
    change_momentum,
    choose_boat,
    choose_brownian,
    choose_levy,
    scatter_velocities,
)
from tagtrack.envs.kernels.random import bits_to_normals, fill_bits
from tagtrack.envs.sim.tracks import LONGEST_GAP
from tagtrack.envs.sim.validation import require, settle_numbers

f32 = np.float32


class MotionKind(enum.IntEnum):
    """Which rule moves a row."""

    MOMENTUM = 0
    BROWNIAN = 1
    LEVY = 2
    BOAT = 3
    REPLAY = 4
    LEGS = 5


@dataclass(frozen=True, kw_only=True)
class MotionRule:
    """What compiled code reads of any motion; fields that a kind does not use stay zero."""

    kind: int
    max_speed: float
    moving_share: float = 1.0
    speed_sigma: float = 0.0
    turn_sigma: float = 0.0
    scale_speed: float = 0.0
    stop_probability: float = 0.0
    start_probability: float = 0.0
    least_speed: float = 0.0
    shortest_leg: float = 0.0
    longest_leg: float = 0.0
    least_turn: float = 0.0
    largest_turn: float = 0.0


@dataclass(frozen=True, kw_only=True)
class MomentumRandomWalk:
    """Speed and heading drift at random (Alg. 2); defaults are Table I's, for one-second steps."""

    speed_sigma: float = 0.3  # change of speed [m/s per sqrt(s)]
    turn_sigma: float = np.pi / 2  # change of heading [rad per sqrt(s)]
    max_speed: float = 1.0  # [m/s]; the paper leaves the walk of the speed unbounded

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("speed_sigma", "turn_sigma"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        require(self.max_speed > 0, self, "max_speed", "positive")

    def rule(self, time_step: float) -> MotionRule:
        root = time_step**0.5
        return MotionRule(
            kind=int(MotionKind.MOMENTUM),
            max_speed=self.max_speed,
            speed_sigma=self.speed_sigma * root,
            turn_sigma=self.turn_sigma * root,
        )


@dataclass(frozen=True, kw_only=True)
class BrownianWalk:
    """A new speed, uniform up to the largest, and a new direction at every step (Alg. 3)."""

    max_speed: float = 1.0  # v_max [m/s]

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.max_speed > 0, self, "max_speed", "positive")

    def rule(self, time_step: float) -> MotionRule:
        return MotionRule(kind=int(MotionKind.BROWNIAN), max_speed=self.max_speed)


@dataclass(frozen=True, kw_only=True)
class LevyFlight:
    """Many short steps and a few long ones, each in a new direction (Alg. 4, Eq. 4)."""

    gamma: float = 0.1  # scale of the step length [m] for a step of one second (Table III: 1e-3 to 1e0)
    max_speed: float = 5.0  # cuts the tail of the step length [m/s]

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("gamma", "max_speed"):
            require(getattr(self, name) > 0, self, name, "positive")

    def rule(self, time_step: float) -> MotionRule:
        return MotionRule(kind=int(MotionKind.LEVY), max_speed=self.max_speed, scale_speed=self.gamma)


@dataclass(frozen=True, kw_only=True)
class StraightAndIdle:
    """A boat, or a second vehicle that carries the tag: straight legs at one speed with idle spells between them."""

    speed: float = 0.7  # on a leg [m/s]
    leg_duration: float = 90.0  # mean [s]
    idle_duration: float = 30.0  # mean [s]

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("speed", "leg_duration", "idle_duration"):
            require(getattr(self, name) > 0, self, name, "positive")

    def rule(self, time_step: float) -> MotionRule:
        return MotionRule(
            kind=int(MotionKind.BOAT),
            max_speed=self.speed,
            moving_share=self.leg_duration / (self.leg_duration + self.idle_duration),
            stop_probability=min(1.0, time_step / self.leg_duration),
            start_probability=min(1.0, time_step / self.idle_duration),
        )


@dataclass(frozen=True, kw_only=True)
class Replay:
    """Recorded tracks move the true fish (``replay.py``); never a model for particles.

    Each episode takes a random stretch of a track, turned by a random angle.
    """

    time_scale: float = 1.0  # 0.5 lets an animal swim its track at half the recorded speed
    longest_gap: float = LONGEST_GAP  # between two rows of a track [s]; a longer one cuts it, and no episode crosses a cut

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("time_scale", "longest_gap"):
            require(getattr(self, name) > 0, self, name, "positive")

    def rule(self, time_step: float) -> MotionRule:
        return MotionRule(kind=int(MotionKind.REPLAY), max_speed=0.0)


Motion = MomentumRandomWalk | BrownianWalk | LevyFlight | StraightAndIdle
MOTIONS = {
    "momentum": MomentumRandomWalk,
    "brownian": BrownianWalk,
    "levy": LevyFlight,
    "boat": StraightAndIdle,
}


@compiled
def start_swimming(particles, bits, rule):
    """Draw first headings and speeds of a row from its ``bits``. For the boat a mover has the one speed of its legs."""
    heading = particles[2]
    speed = particles[3]
    scatter_velocities(heading, speed, bits, f32(rule.max_speed), f32(rule.moving_share))
    if rule.kind == MotionKind.BOAT:
        for i in range(speed.shape[0]):
            speed[i] = f32(rule.max_speed) if speed[i] > f32(0.0) else f32(0.0)


@compiled
def swim(particles, stream, purpose, bits, normal_1, normal_2, rule, time_step):
    """Move a row (4, N) by one time step. Returns the mean displacement (x, y) [m]."""
    x = particles[0]
    y = particles[1]
    heading = particles[2]
    speed = particles[3]
    fill_bits(stream, purpose, bits)
    if rule.kind == MotionKind.MOMENTUM:
        bits_to_normals(bits, normal_1, normal_2)
        change_momentum(
            heading, speed, normal_1, normal_2, f32(rule.speed_sigma), f32(rule.turn_sigma), f32(rule.max_speed)
        )
    elif rule.kind == MotionKind.BROWNIAN:
        choose_brownian(heading, speed, bits, f32(rule.max_speed))
    elif rule.kind == MotionKind.LEVY:
        choose_levy(heading, speed, bits, f32(rule.scale_speed), f32(rule.max_speed))
    else:
        choose_boat(
            heading, speed, bits, f32(rule.max_speed), f32(rule.stop_probability), f32(rule.start_probability)
        )
    return advance(x, y, heading, speed, f32(time_step))
