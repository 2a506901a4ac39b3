"""The particle filter of Clark et al. 2013 (Alg. 1): predict at every step, weigh and resample when something was heard.

The six filters of Table III are presets in ``FILTERS``; they differ only in the motion that spreads their particles and in the
readings that weigh them. ``AOTT`` is the area-only filter of Masmitja et al. 2020. Particles are rows: x, y, heading, speed and,
where a belief estimates the range of a presence receiver, that range.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tagtrack.envs.belief.recovery import Recovery
from tagtrack.envs.belief.renewal import spread_reach, walk_reach
from tagtrack.envs.belief.weighing import Measurements, Weighting
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.motion_loops import scatter_on_annulus, scatter_uniformly
from tagtrack.envs.kernels.random import PREDICT, PURPOSES, RESAMPLE, SPREAD, fill_bits, uniform_pair
from tagtrack.envs.kernels.resample_loops import heaviest, resample
from tagtrack.envs.sim.motion import (
    BrownianWalk,
    LevyFlight,
    MomentumRandomWalk,
    Motion,
    MotionRule,
    start_swimming,
    swim,
)
from tagtrack.envs.sim.receivers import (
    PresenceReceiver,
    RangeReceiver,
    Receiver,
    ReceiverRule,
    StereoHydrophone,
    TimeOfFlightReceiver,
)
from tagtrack.envs.sim.validation import require, settle_numbers

f32 = np.float32


class Estimate(enum.IntEnum):
    """What the filter reports: the mean of its particles or the particle that weighed most at the last ping (4.1)."""

    MEAN = 0
    BEST = 1


@dataclass(frozen=True, kw_only=True)
class Belief:
    """What the vehicle assumes of the fish and of its own receiver."""

    particles: int = 1000
    motion: Motion = field(default_factory=MomentumRandomWalk)
    receiver: Receiver = field(default_factory=StereoHydrophone)
    weighting: Weighting = Weighting.BEARING
    measurements: Measurements = Measurements.BOTH  # of a time-of-flight receiver
    # Delta d_max of Lin et al. 2013, Alg. 1: from one time-of-flight range to the next [m]; a ping beyond is not used.
    largest_jump: float = 50.0
    estimate: Estimate = Estimate.MEAN
    weight_floor: float = 0.001  # of Eqs. 6, 9, 10
    # Whether presence is weighed by a Cauchy distribution, as in the published code of Masmitja, in place of Eq. 22's normal one.
    heavy_tails: bool = False
    half_width: float = 100.0  # L: particles start uniformly in a square of 2L about the vehicle [m]
    farthest: float = 0.0  # more than 0: they start up to this far instead, at all distances alike, as in ``Start`` [m]
    # Compound resampling (Masmitja et al. 2020): at each correction this share of the particles is spread anew about the last
    # estimate, uniformly over a disc of this radius. 0: plain resampling. They are spread before they are weighed, where the
    # paper does so after resampling: no estimate then holds particles that no reading has judged.
    renewed_share: float = 0.0
    renewed_radius: float = 300.0  # maximum particle range [m]
    recovery: Recovery = field(default_factory=Recovery)

    def __post_init__(self) -> None:
        settle_numbers(self)
        if isinstance(self.particles, bool) or not isinstance(self.particles, int) or self.particles < 1:
            raise ValueError(f"Belief.particles must be a whole number of at least 1, got {self.particles!r}")
        if self.particles > 2**20:
            raise ValueError(f"Belief.particles must be at most {2**20}, got {self.particles}")
        require(self.weight_floor >= 0, self, "weight_floor", "at least 0")
        require(0 <= self.renewed_share < 1, self, "renewed_share", "at least 0 and below 1")
        require(self.farthest >= 0, self, "farthest", "at least 0")
        for name in ("half_width", "renewed_radius", "largest_jump"):
            require(getattr(self, name) > 0, self, name, "positive")
        if isinstance(self.receiver, (RangeReceiver, TimeOfFlightReceiver)):
            require(self.receiver.range_sigma > 0, self.receiver, "range_sigma", "positive in a belief")

    @property
    def rows(self) -> int:
        """Rows of a particle: four, and one more for an estimated range."""
        return 4 + (isinstance(self.receiver, PresenceReceiver) and self.receiver.max_range_spread > 0)


FILTERS = {
    "standard": Belief(),
    "acoustic_ss": Belief(weighting=Weighting.COMBINED),
    "brownian": Belief(motion=BrownianWalk()),
    "levy": Belief(motion=LevyFlight()),
    "combined_brownian": Belief(motion=BrownianWalk(), weighting=Weighting.COMBINED),
    "combined_levy": Belief(motion=LevyFlight(), weighting=Weighting.COMBINED),
}
# Masmitja et al. 2020, "AOTT simulations": 10,000 particles, compound resampling at 1.5 %, maximum particle range 300 m. How its
# particles move is not said: here as fits a target that mostly holds its course at 0.2 m/s.
AOTT = Belief(
    particles=10_000,
    motion=MomentumRandomWalk(speed_sigma=0.006, turn_sigma=0.025, max_speed=0.35),
    receiver=PresenceReceiver(),
    half_width=300.0,
    renewed_share=0.015,
)
BELIEFS = {**FILTERS, "aott": AOTT}


@dataclass(frozen=True, kw_only=True)
class FilterRule:
    """What compiled code reads of a ``Belief``."""

    motion: MotionRule
    receiver: ReceiverRule
    weighting: int
    measurements: int
    largest_jump: float
    estimate: int
    weight_floor: float
    heavy_tails: bool
    half_width: float
    farthest: float
    renewed_share: float
    renewed_radius: float
    recovery: Recovery


def filter_rule(belief: Belief, time_step: float) -> FilterRule:
    return FilterRule(
        motion=belief.motion.rule(time_step),
        receiver=belief.receiver.rule(),
        weighting=int(belief.weighting),
        measurements=int(belief.measurements),
        largest_jump=belief.largest_jump,
        estimate=int(belief.estimate),
        weight_floor=belief.weight_floor,
        heavy_tails=belief.heavy_tails,
        half_width=belief.half_width,
        farthest=belief.farthest,
        renewed_share=belief.renewed_share,
        renewed_radius=belief.renewed_radius,
        recovery=belief.recovery,
    )


# One owner's belief about one tag. Means [m], spreads [m^2], velocities [m/s] (an average over some 20 s), `best` the index of
# the particle that weighed most, `corrections` how many there were, `max_range` and its `_spread` (standard deviation) what
# is believed of a presence receiver's range [m], `w_slow` and `w_fast` likelihoods of readings averaged (see ``recovery.py``),
# `error` the distance from estimate to fish [m] (known to the referee alone).
BELIEF = np.dtype(
    [
        (name, np.float64)
        for name in (
            "mean_x", "mean_y", "estimate_x", "estimate_y", "xx", "yy", "xy", "velocity_x", "velocity_y", "max_range",
            "max_range_spread", "w_slow", "w_fast", "error",
        )
    ]
    + [("best", np.int64), ("corrections", np.int64)]
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
    x, y = particles[0], particles[1]
    if rule.farthest > 0.0:
        scatter_on_annulus(x, y, scratch.bits, f32(centre_x), f32(centre_y), f32(0.0), f32(rule.farthest))
    else:
        scatter_uniformly(x, y, scratch.bits, f32(centre_x), f32(centre_y), f32(rule.half_width))
    fill_bits(stream, PREDICT + PURPOSES * row, scratch.bits)
    start_swimming(particles, scratch.bits, rule.motion)
    belief.velocity_x = 0.0
    belief.velocity_y = 0.0
    belief.best = 0
    belief.corrections = 0
    belief.w_slow = 0.0
    belief.w_fast = 0.0
    if particles.shape[0] > 4:
        spread_reach(particles[4], stream, row, rule.receiver, scratch)


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
def correct(particles, belief, stream, row, rule, scratch):
    """Correction (Alg. 1, lines 12-18): resample by weight."""
    belief.corrections += 1
    offset, _ = uniform_pair(stream, RESAMPLE, row)
    draw_by_weight(particles, belief, offset, rule, scratch)
    if particles.shape[0] > 4:
        walk_reach(particles[4], stream, row, rule.receiver, scratch)


@compiled
def draw_by_weight(particles, belief, offset, rule, scratch):
    """Resample, and keep hold of the particle that weighed most."""
    best = heaviest(scratch.weight) if rule.estimate == Estimate.BEST else 0
    if resample(particles, scratch.weight, scratch.fixed, scratch.parent, scratch.normal_1, offset):
        belief.best = min(scratch.fixed[best], particles.shape[1] - 1)
