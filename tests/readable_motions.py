"""Motions for the readable filter, which tests alone give it."""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class BrownianRandomWalk:
    """Speed and heading are drawn anew in every step (Clark et al. 2013, Alg. 3)."""

    max_speed: float = 1.0  # [m/s]

    def move(self, particles, time_step, rng):
        count = particles.speed.size
        particles.speed = rng.uniform(0.0, self.max_speed, count)
        particles.heading = rng.uniform(-math.pi, math.pi, count)
        particles.advance(particles.speed * time_step)


@dataclass(frozen=True, kw_only=True)
class CutLevyFlight:
    """Any direction and a step with a Cauchy tail (Alg. 4, Eq. 4), which is cut as the core's is."""

    gamma: float
    max_speed: float

    def move(self, particles, time_step, rng):
        count = particles.speed.size
        particles.heading = rng.uniform(-math.pi, math.pi, count)
        particles.advance(time_step * np.minimum(self.gamma * np.abs(rng.standard_cauchy(count)), self.max_speed))
