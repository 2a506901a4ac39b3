"""Augmented Monte Carlo localization: random particles as soon as readings fit worse than they used to.

Thrun et al. 2005 (Probabilistic Robotics, Table 8.3) average the likelihood of the readings slowly and fast; Lin et al. 2013
(Alg. 2) weigh and resample a second time, so that random particles that do not fit are gone before the fish is estimated.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.motion_loops import FULL_TURN
from tagtrack.envs.kernels.random import PURPOSES, RECOVERY, uniform_pair
from tagtrack.envs.kernels.resample_loops import restore_mean, total_weight
from tagtrack.envs.validation import require, settle_numbers

f32 = np.float32
LARGEST_SHARE = 0.5  # of random particles, from which on there is no second resampling (Alg. 2, line 9)


class SecondResampling(enum.IntEnum):
    """When lines 9-16 of Alg. 2 run.

    As printed they run after every reading, and where no particle is random they count the same reading twice.
    """

    NEVER = 0
    WITH_RANDOM = 1
    AS_PRINTED = 2


@dataclass(frozen=True, kw_only=True)
class Recovery:
    """How fast a belief that is wrong is given up; off by default. The papers leave the two rates open."""

    slow_rate: float = 0.0  # alpha_slow of Thrun et al.: share by which w_slow follows the likelihood of each reading
    fast_rate: float = 0.0  # alpha_fast; with 0 no particle is ever random
    second_resampling: SecondResampling = SecondResampling.WITH_RANDOM

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(0 <= self.fast_rate <= 1, self, "fast_rate", "within 0 to 1")
        largest = self.fast_rate or 1.0
        require(0 <= self.slow_rate <= largest, self, "slow_rate", f"within 0 to fast_rate ({largest})")


@compiled
def follow_likelihood(belief, weight, readings, recovery):
    """Update w_slow and w_fast by the mean weight, per reading. Returns the share p of particles that should be random."""
    likelihood = np.float64(total_weight(weight)) / weight.shape[0]
    if readings > 1:
        likelihood = likelihood ** (1.0 / readings)
    belief.w_slow += recovery.slow_rate * (likelihood - belief.w_slow)
    belief.w_fast += recovery.fast_rate * (likelihood - belief.w_fast)
    return max(0.0, 1.0 - belief.w_fast / belief.w_slow) if belief.w_slow > 0.0 else 0.0


@inner
def first_moved(carried, count, stream, purpose):
    """Where to begin when every n-th of N particles goes, ``count`` in all.

    With the first where all were drawn anew. Particles that carry weights (N, or none) stay in their places from one correction
    to the next, and the same ones must not go each time: then anywhere.
    """
    if carried.shape[0] == 0:
        return 0
    unit, _ = uniform_pair(stream, purpose, 2 * count)
    return int(unit * carried.shape[0])


@compiled
def scatter_share(particles, carried, share, x, y, stream, row, half_width):
    """Replace a share of the particles by random ones: anywhere in a square about the vehicle at (x, y), on any heading.

    Each keeps the speed of the one it replaces and, among particles that carry weights, takes the mean one. Instead of a throw
    for each particle (Alg. 2, line 2) every n-th goes: children of one parent lie side by side after resampling, so it takes
    from all alike.
    """
    count = int(share * particles.shape[1] + 0.5)
    own_x = f32(x)
    own_y = f32(y)
    width = f32(2.0 * half_width)
    first = first_moved(carried, count, stream, RECOVERY + PURPOSES * row)
    for k in range(count):
        i = (first + k * particles.shape[1] // count) % particles.shape[1]
        right, up = uniform_pair(stream, RECOVERY + PURPOSES * row, 2 * k)
        turn, _ = uniform_pair(stream, RECOVERY + PURPOSES * row, 2 * k + 1)
        particles[0, i] = own_x + width * (f32(right) - f32(0.5))
        particles[1, i] = own_y + width * (f32(up) - f32(0.5))
        particles[2, i] = FULL_TURN * (f32(turn) - f32(0.5))
        if carried.shape[0] > 0:
            carried[i] = f32(1.0)
    if count > 0:
        restore_mean(carried)


@compiled
def wants_second_resampling(share, recovery):
    """Whether lines 9-16 of Alg. 2 run at a share of random particles."""
    if recovery.second_resampling == SecondResampling.AS_PRINTED:
        return share < LARGEST_SHARE
    return recovery.second_resampling == SecondResampling.WITH_RANDOM and 0.0 < share < LARGEST_SHARE
