"""Integer systematic resampling: unbiased, as even as can be, equal to filterpy's, and harmless where weights are broken.

A particle here carries its own number as x, so that the resampled row tells each one's parent.
"""

import math
from fractions import Fraction

import numpy as np
import pytest
from filterpy.monte_carlo import systematic_resample
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tagtrack.envs.kernels.random import fill_bits
from tagtrack.envs.kernels.resample_loops import (
    accumulate,
    find_first_pointers,
    heaviest,
    quantize,
    resample,
    total_weight,
)

f32 = np.float32
LARGEST_OFFSET = 1.0 - 2.0**-33  # offsets are uniforms of 32 bits in (0, 1)
SMALLEST_OFFSET = 2.0**-33


class Row:
    """A row of particles with the scratch that resampling needs."""

    def __init__(self, weights, rows=4):
        self.weight = np.array(weights, f32)
        count = self.weight.size
        self.particles = np.stack([k * count + np.arange(count, dtype=f32) for k in range(rows)])
        self.fixed = np.zeros(count, np.int32)
        self.parent = np.zeros(count + 1, np.int32)
        self.whole = np.zeros(4 * count, f32)

    def resample(self, offset):
        return resample(self.particles, self.weight, self.fixed, self.parent, self.whole, offset)


def parents(weights, offset):
    row = Row(weights)
    assert row.resample(offset)
    return row.particles[0].astype(np.int64)


def offspring(weights, offset):
    return np.bincount(parents(weights, offset), minlength=len(weights))


def shares(weights):
    """N w_i with the weights that the kernel sees, normalized in float64."""
    weights = np.array(weights, f32).astype(np.float64)
    return weights.size * weights / weights.sum()


def uneven_weights(count, seed):
    """Weights as after a reading: most near the floor, some a thousand times as heavy."""
    return 0.001 + np.random.default_rng(seed).random(count) ** 8


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 250, 1000])
def test_expected_number_of_offspring_is_n_times_the_weight(count):
    """Averaged over the M offsets (m + 1/2)/M the count of offspring misses its mean by 1/M at most: an exact check of bias."""
    weights = uneven_weights(count, seed=count)
    offsets = (np.arange(400) + 0.5) / 400
    mean = np.mean([offspring(weights, offset) for offset in offsets], axis=0)
    # 1/M for the offsets' grid, N / 2^30 (twice) for the fixed-point weights, 1e-6 of the share for the float32 total.
    assert np.all(np.abs(mean - shares(weights)) < 1 / 400 + 2 * count / 2**30 + 1e-6 * shares(weights))


def test_random_offsets_leave_no_bias():
    """Systematic offspring vary by the fraction f of N w_i with variance f (1 - f): four standard errors of 4,000 draws."""
    weights = uneven_weights(50, seed=1)
    offsets = np.random.default_rng(2).random(4000)
    mean = np.mean([offspring(weights, offset) for offset in offsets], axis=0)
    fraction = shares(weights) % 1.0
    assert np.all(np.abs(mean - shares(weights)) < 4 * np.sqrt(fraction * (1 - fraction) / 4000) + 1e-4)


def assert_offspring_are_floor_or_ceiling(weights, offset):
    born = offspring(weights, offset)
    share = shares(weights)
    slack = 1e-4 + 1e-5 * share  # where N w_i is a whole number but for rounding, its neighbour is right, too
    assert born.sum() == born.size
    assert np.all(born >= np.floor(share - slack))
    assert np.all(born <= np.ceil(share + slack))


@pytest.mark.parametrize("count", [1, 2, 5, 33, 999, 1000, 4096])
@pytest.mark.parametrize("offset", [SMALLEST_OFFSET, 0.25, 0.5, 0.9, LARGEST_OFFSET])
def test_each_particle_has_floor_or_ceiling_of_its_share_of_offspring(count, offset):
    assert_offspring_are_floor_or_ceiling(uneven_weights(count, seed=count), offset)


def test_offspring_stand_in_the_order_of_their_parents():
    assert np.all(np.diff(parents(uneven_weights(1000, seed=0), 0.3)) >= 0)


def plain_parents(first_pointer):
    """Pointer j falls into the share of the last particle whose first pointer is not past it."""
    return np.searchsorted(first_pointer, np.arange(first_pointer.size), side="right") - 1


@pytest.mark.parametrize("rows", [4, 5])
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6, 7, 8, 37, 1000, 1001, 1002, 4003, 20_000])
def test_all_components_of_a_particle_move_together(count, rows):
    """Particles are copied four at a time: the rest of a row, one to three, and a fifth component go by loops of their own."""
    row = Row(uneven_weights(count, seed=3), rows)
    row.particles[...] = np.random.default_rng(count).normal(size=(rows, count))  # no two alike
    before = row.particles.copy()
    assert row.resample(0.6)
    np.testing.assert_array_equal(row.particles, before[:, plain_parents(row.fixed)])
    chosen = parents(row.weight, 0.6)
    np.testing.assert_array_equal(chosen, plain_parents(row.fixed))


@pytest.mark.parametrize("place", [0, 1, 998, 1000])
def test_one_particle_may_fill_the_whole_row(place):
    row = Row(np.arange(1001) == place, rows=5)
    before = row.particles.copy()
    assert row.resample(0.1)
    np.testing.assert_array_equal(row.particles, np.repeat(before[:, [place]], 1001, axis=1))


def test_a_particle_keeps_its_bits():
    """NaN with its payload, infinity, the smallest subnormal and minus zero are copied, not computed with."""
    odd = np.array([0x7FC12345, 0xFF800000, 0x00000001, 0x80000000, 0x3F800000], np.uint32).view(f32)
    row = Row(np.ones(odd.size), rows=5)
    row.particles[...] = odd
    assert row.resample(0.5)
    np.testing.assert_array_equal(row.particles.view(np.uint32), np.tile(odd.view(np.uint32), (5, 1)))


def test_first_pointers_are_those_of_plain_integers():
    """ceil(sum before * N / total - offset) with Python's exact integers; where that is whole but for rounding, a neighbour."""
    for count in (1, 3, 64, 1001):
        row = Row(uneven_weights(count, seed=count))
        scaled = row.weight * (f32(2.0**30) / total_weight(row.weight))
        before = np.concatenate([[0], np.cumsum(scaled.astype(np.int64))])
        assert row.resample(0.25)
        exact = [Fraction(int(b) * count, int(before[-1])) - Fraction(1, 4) for b in before[:-1]]
        for found, wanted in zip(row.fixed.tolist(), exact, strict=True):
            assert found == math.ceil(wanted) or abs(found - wanted) < 1e-9


def filterpys_choice(weights, offset, monkeypatch):
    """filterpy draws its offset from numpy's global generator: give it ours."""
    monkeypatch.setattr("filterpy.monte_carlo.resampling.random", lambda: offset)
    return systematic_resample(weights)


@pytest.mark.parametrize("count", [3, 10, 255, 1000, 1001])
def test_parents_are_those_of_filterpy_for_the_same_offset(count, monkeypatch):
    """The same particle for every pointer, but where a pointer stands within the rounding of a boundary between two."""
    for trial in range(20):
        weights = uneven_weights(count, seed=100 * count + trial).astype(f32).astype(np.float64)
        weights /= weights.sum()
        offset = float(np.random.default_rng(trial).random())
        ours, theirs = parents(weights, offset), filterpys_choice(weights, offset, monkeypatch)
        boundaries = np.cumsum(weights)
        pointers = (np.arange(count) + offset) / count
        for pointer in pointers[ours != theirs]:
            # Fixed point rounds each of N weights down by 2^-30 at most, and all of them are scaled by one rounded total.
            assert np.abs(boundaries - pointer).min() < count * 2.0**-30 + 1e-6
        assert np.mean(ours != theirs) < 0.01


def test_equal_weights_keep_every_particle():
    for count in (1, 4, 10, 1000):
        np.testing.assert_array_equal(parents(np.ones(count), 0.5), np.arange(count))


@pytest.mark.parametrize("place", [0, 6, 12])
def test_the_only_particle_with_weight_begets_all(place):
    weights = np.zeros(13)
    weights[place] = 0.02
    for offset in (SMALLEST_OFFSET, 0.5, LARGEST_OFFSET):
        np.testing.assert_array_equal(parents(weights, offset), np.full(13, place))


@pytest.mark.parametrize("weight", [1e-20, 0.001, 1.0, 1e20])
def test_a_single_particle_begets_itself(weight):
    np.testing.assert_array_equal(parents([weight], 0.7), [0])


@pytest.mark.parametrize(
    "weights",
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, np.nan, 1.0, 1.0, 1.0],
        [np.nan] * 5,
        [1.0, np.inf, 1.0, 1.0, 1.0],
        [np.inf, -np.inf, 1.0, 1.0, 1.0],
        [3e38, 3e38, 1.0, 1.0, 1.0],  # each is finite, the sum is not
        [-1.0, -1.0, -1.0, -1.0, -1.0],
    ],
)
def test_weights_without_a_finite_positive_sum_change_nothing(weights):
    row = Row(weights)
    before = row.particles.copy()
    assert not row.resample(0.5)
    np.testing.assert_array_equal(row.particles, before)


@pytest.mark.parametrize("scale", [1e-25, 1e-12, 1.0, 1e12, 1e25])
def test_only_ratios_of_weights_matter(scale):
    """The readings of several vehicles multiply: eight times the floor of 0.001 is 1e-24."""
    weights = uneven_weights(100, seed=4)
    assert_offspring_are_floor_or_ceiling(weights * scale, 0.3)
    assert np.sum(parents(weights * scale, 0.3) != parents(weights, 0.3)) <= 1  # a boundary may round another way


# In an interpreter of its own, because an index out of range does not raise: it ends the process.
EXTREME = """
import numpy as np
from tagtrack.envs.kernels.resample_loops import resample
f32 = np.float32
for exponent in (*range(-45, -24), *range(25, 38)):
    for count in (1, 2, 5, 64, 1000):
        weight = ((1 + np.arange(count)[::-1]) * 10.0**exponent / count).astype(f32)
        row = np.tile(np.arange(count, dtype=f32), (4, 1))
        resample(row, weight, np.zeros(count, np.int32), np.zeros(count + 1, np.int32), np.zeros(4 * count, f32), 0.5)
        assert np.isin(row, np.arange(count)).all(), (exponent, count)
        assert np.all(np.diff(row[0]) >= 0), (exponent, count)
"""


def test_weights_at_the_ends_of_float32_never_lead_out_of_the_row(run_python):
    """Where 2^30 over the sum, or 2^30 times a weight, is more than float32 holds: no change, or a valid row."""
    run_python(EXTREME)


def test_no_pointer_lies_beyond_the_row_even_for_offset_zero():
    """A last particle without weight has its first pointer at N, the dump; the rounded ratio N / total must not make it N + 1."""
    generator = np.random.default_rng(0)
    for _ in range(2000):
        weight = generator.random(int(generator.integers(2, 1500))).astype(f32)
        weight[-1] = 0.0
        fixed = np.zeros(weight.size, np.int32)
        quantize(weight, fixed, total_weight(weight))
        find_first_pointers(fixed, accumulate(fixed), 0.0)
        assert fixed.max() <= weight.size


def test_prefix_sums_are_exact():
    fixed = np.random.default_rng(1).integers(0, 2**20, 1000).astype(np.int32)
    expected = np.concatenate([[0], np.cumsum(fixed)])
    assert accumulate(fixed) == expected[-1]
    np.testing.assert_array_equal(fixed, expected[:-1])


def test_first_child_of_each_parent_is_left_in_the_scratch():
    """What the filter follows its best particle by."""
    row = Row(uneven_weights(200, seed=8))
    assert row.resample(0.4)
    children = row.particles[0].astype(int)
    for parent in np.unique(children):
        assert row.fixed[parent] == np.flatnonzero(children == parent)[0]


def test_heaviest_is_the_first_of_the_largest():
    assert heaviest(np.array([0.1, 0.7, 0.3, 0.7], f32)) == 1


def test_the_largest_row_is_resampled_as_evenly_as_a_small_one():
    """A million particles: 2^30 units leave a thousand to each, so a share is rounded by one part in a thousand at most."""
    count = 2**20
    bits = np.empty(count, np.int32)
    fill_bits((np.uint64(0),) * 4, 0, bits)
    weights = 0.001 + (bits.astype(np.float64) / 2**31) ** 8
    born = offspring(weights, 0.37)
    assert born.sum() == count
    assert np.all(np.abs(born - shares(weights)) < 1.0 + 0.01 * shares(weights))


finite_weights = st.floats(0.0, 1e6, width=32)


@settings(max_examples=300, deadline=None)
@given(
    weights=st.lists(finite_weights, min_size=1, max_size=70).filter(lambda weights: math.fsum(weights) > 1e-25),
    offset=st.floats(SMALLEST_OFFSET, LARGEST_OFFSET),
)
@example(weights=[1.0, 0.0], offset=SMALLEST_OFFSET)
@example(weights=[0.0, 1.0, 0.0, 0.0], offset=LARGEST_OFFSET)
@example(weights=[1e-10, 1e6, 1e-10], offset=0.5)
def test_any_weights_give_parents_with_weight_and_even_offspring(weights, offset):
    chosen = parents(weights, offset)
    assert np.all(np.array(weights, f32)[chosen] > 0.0)
    assert_offspring_are_floor_or_ceiling(weights, offset)


# Nothing nearer to the ends of float32: such weights are tested above, in an interpreter of their own.
any_weights = st.one_of(st.floats(2.0**-80, 2.0**80, width=32), st.sampled_from([0.0, math.nan, math.inf]))


@settings(max_examples=300, deadline=None)
@given(weights=st.lists(any_weights, min_size=1, max_size=40), offset=st.floats(SMALLEST_OFFSET, LARGEST_OFFSET))
def test_whatever_the_weights_no_particle_is_invented(weights, offset):
    """NaN and infinity among them: either nothing changes, or a valid row comes out."""
    row = Row(weights)
    assert row.resample(offset) == (0.0 < sum(weights) < math.inf)
    assert np.all(np.isin(row.particles[0], np.arange(len(weights), dtype=f32)))
