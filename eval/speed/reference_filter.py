"""The particle filter of Clark et al. 2013 (Algs. 1 and 2) for one world, in plain numpy and float64, written to be read.

The compiled filter is judged by this one: its posterior has to agree, and its speed is given as a multiple of this
one's. So it is written as one would write it today with numpy and filterpy, without tricks. It leaves out what the
paper's filter does not have: no recovery of a lost target, no information from silence, no correction for the
receiver's rounding to whole units.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from filterpy.monte_carlo import systematic_resample
from numpy.random.mtrand import get_bit_generator, set_bit_generator
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Eq. 8 has a pole at distance zero. A tag nearer than this to the hydrophones is as loud as at this distance [m].
NEAREST = 1.0


@dataclass(kw_only=True)
class ParticleSet:
    """N hypotheses about one fish, all arrays (N,)."""

    x: Floats  # [m]
    y: Floats  # [m]
    heading: Floats  # [rad], counter-clockwise from the x axis
    speed: Floats  # [m/s]

    def advance(self, distance: Floats) -> None:
        """Move every particle along its own heading by distance (N,) [m]."""
        self.x = self.x + distance * np.cos(self.heading)
        self.y = self.y + distance * np.sin(self.heading)

    def select(self, ancestors: NDArray[np.integer]) -> None:
        """Replace the particles by copies of those at the given indices (N,)."""
        self.x, self.y = self.x[ancestors], self.y[ancestors]
        self.heading, self.speed = self.heading[ancestors], self.speed[ancestors]


class MotionModel(Protocol):
    """How a fish moves in one time step."""

    def move(self, particles: ParticleSet, time_step: float, rng: np.random.Generator) -> None:
        """Move all particles by one time step [s], in place."""


@dataclass(frozen=True, kw_only=True)
class MomentumRandomWalk:
    """Speed and heading each do a random walk (Alg. 2).

    The paper gives its sigmas for a step of one second; they grow with the square root of the step, so that the motion
    does not depend on how finely time is cut. The paper's speed is unbounded; a fish's is not, so it is clipped.
    """

    sigma_speed: float = 0.3  # [m/s per sqrt(s)], Table I
    sigma_heading: float = math.pi / 2  # [rad per sqrt(s)], Table I
    max_speed: float = 1.0  # [m/s]

    def move(self, particles: ParticleSet, time_step: float, rng: np.random.Generator) -> None:
        n, scale = particles.speed.size, math.sqrt(time_step)
        speed = particles.speed + self.sigma_speed * scale * rng.standard_normal(n)
        particles.speed = np.clip(speed, 0.0, self.max_speed)
        particles.heading = particles.heading + self.sigma_heading * scale * rng.standard_normal(n)
        particles.advance(particles.speed * time_step)


@dataclass(frozen=True, kw_only=True)
class StereoReceiver:
    """What the Lotek stereo hydrophone is expected to read, and how well a particle explains a reading."""

    sigma_bearing: float = 1.0  # [Lotek bearing units], Table I
    sigma_strength: float = 15.0  # [Lotek signal strength units], Table I
    strength_slope: float = -0.871  # a of Eq. 8
    strength_offset: float = 2.18  # b of Eq. 8
    weight_floor: float = 0.001  # of Eqs. 6, 9 and 10

    def expected_bearing(self, forward: Floats, lateral: Floats) -> Floats:
        """Bearing units for a tag at (N,) metres ahead of and abeam of the vehicle (Eq. 5).

        The cubic takes degrees from the perpendicular to the vehicle's axis, +90 dead ahead and -90 dead astern. With
        |lateral| the angle is asin(cos(relative bearing)): both sides read the same, the receiver cannot tell them
        apart.
        """
        degrees = np.degrees(np.arctan2(forward, np.abs(lateral)))
        return ((-1e-6 * degrees + 2e-5) * degrees + 0.0947) * degrees - 0.2757

    def expected_strength(self, distance: Floats) -> Floats:
        """Signal strength units at (N,) metres (Eq. 8)."""
        return 10**self.strength_offset * np.maximum(distance, NEAREST) ** self.strength_slope

    def bearing_weight(self, reading: float, expected: Floats) -> Floats:
        """h_alpha (Eq. 6)."""
        return self.weight_floor + _density(reading, expected, self.sigma_bearing)

    def strength_weight(self, reading: float, expected: Floats) -> Floats:
        """h_ss (Eq. 9)."""
        return self.weight_floor + _density(reading, expected, self.sigma_strength)

    def combined_weight(self, reading: tuple[float, float], expected: tuple[Floats, Floats]) -> Floats:
        """h_mod of (bearing, strength) (Eq. 10), with sigmas in the denominators.

        The paper prints the expected values there. As printed it would be no density: it has a pole where the expected
        bearing is zero, abeam of the vehicle.
        """
        by_bearing = _density(reading[0], expected[0], self.sigma_bearing)
        by_strength = _density(reading[1], expected[1], self.sigma_strength)
        return self.weight_floor + by_strength * by_bearing


@dataclass(frozen=True, kw_only=True)
class ReferenceFilterParameters:
    """The standard filter of the paper's real-time experiments; those of Table III differ in motion and readings."""

    particles: int = 1000
    time_step: float = 1.0  # [s], the control loop's 1 Hz (4.2)
    receiver_range: float = 100.0  # L [m] (4.1)
    initial_max_speed: float = 1.0  # [m/s]
    motion: MotionModel = field(default_factory=MomentumRandomWalk)
    receiver: StereoReceiver = field(default_factory=StereoReceiver)


class ReferenceFilter:
    """PF_Shark_State_Estimator (Alg. 1): `initialize`, then each second `predict`, and `correct` after a valid ping.

    Resampling is filterpy's systematic one, which draws from numpy's global generator. For that one draw the global
    generator runs on this filter's own bit generator, so a filter is reproducible and leaves the global state
    untouched; two threads must not do so at the same time.
    """

    def __init__(self, parameters: ReferenceFilterParameters, rng: np.random.Generator) -> None:
        if parameters.particles < 1:
            raise ValueError(f"particles must be at least 1, got {parameters.particles}")
        self.parameters = parameters
        self.rng = rng
        self.initialize(0.0, 0.0)

    def initialize(self, vehicle_x: float, vehicle_y: float) -> None:
        """Spread the particles over a square of 2L by 2L about the vehicle [m], with any heading and speed (4.1)."""
        p, n = self.parameters, self.parameters.particles
        self.particles = ParticleSet(
            x=vehicle_x + self.rng.uniform(-p.receiver_range, p.receiver_range, n),
            y=vehicle_y + self.rng.uniform(-p.receiver_range, p.receiver_range, n),
            heading=self.rng.uniform(-math.pi, math.pi, n),
            speed=self.rng.uniform(0.0, p.initial_max_speed, n),
        )

    def predict(self) -> None:
        """Move all particles by one time step (Alg. 1, line 3)."""
        self.parameters.motion.move(self.particles, self.parameters.time_step, self.rng)

    def correct(
        self,
        vehicle_x: float,
        vehicle_y: float,
        heading: float,
        bearing_units: float | None = None,
        strength: float | None = None,
    ) -> None:
        """Weigh the particles by a valid ping and resample (Alg. 1, lines 5-8 and 13-18).

        Args:
            vehicle_x, vehicle_y, heading: pose of the vehicle [m, m, rad].
            bearing_units: Lotek bearing, -9 to 9, or None to use the strength alone (Eq. 9).
            strength: Lotek signal strength, or None to use the bearing alone (Eq. 6); with both Eq. 10 is used.
        Raises:
            ValueError: if both are None.
        """
        receiver = self.parameters.receiver
        dx, dy = self.particles.x - vehicle_x, self.particles.y - vehicle_y
        forward = dx * math.cos(heading) + dy * math.sin(heading)
        lateral = dy * math.cos(heading) - dx * math.sin(heading)
        if bearing_units is not None and strength is not None:
            expected = receiver.expected_bearing(forward, lateral), receiver.expected_strength(np.hypot(dx, dy))
            weights = receiver.combined_weight((bearing_units, strength), expected)
        elif bearing_units is not None:
            weights = receiver.bearing_weight(bearing_units, receiver.expected_bearing(forward, lateral))
        elif strength is not None:
            weights = receiver.strength_weight(strength, receiver.expected_strength(np.hypot(dx, dy)))
        else:
            raise ValueError("a correction needs a bearing or a signal strength")
        with _global_draws_from(self.rng):
            ancestors = systematic_resample(weights / weights.sum())
        self.particles.select(ancestors)

    def mean(self) -> Floats:
        """Estimate (2,) [m]; after a resampling all weights are equal, so no weights appear here."""
        return np.array([self.particles.x.mean(), self.particles.y.mean()])

    def covariance(self) -> Floats:
        """Spread of the particles' positions (2, 2) [m^2], divided by N: they are the belief, not a sample of data."""
        return np.cov(self.particles.x, self.particles.y, bias=True)


def _density(reading: float, expected: Floats, sigma: float) -> Floats:
    return np.exp(-0.5 * ((expected - reading) / sigma) ** 2) / (math.sqrt(2 * math.pi) * sigma)


@contextmanager
def _global_draws_from(rng: np.random.Generator) -> Iterator[None]:
    before = get_bit_generator()
    set_bit_generator(rng.bit_generator)
    try:
        yield
    finally:
        set_bit_generator(before)
