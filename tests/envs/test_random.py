"""Philox against the vectors its authors publish with Random123, and the streams that the simulation draws from it.

Statistical bounds are four standard errors (two-sided chance 6e-5) unless a test says otherwise; seeds are fixed, so a test that
passes goes on passing.
"""

import math

import numba
import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.kernels import random as kernel_random
from tagtrack.envs.kernels.random import (
    PURPOSES,
    START,
    bits_to_normals,
    fill_bits,
    high_unit,
    low_turn,
    normal_pair,
    philox,
    uniform_pair,
)

KNOWN_ANSWERS = [  # Random123, tests/kat_vectors: rounds, counter, key, answer
    (10, "00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    (10, "ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    (10, "243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
    (7, "00000000 00000000 00000000 00000000", "00000000 00000000", "5f6fb709 0d893f64 4f121f81 4f730a48"),
]


def words(text):
    return [np.uint64(int(word, 16)) for word in text.split()]


def make_stream(seed=0, episode=0, step=0):
    return np.uint64(seed & 0xFFFFFFFF), np.uint64(seed >> 32), np.uint64(episode), np.uint64(step)


@numba.njit
def fill_uniforms(stream, purpose, values):
    for i in range(values.shape[0]):
        values[i, 0], values[i, 1] = uniform_pair(stream, purpose, i)


@numba.njit
def fill_normals(stream, purpose, values):
    for i in range(values.shape[0]):
        values[i, 0], values[i, 1] = normal_pair(stream, purpose, i)


@numba.njit
def split_bits(bits, units, turns):
    for i in range(bits.shape[0]):
        units[i] = high_unit(bits[i])
        turns[i] = low_turn(bits[i])


def uniforms(stream, purpose=START, count=20_000):
    values = np.empty((count, 2))
    fill_uniforms(stream, purpose, values)
    return values


def row_of_bits(stream, purpose=START, count=20_000):
    bits = np.empty(count, np.int32)
    fill_bits(stream, purpose, bits)
    return bits


def row_of_normals(stream, count):
    normal_1, normal_2 = np.empty(count, np.float32), np.empty(count, np.float32)
    bits_to_normals(row_of_bits(stream, count=count), normal_1, normal_2)
    return normal_1.astype(np.float64), normal_2.astype(np.float64)


@pytest.mark.parametrize(("rounds", "counter", "key", "answer"), KNOWN_ANSWERS)
def test_philox_gives_the_published_answers(rounds, counter, key, answer):
    drawn = philox(*words(counter), *words(key), rounds)
    assert " ".join(f"{int(word):08x}" for word in drawn) == answer


def test_row_of_bits_is_philox_of_seven_rounds_four_words_to_a_call():
    """Seven is the smallest number of rounds that passes BigCrush (Salmon et al. 2011)."""
    stream = make_stream(seed=0x0123456789ABCDEF, episode=7, step=11)
    bits = row_of_bits(stream, purpose=5, count=64)
    for i in range(16):
        call = philox(np.uint64(i), np.uint64(11), np.uint64(7), np.uint64(5), *stream[:2], 7)
        assert [int(bits[i + 16 * k]) & 0xFFFFFFFF for k in range(4)] == [int(word) for word in call]


def test_uniforms_are_uniform():
    for values in uniforms(make_stream(seed=3)).T:
        assert values.min() > 0.0
        assert values.max() < 1.0
        assert stats.kstest(values, "uniform").pvalue > 1e-4


def test_halves_of_a_word_are_every_unit_and_every_turn_of_sixteen_bits():
    """All 65536 values of each half, once: ends and the mean of the unit are exact."""
    halves = np.arange(65536, dtype=np.uint32)
    units, turns = np.empty(65536, np.float32), np.empty(65536, np.float32)
    split_bits(((halves << 16) | halves).view(np.int32), units, turns)
    assert (units.min(), units.max()) == (2.0**-17, 1.0 - 2.0**-17)
    assert units.mean(dtype=np.float64) == 0.5
    assert (turns.min(), turns.max()) == (-0.5, 0.5 - 2.0**-16)
    assert np.unique(units).size == np.unique(turns).size == 65536


def test_unit_and_turn_of_one_word_are_independent():
    """Chi-square over a 16 x 16 table: 255 degrees of freedom."""
    bits = row_of_bits(make_stream(seed=5), count=200_000)
    units, turns = np.empty(bits.size, np.float32), np.empty(bits.size, np.float32)
    split_bits(bits, units, turns)
    table = np.histogram2d(units, turns, bins=16, range=[[0, 1], [-0.5, 0.5]])[0]
    assert stats.chisquare(table.ravel()).pvalue > 1e-4


def test_normals_of_the_world_are_standard_normal():
    values = np.empty((50_000, 2))
    fill_normals(make_stream(seed=1), START, values)
    for column in values.T:
        assert stats.kstest(column, "norm").pvalue > 1e-4
    assert abs(np.corrcoef(values.T)[0, 1]) < 4 / math.sqrt(50_000)


def test_normals_of_particles_are_standard_normal():
    """Moments within four standard errors of N(0, 1): 1/sqrt(n), sqrt(2/n), sqrt(15/n) and sqrt(96/n)."""
    count = 400_000
    for values in row_of_normals(make_stream(seed=2), count):
        for power, moment, variance in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
            assert np.mean(values**power) == pytest.approx(moment, abs=4 * math.sqrt(variance / count))
        assert stats.kstest(values, "norm").pvalue > 1e-4


def test_normals_of_particles_reach_4_86_standard_deviations():
    """Sixteen bits give the smallest unit 2^-17, of which the radius is sqrt(34 ln 2)."""
    bits = np.array([0, -1 & 0xFFFF0000], np.uint32).view(np.int32)
    normal_1, normal_2 = np.empty(2, np.float32), np.empty(2, np.float32)
    bits_to_normals(bits, normal_1, normal_2)
    radius = np.hypot(normal_1, normal_2)
    assert radius[0] == pytest.approx(math.sqrt(34 * math.log(2)), rel=1e-5)  # 4.855
    assert radius[1] == pytest.approx(math.sqrt(2 * 2.0**-17), rel=1e-2)  # the nearest to zero, and not NaN


def test_pair_of_normals_is_independent():
    """Not only uncorrelated: squares and signs are, too, and the angle of the pair is uniform."""
    count = 200_000
    one, other = row_of_normals(make_stream(seed=4), count)
    bound = 4 / math.sqrt(count)
    assert abs(np.corrcoef(one, other)[0, 1]) < bound
    assert abs(np.corrcoef(one**2, other**2)[0, 1]) < bound
    assert abs(np.corrcoef(np.abs(one), other)[0, 1]) < bound
    assert stats.kstest((np.arctan2(one, other) / (2 * math.pi)) % 1.0, "uniform").pvalue > 1e-4
    table = np.histogram2d(stats.norm.cdf(one), stats.norm.cdf(other), bins=16, range=[[0, 1], [0, 1]])[0]
    assert stats.chisquare(table.ravel()).pvalue > 1e-4


def test_neighbours_in_a_row_are_independent():
    one, other = row_of_normals(make_stream(seed=6), 200_000)
    for lag in (1, 2, 4, 50_000):  # 50,000 apart stand the words of one call of Philox
        for values in (one, other):
            assert abs(np.corrcoef(values[lag:], values[:-lag])[0, 1]) < 4 / math.sqrt(values.size - lag)


# Each differs from (seed 0, episode 0, step 0, purpose START) in one word, by the smallest change, or trades two words.
NEIGHBOURS = {
    "seed": (dict(seed=1), START),
    "high word of the seed": (dict(seed=1 << 32), START),
    "episode": (dict(episode=1), START),
    "step": (dict(step=1), START),
    "purpose": (dict(), START + 1),
    "row": (dict(), START + PURPOSES),
    "seed and episode": (dict(seed=1, episode=1), START),
    "late step": (dict(step=2**31), START),
}


@pytest.mark.parametrize("name", NEIGHBOURS)
def test_streams_of_neighbours_neither_coincide_nor_correlate(name):
    keys, purpose = NEIGHBOURS[name]
    count = 40_000
    own, other = row_of_bits(make_stream(), count=count), row_of_bits(make_stream(**keys), purpose, count)
    # Equal 32-bit words in the same place happen once in 4e9; 40,000 places see none. Of all pairs 0.4 are equal.
    assert not np.any(own == other)
    assert np.intersect1d(own, other).size < 6
    assert abs(np.corrcoef(own.astype(float), other.astype(float))[0, 1]) < 4 / math.sqrt(count)
    differing = np.unpackbits((own ^ other).view(np.uint8)).mean()
    assert differing == pytest.approx(0.5, abs=4 * 0.5 / math.sqrt(32 * count))


def test_indices_of_one_stream_neither_coincide_nor_correlate():
    values = uniforms(make_stream(seed=9), count=40_000)
    assert np.unique(values).size >= values.size - 6  # birthdays among 80,000 words of 32 bits: 0.7 expected
    assert abs(np.corrcoef(values[1:, 0], values[:-1, 0])[0, 1]) < 4 / math.sqrt(40_000)
    assert abs(np.corrcoef(values.T)[0, 1]) < 4 / math.sqrt(40_000)


def test_all_coordinates_of_a_draw_matter():
    """Every combination of small coordinates gives another number: no two words share a place in the counter."""
    drawn = {
        uniform_pair(make_stream(seed, episode, step), purpose, index)
        for seed in (0, 1, 2, 1 << 32)
        for episode in (0, 1, 2)
        for step in (0, 1, 2)
        for purpose in (0, 1, 16)
        for index in (0, 1, 2)
    }
    assert len(drawn) == 4 * 3**4


SECOND = {"JITTER": "RESAMPLE", "MODEM": "HEARING", "MODEM_POSE": "READING", "OVERLAP": "WATER"}


def test_each_purpose_has_its_own_number_below_the_step_from_row_to_row():
    names = [name for name in vars(kernel_random) if name.isupper() and not name.startswith("_")]
    numbers = [getattr(kernel_random, name) for name in names if name not in ("ROUNDS", "PURPOSES", "MOST", *SECOND)]
    assert len(numbers) >= 10
    assert len(set(numbers)) == len(numbers)
    assert max(numbers) < PURPOSES
    # Others stand where the further rows of purposes would that draw under their own word alone.
    for name, first in SECOND.items():
        assert getattr(kernel_random, name) == getattr(kernel_random, first) + PURPOSES
