"""What a vehicle assumes of the fish and of its own receiver: the parameters of a particle filter (Clark et al. 2013, Alg. 1).

The six filters of Table III are presets in ``FILTERS``; they differ only in the motion that spreads their particles and in the
readings that weigh them. ``AOTT`` is the area-only filter of Masmitja et al. 2020.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

from tagtrack.envs.belief.recovery import Recovery
from tagtrack.envs.kernels.calling import address_of
from tagtrack.envs.motions import BrownianWalk, LevyFlight, MomentumRandomWalk, Motion
from tagtrack.envs.sensors import PresenceReceiver, Sensor, StereoHydrophone, Weighting
from tagtrack.envs.tag import Tag
from tagtrack.envs.validation import require, settle_numbers


class Estimate(enum.IntEnum):
    """What the filter reports: the mean of its particles or the particle that weighed most at the last ping (4.1)."""

    MEAN = 0
    BEST = 1


@dataclass(frozen=True, kw_only=True)
class Belief:
    """What the vehicle assumes of the fish and of its own receiver."""

    particles: int = 1000
    motion: Motion = field(default_factory=MomentumRandomWalk)
    receiver: Sensor = field(default_factory=StereoHydrophone)
    estimate: Estimate = Estimate.MEAN
    weight_floor: float = 0.001  # of Eqs. 6, 9, 10
    half_width: float = 100.0  # L: particles start uniformly in a square of 2L about the vehicle [m]
    farthest: float = 0.0  # more than 0: they start up to this far instead, at all distances alike, as in ``Start`` [m]
    # Compound resampling (Masmitja et al. 2020): at each correction this share of the particles is spread anew about the last
    # estimate, uniformly over a disc of this radius. 0: plain resampling. They are spread before they are weighed, where the
    # paper does so after resampling: no estimate then holds particles that no reading has judged.
    renewed_share: float = 0.0
    renewed_radius: float = 300.0  # maximum particle range [m]
    # Regularized resampling (Musso, Oudjane & Le Gland 2001): each particle that was drawn moves by a normal of the particles'
    # covariance times (jitter * N^(-1/6))^2, but no wider than a range is sure. 0: none. It is for ranges much surer than the
    # particles are dense: RangeOnly-v0 with sigmas of 0.5 m and exact navigation, circle:40, mean error 2.86 m with 1,000
    # particles, 2.63 m with a jitter of 0.3, 2.54 m with 16,000 particles. With vaguer readings it gains nothing.
    jitter: float = 0.0
    # Resample only where the effective sample size (Kong, Liu & Wong 1994) has fallen below this share of the particles, and let
    # them carry their weights until then. 1: at each correction, as in the papers.
    resample_below: float = 1.0
    velocity_memory: float = 20.0  # over which the particles' velocity is averaged; of longer steps it is the step's own [s]
    recovery: Recovery = field(default_factory=Recovery)

    def __post_init__(self) -> None:
        settle_numbers(self)
        if isinstance(self.particles, bool) or not isinstance(self.particles, int) or self.particles < 1:
            raise ValueError(f"Belief.particles must be a whole number of at least 1, got {self.particles!r}")
        if self.particles > 2**20:
            raise ValueError(f"Belief.particles must be at most {2**20}, got {self.particles}")
        if not isinstance(self.motion, Motion):
            raise ValueError(f"Belief.motion cannot be {type(self.motion).__name__}: particles need a random motion")
        if not isinstance(self.receiver, Sensor):
            raise ValueError(f"Belief.receiver must be a Sensor, got {self.receiver!r}")
        require(self.weight_floor >= 0, self, "weight_floor", "at least 0")
        require(0 <= self.renewed_share < 1, self, "renewed_share", "at least 0 and below 1")
        require(self.farthest >= 0, self, "farthest", "at least 0")
        require(self.jitter >= 0, self, "jitter", "at least 0")
        require(0 < self.resample_below <= 1, self, "resample_below", "above 0 and at most 1")
        for name in ("half_width", "renewed_radius", "velocity_memory"):
            require(getattr(self, name) > 0, self, name, "positive")
        self.receiver.require_belief()

    @property
    def rows(self) -> int:
        """Rows of a particle: four, and one more for an estimated number."""
        return 4 + (self.receiver.estimated is not None)

    @property
    def carried(self) -> int:
        """Weights kept beside a row of particles: one for each, or none where every correction resamples."""
        return self.particles if self.resample_below < 1 else 0


FILTERS = {
    "standard": Belief(),
    "acoustic_ss": Belief(receiver=StereoHydrophone(weighting=Weighting.COMBINED)),
    "brownian": Belief(motion=BrownianWalk()),
    "levy": Belief(motion=LevyFlight()),
    "combined_brownian": Belief(motion=BrownianWalk(), receiver=StereoHydrophone(weighting=Weighting.COMBINED)),
    "combined_levy": Belief(motion=LevyFlight(), receiver=StereoHydrophone(weighting=Weighting.COMBINED)),
}
# Masmitja et al. 2020, "AOTT simulations": 10,000 particles, compound resampling at 1.5 %, maximum particle range 300 m. Its
# particles move by Eq. 8 (the motion ``acceleration``), of which no covariance is printed: here a walk of speed and heading that
# fits a target that mostly holds its course at 0.2 m/s.
AOTT = Belief(
    particles=10_000,
    motion=MomentumRandomWalk(speed_sigma=0.006, turn_sigma=0.025, max_speed=0.35),
    receiver=PresenceReceiver(),
    half_width=300.0,
    renewed_share=0.015,
)
BELIEFS = {**FILTERS, "aott": AOTT}


@dataclass(frozen=True, kw_only=True)
class BeliefCalls:
    """Addresses of the functions of a belief's models; good for this process alone."""

    start: int
    choose: int
    weigh: int
    observe: int


@dataclass(frozen=True, kw_only=True)
class FilterRule:
    """What compiled code reads of a ``Belief`` about a ``Tag``."""

    calls: BeliefCalls
    motion: tuple[float, ...]  # parameters of the motion
    model: tuple[float, ...]  # parameters of the sensor
    estimate: int
    weight_floor: float
    half_width: float
    farthest: float
    renewed_share: float
    renewed_radius: float
    jitter: float
    resample_below: float
    velocity_memory: float
    recovery: Recovery
    period: float
    random_delay: float
    longest_interval: float
    weighs_silence: bool
    middle: float  # of the estimated number, or what is assumed of it
    reach: float  # half the width of its interval
    walk: float
    ring_reading: int  # -1: none
    ring_sigma: float
    ring_factor: float
    gate_reading: int  # -1: none
    largest_jump: float


def filter_rule(belief: Belief, tag: Tag) -> FilterRule:
    sensor, motion = belief.receiver, belief.motion
    estimated, ring, gate = sensor.estimated, sensor.ring, sensor.gate
    return FilterRule(
        calls=BeliefCalls(
            start=motion.start.address,
            choose=motion.choose.address,
            weigh=address_of(sensor.weigh),
            observe=address_of(sensor.observe),
        ),
        motion=motion.padded_row(),
        model=sensor.padded_row(),
        estimate=int(belief.estimate),
        weight_floor=belief.weight_floor,
        half_width=belief.half_width,
        farthest=belief.farthest,
        renewed_share=belief.renewed_share,
        renewed_radius=belief.renewed_radius,
        jitter=belief.jitter,
        resample_below=belief.resample_below,
        velocity_memory=belief.velocity_memory,
        recovery=belief.recovery,
        period=tag.period,
        random_delay=tag.random_delay,
        longest_interval=tag.longest_interval,
        weighs_silence=sensor.weighs_silence,
        middle=sensor.assumed if estimated is None else estimated.middle,
        reach=0.0 if estimated is None else estimated.half_width,
        walk=0.0 if estimated is None else estimated.walk,
        ring_reading=-1 if ring is None else ring.reading,
        ring_sigma=1.0 if ring is None else ring.sigma,
        ring_factor=1.0 if ring is None else ring.factor,
        gate_reading=-1 if gate is None else gate.reading,
        largest_jump=0.0 if gate is None else gate.largest_jump,
    )
