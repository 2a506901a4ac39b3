"""What a motion is: it chooses headings and speeds, and the core swims them.

A ``Motion`` is a random walk. The same object moves the true fish and the particles of a belief: a fish is a row of one particle
(Clark et al. 2013, Algs. 2-4). A ``Path`` remembers more of one animal than a particle holds, and moves the true fish alone.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.calling import (
    Native,
    Signature,
    bits,
    nothing,
    number,
    numbers,
    require_functions,
    rows,
    singles,
    table,
    whole,
    wholes,
    word,
)
from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.motion_loops import advance, advance_by_weight
from tagtrack.envs.kernels.random import fill_bits
from tagtrack.envs.model import Model

f32 = np.float32
MEMORY = 8  # numbers that a path remembers of one animal

# Fills first headings [rad, within +-pi] and speeds [m/s] of a row from 32 random bits a particle.
START = Signature("start", nothing, heading=singles, speed=singles, bits=bits, parameters=numbers)
# Changes headings and speeds of a row, which then swims for `time_step` [s]; `normal_1` and `normal_2` are rows to work in.
CHOOSE = Signature(
    "choose",
    nothing,
    heading=singles,
    speed=singles,
    bits=bits,
    normal_1=singles,
    normal_2=singles,
    parameters=numbers,
    time_step=number,
)
# Begins the path of a fish (4, 1), which stands at its place; `memory` (8,) is the path's own. The key's two words, the episode
# and the number of the tag key its draws; `positions` (K, 2) and `last` (G,) are the table of recorded tracks (`replay.py`).
BEGIN = Signature(
    "begin",
    nothing,
    fish=rows,
    memory=numbers,
    key_0=word,
    key_1=word,
    episode=word,
    tag=whole,
    parameters=numbers,
    positions=table,
    last=wholes,
    episode_steps=whole,
)
# Moves the fish to where it is after `step` steps of `time_step` [s].
FOLLOW = Signature(
    "follow",
    nothing,
    fish=rows,
    memory=numbers,
    key_0=word,
    key_1=word,
    episode=word,
    tag=whole,
    parameters=numbers,
    positions=table,
    last=wholes,
    step=whole,
    time_step=number,
)

# Callables of addresses, for compiled code.
start_at, choose_at, begin_at, follow_at = START.at, CHOOSE.at, BEGIN.at, FOLLOW.at


class Motion(Model):
    """A random walk, of a fish or of particles."""

    start: ClassVar[Native]
    choose: ClassVar[Native]

    def __init_subclass__(cls) -> None:
        require_functions(cls, start=START, choose=CHOOSE)


class Path(Model):
    """A way that one animal takes; no model for particles."""

    begin: ClassVar[Native]
    follow: ClassVar[Native]

    def __init_subclass__(cls) -> None:
        require_functions(cls, begin=BEGIN, follow=FOLLOW)


@compiled
def start_swimming(particles, bits, start, parameters):
    """Draw first headings and speeds of a row (4 or more, N) from its ``bits``; ``start`` is the function's address."""
    start_at(start)(particles[2], particles[3], bits, parameters)


@compiled
def swim(particles, stream, purpose, bits, normal_1, normal_2, choose, parameters, time_step):
    """Move a row (4 or more, N) by one time step. Returns the mean displacement (x, y) [m]."""
    fill_bits(stream, purpose, bits)
    choose_at(choose)(particles[2], particles[3], bits, normal_1, normal_2, parameters, time_step)
    return advance(particles[0], particles[1], particles[2], particles[3], f32(time_step))


@inner
def swim_by_weight(particles, weight, stream, purpose, bits, normal_1, normal_2, choose, parameters, time_step):
    """As ``swim``, for a row of particles that carry weights (N,): the mean is weighted."""
    fill_bits(stream, purpose, bits)
    choose_at(choose)(particles[2], particles[3], bits, normal_1, normal_2, parameters, time_step)
    return advance_by_weight(particles[0], particles[1], particles[2], particles[3], weight, f32(time_step))
