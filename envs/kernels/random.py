"""Counter-based random numbers: Philox4x32 (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3").

A draw is a pure function of (seed, episode, step, purpose, index): no generator is carried along, so a world gives the same
numbers alone, in any batch and on any number of threads. Particles use 7 rounds, the smallest number that passes BigCrush.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.maths import fast_log, sin_of_turns

ROUNDS = 7

# Purposes: the fourth counter word. Each owns the numbers drawn for it, so that adding a draw to one leaves the others alone.
# A purpose that fills whole rows adds PURPOSES times the number of the row. They are of numpy's type, for numba compiles a
# function anew for each whole number of Python's that it is given.
START, TRACK, FISH, WATER, HEARING, READING, NAVIGATING, SPREAD, PREDICT, RESAMPLE = np.arange(10)
PING, LEG, STEERING, RENEWAL, REACH, RECOVERY = np.arange(10, 16)
PURPOSES = np.int64(16)
# All sixteen are taken, and more of them would change the numbers of every row but the first. But RESAMPLE draws one number for
# a row, under its own word and the row's index, so the words of its further rows are free; as are those of HEARING, READING and
# WATER, which draw for pairs.
JITTER = RESAMPLE + PURPOSES
MODEM, MODEM_POSE, OVERLAP = HEARING + PURPOSES, READING + PURPOSES, WATER + PURPOSES

# Several vehicles and tags: each pair, each row and each tag has a place of its own in the counters, whatever the others are, so
# that one more of them changes no draw of theirs.
MOST = 256  # vehicles, or tags, of a world

_MULTIPLIER_0 = np.uint64(0xD2511F53)
_MULTIPLIER_1 = np.uint64(0xCD9E8D57)
_WEYL_0 = np.uint64(0x9E3779B9)
_WEYL_1 = np.uint64(0xBB67AE85)
_WORD = np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(32)
_TO_UNIT = np.float64(2.0**-32)


@compiled
def philox(c0, c1, c2, c3, k0, k1, rounds):
    """Philox4x32: four random words from the counter words c0..c3 and the key words k0, k1.

    Words are uint64 of which only the lower half counts; what stands above is dropped at the next product and at the end.
    So the SIMD code needs no packing between rounds.
    """
    for _ in range(rounds):
        product_0 = _MULTIPLIER_0 * (c0 & _WORD)
        product_1 = _MULTIPLIER_1 * (c2 & _WORD)
        c0, c1, c2, c3 = (product_1 >> _SHIFT) ^ c1 ^ k0, product_1, (product_0 >> _SHIFT) ^ c3 ^ k1, product_0
        k0 = k0 + _WEYL_0
        k1 = k1 + _WEYL_1
    return c0 & _WORD, c1 & _WORD, c2 & _WORD, c3 & _WORD


@inner
def stream_of(clock):
    """The words that key all draws of one step: of the ``seed``, ``episode`` and ``step`` of a clock."""
    seed = clock.seed
    return seed & np.uint64(0xFFFFFFFF), seed >> np.uint64(32), clock.episode, np.uint64(clock.step)


@compiled
def place_of(vehicle, tag):
    """The number of a pair among the draws of a world."""
    return vehicle * MOST + tag


@compiled
def uniform_pair(stream, purpose, index):
    """Two float64 uniforms in (0, 1). ``stream`` is (k0, k1, episode, step) as uint64."""
    k0, k1, episode, step = stream
    a, b, c, d = philox(np.uint64(index), step, episode, np.uint64(purpose), k0, k1, ROUNDS)
    return (np.float64(a) + 0.5) * _TO_UNIT, (np.float64(b) + 0.5) * _TO_UNIT


@compiled
def normal_pair(stream, purpose, index):
    """Two float64 standard normals (Box-Muller with the library's functions: for the few draws of the world itself)."""
    u, w = uniform_pair(stream, purpose, index)
    radius = math.sqrt(-2.0 * math.log(u))
    return radius * math.cos(2.0 * math.pi * w), radius * math.sin(2.0 * math.pi * w)


@compiled
def fill_bits(stream, purpose, bits):
    """Fill an int32 row, its length a multiple of four, with random bits: one word to a particle, four to a call of Philox."""
    k0, k1, episode, step = stream
    quarter = bits.shape[0] // 4
    word = np.uint64(purpose)
    for i in range(quarter):
        a, b, c, d = philox(np.uint64(i), step, episode, word, k0, k1, ROUNDS)
        bits[i] = np.int32(a)
        bits[i + quarter] = np.int32(b)
        bits[i + 2 * quarter] = np.int32(c)
        bits[i + 3 * quarter] = np.int32(d)


@compiled
def high_unit(bits):
    """Uniform float32 in (0, 1) from the upper 16 of 32 random bits."""
    return (np.float32((bits >> np.int32(16)) & np.int32(0xFFFF)) + np.float32(0.5)) * np.float32(2.0**-16)


@compiled
def low_turn(bits):
    """Uniform float32 in [-1/2, 1/2) from the lower 16 of 32 random bits: a direction in turns."""
    return np.float32(np.int32(bits << np.int32(16)) >> np.int32(16)) * np.float32(2.0**-16)


@compiled
def bits_to_normals(bits, normal_1, normal_2):
    """Two standard normals a particle from 32 random bits, by Box and Muller (float32).

    Sixteen bits for the radius reach 4.86 standard deviations, one draw in a million falls beyond: particles do not notice.
    """
    for i in range(normal_1.shape[0]):
        radius = np.sqrt(np.float32(-2.0) * fast_log(high_unit(bits[i])))
        turn = low_turn(bits[i])
        normal_1[i] = radius * sin_of_turns(turn)
        normal_2[i] = radius * sin_of_turns(np.float32(0.25) - abs(turn))
