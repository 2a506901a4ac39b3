"""The particle filter of Clark et al. 2013 (Alg. 1): predict at every step, weigh and resample when a ping is heard.

The six filters of Table III are presets in ``FILTERS``; they differ only in the motion that spreads their particles and in the
readings that weigh them.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.motion_loops import scatter_uniformly
from tagtrack.envs.kernels.random import PREDICT, PURPOSES, RESAMPLE, SPREAD, fill_bits, uniform_pair
from tagtrack.envs.kernels.resample_loops import fill_row, heaviest, resample
from tagtrack.envs.kernels.summary_loops import mean_about, spread_about
from tagtrack.envs.kernels.weight_loops import expect_strength, weigh_bearing, weigh_combined, weigh_strength
from tagtrack.envs.sim.acoustics import StereoHydrophone
from tagtrack.envs.sim.motion import (
    BrownianWalk,
    LevyFlight,
    MomentumRandomWalk,
    Motion,
    MotionRule,
    start_swimming,
    swim,
)
from tagtrack.envs.sim.validation import require, settle_numbers

f32 = np.float32


class Weighting(enum.IntEnum):
    """Which reading weighs the particles: h_alpha (Eq. 6), h_ss (Eq. 9) or h_mod (Eq. 10)."""

    BEARING = 0
    STRENGTH = 1
    COMBINED = 2


class Estimate(enum.IntEnum):
    """What the filter reports: the mean of its particles or the particle that weighed most at the last ping (4.1)."""

    MEAN = 0
    BEST = 1


@dataclass(frozen=True, kw_only=True)
class Belief:
    """What the vehicle assumes of the fish and of its own receiver."""

    particles: int = 1000
    motion: Motion = field(default_factory=MomentumRandomWalk)
    receiver: StereoHydrophone = field(default_factory=StereoHydrophone)
    weighting: Weighting = Weighting.BEARING
    estimate: Estimate = Estimate.MEAN
    weight_floor: float = 0.001  # of Eqs. 6, 9, 10
    half_width: float = 100.0  # L: particles start uniformly in a square of 2L about the vehicle [m]

    def __post_init__(self) -> None:
        settle_numbers(self)
        if isinstance(self.particles, bool) or not isinstance(self.particles, int) or self.particles < 1:
            raise ValueError(f"Belief.particles must be a whole number of at least 1, got {self.particles!r}")
        if self.particles > 2**20:
            raise ValueError(f"Belief.particles must be at most {2**20}, got {self.particles}")
        require(self.weight_floor >= 0, self, "weight_floor", "at least 0")
        require(self.half_width > 0, self, "half_width", "positive")


FILTERS = {
    "standard": Belief(),
    "acoustic_ss": Belief(weighting=Weighting.COMBINED),
    "brownian": Belief(motion=BrownianWalk()),
    "levy": Belief(motion=LevyFlight()),
    "combined_brownian": Belief(motion=BrownianWalk(), weighting=Weighting.COMBINED),
    "combined_levy": Belief(motion=LevyFlight(), weighting=Weighting.COMBINED),
}


@dataclass(frozen=True, kw_only=True)
class FilterRule:
    """What compiled code reads of a ``Belief``."""

    motion: MotionRule
    receiver: StereoHydrophone
    weighting: int
    estimate: int
    weight_floor: float
    half_width: float


def filter_rule(belief: Belief, time_step: float) -> FilterRule:
    return FilterRule(
        motion=belief.motion.rule(time_step),
        receiver=belief.receiver,
        weighting=int(belief.weighting),
        estimate=int(belief.estimate),
        weight_floor=belief.weight_floor,
        half_width=belief.half_width,
    )


# One owner's belief about one tag. Means [m], spreads [m^2], velocities [m/s] (an average over some 20 s), `best` the index of
# the particle that weighed most, `error` the distance from the estimate to the true fish [m] (known to the referee alone).
BELIEF = np.dtype(
    [
        (name, np.float64)
        for name in (
            "mean_x", "mean_y", "estimate_x", "estimate_y", "xx", "yy", "xy", "velocity_x", "velocity_y", "error",
        )
    ]
    + [("best", np.int64)]
)  # fmt: skip


class Scratch(NamedTuple):
    """Rows that one thread works in; nothing in them outlives a row of particles."""

    bits: np.ndarray  # int32, particles rounded up to a multiple of 32
    normal_1: np.ndarray  # (N,) float32, as the next two
    normal_2: np.ndarray
    weight: np.ndarray
    fixed: np.ndarray  # (N,) int32
    parent: np.ndarray  # (N + 1,) int32


def make_scratch(particles: int) -> Scratch:
    return Scratch(
        bits=np.zeros(-(-particles // 32) * 32, np.int32),
        normal_1=np.zeros(particles, np.float32),
        normal_2=np.zeros(particles, np.float32),
        weight=np.zeros(particles, np.float32),
        fixed=np.zeros(particles, np.int32),
        parent=np.zeros(particles + 1, np.int32),
    )


@compiled
def spread_particles(particles, belief, centre_x, centre_y, stream, row, rule, scratch):
    """First particles: uniform in a square about the vehicle, with random headings and speeds (4.1)."""
    fill_bits(stream, SPREAD + PURPOSES * row, scratch.bits)
    scatter_uniformly(
        particles[0], particles[1], scratch.bits, f32(centre_x), f32(centre_y), f32(rule.half_width)
    )
    fill_bits(stream, PREDICT + PURPOSES * row, scratch.bits)
    start_swimming(particles, scratch.bits, rule.motion)
    belief.velocity_x = 0.0
    belief.velocity_y = 0.0
    belief.best = 0


@compiled
def predict(particles, belief, stream, row, rule, time_step, scratch):
    """Prediction (Alg. 1, lines 2-3), at every step, whether or not a ping was heard."""
    step_x, step_y = swim(
        particles,
        stream,
        PREDICT + PURPOSES * row,
        scratch.bits,
        scratch.normal_1,
        scratch.normal_2,
        rule.motion,
        time_step,
    )
    share = min(1.0, time_step / 20.0)
    belief.velocity_x += share * (np.float64(step_x) / time_step - belief.velocity_x)
    belief.velocity_y += share * (np.float64(step_y) / time_step - belief.velocity_y)


@compiled
def begin_weights(scratch):
    fill_row(scratch.weight, f32(1.0))


@compiled
def weigh(particles, vehicle, contact, rule, scratch):
    """Multiply the weights by the likelihood of one vehicle's reading (Alg. 1, lines 4-9)."""
    x = particles[0]
    y = particles[1]
    own_x = f32(vehicle.believed_x)
    own_y = f32(vehicle.believed_y)
    ahead_x = f32(math.cos(vehicle.compass))
    ahead_y = f32(math.sin(vehicle.compass))
    receiver = rule.receiver
    slope = f32(receiver.strength_slope)
    log_scale = f32(receiver.strength_scale * math.log(10.0))
    units = f32(contact.units)
    strength = f32(contact.strength)
    sigma = f32(receiver.bearing_sigma)
    strength_sigma = f32(receiver.strength_sigma)
    floor = f32(rule.weight_floor)
    if rule.weighting == Weighting.BEARING:
        weigh_bearing(scratch.weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, floor)
    elif rule.weighting == Weighting.STRENGTH:
        weigh_strength(scratch.weight, x, y, own_x, own_y, strength, slope, log_scale, strength_sigma, floor)
    else:
        expect_strength(scratch.normal_1, x, y, own_x, own_y, slope, log_scale)
        weigh_combined(
            scratch.weight, scratch.normal_1, x, y, own_x, own_y, ahead_x, ahead_y,
            units, sigma, strength, strength_sigma, floor,
        )  # fmt: skip


@compiled
def correct(particles, belief, stream, row, rule, scratch):
    """Correction (Alg. 1, lines 12-18): resample by weight. Keeps hold of the particle that weighed most."""
    offset, _ = uniform_pair(stream, RESAMPLE, row)
    best = heaviest(scratch.weight) if rule.estimate == Estimate.BEST else 0
    if resample(particles, scratch.weight, scratch.fixed, scratch.parent, scratch.normal_1, offset):
        belief.best = min(scratch.fixed[best], particles.shape[1] - 1)


@compiled
def summarize(particles, belief, vehicle, rule):
    """Mean, spread and estimate of a row. Returns the share of particles to port of the vehicle."""
    x = particles[0]
    y = particles[1]
    own_x = f32(vehicle.believed_x)
    own_y = f32(vehicle.believed_y)
    ahead_x = f32(math.cos(vehicle.compass))
    ahead_y = f32(math.sin(vehicle.compass))
    offset_x, offset_y, port = mean_about(x, y, own_x, own_y, ahead_x, ahead_y)
    xx, yy, xy = spread_about(x, y, own_x + offset_x, own_y + offset_y)
    belief.mean_x = np.float64(own_x) + np.float64(offset_x)
    belief.mean_y = np.float64(own_y) + np.float64(offset_y)
    belief.xx = xx
    belief.yy = yy
    belief.xy = xy
    if rule.estimate == Estimate.BEST:
        belief.estimate_x = x[belief.best]
        belief.estimate_y = y[belief.best]
    else:
        belief.estimate_x = belief.mean_x
        belief.estimate_y = belief.mean_y
    return port


def covariance(belief: Any) -> np.ndarray:
    """(..., 2, 2) covariance [m^2] of a structured array of ``BELIEF``."""
    flat = np.stack([belief["xx"], belief["xy"], belief["xy"], belief["yy"]], axis=-1)
    return flat.reshape(*flat.shape[:-1], 2, 2)
