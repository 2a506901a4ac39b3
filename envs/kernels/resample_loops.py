"""Systematic resampling of a row, in integers: every step is exact or rounded the same way everywhere.

Weights become 30-bit fixed point, their prefix sum is exact, each particle's first pointer is a rounded-up product, and the
ancestors are a scatter followed by a running maximum, with whole particles copied as it runs: no branches, no search.
"""

from __future__ import annotations

import numpy as np

from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.whole_particles import interleave, take_descendants

f32 = np.float32
i32 = np.int32
FIXED_POINT = f32(2.0**30)
LEAST_TOTAL, LARGEST_TOTAL = f32(1e-28), f32(1e28)  # beyond them, products with 2^30 are more than float32 holds


@compiled
def total_weight(weight):
    """Sum of a float32 row."""
    total = f32(0.0)
    for i in range(weight.shape[0]):
        total += weight[i]
    return total


@compiled
def quantize(weight, fixed, total):
    """Weights as integers that sum to at most about 2^30."""
    scale = FIXED_POINT / total
    for i in range(weight.shape[0]):
        fixed[i] = i32(weight[i] * scale)


@compiled
def accumulate(fixed):
    """Replace each integer weight by the sum of those before it. Returns the sum of all."""
    running = i32(0)
    for i in range(fixed.shape[0]):
        own = fixed[i]
        fixed[i] = running
        running = i32(running + own)
    return running


@compiled
def find_first_pointers(fixed, total, offset):
    """Replace each sum by the number of the first pointer at or past it; pointer j stands at (j + offset) * total / N."""
    last = i32(fixed.shape[0])  # particles without weight at the row's end: the dump
    pointers_per_unit = np.float64(fixed.shape[0]) / np.float64(total)
    for i in range(fixed.shape[0]):
        fixed[i] = min(i32(np.ceil(np.float64(fixed[i]) * pointers_per_unit - offset)), last)


@inner
def mark_first_children(first_pointer, parent):
    """Write each particle's number at its first pointer, 0 elsewhere: the running maximum of ``parent`` are the parents.

    ``parent`` has N + 1 places; the last is a dump.
    """
    for j in range(parent.shape[0]):
        parent[j] = i32(0)
    for i in range(first_pointer.shape[0]):
        parent[np.uintp(first_pointer[i])] = i32(i)  # of several with one first pointer only the last has a share


@inner
def gather_descendants(source, target, parent):
    """target[j] = source[largest of parent[0..j]] (unsigned: no test for an index from the end)."""
    highest = i32(0)
    for j in range(target.shape[0]):
        highest = max(highest, parent[j])
        target[j] = source[np.uint32(highest)]


@inner
def copy_row(source, target):
    """target[:] = source: numba's own slice assignment first tests for overlap and then copies one by one."""
    for j in range(target.shape[0]):
        target[j] = source[j]


@compiled
def fill_row(target, value):
    """target[:] = value."""
    for j in range(target.shape[0]):
        target[j] = value


@inner
def normalize(weight, target):
    """Weights in ``target``, another row, with a mean of 1. Returns the sum of their squares, N / share of effective particles.

    Where the sum of the weights is not within 1e-28 to 1e28, or NaN, nothing is written, and the return is NaN.
    """
    total = total_weight(weight)
    if not (total > LEAST_TOTAL and total < LARGEST_TOTAL):
        return f32(np.nan)
    scale = f32(weight.shape[0]) / total
    squares = f32(0.0)
    for i in range(weight.shape[0]):
        own = weight[i] * scale
        target[i] = own
        squares += own * own
    return squares


@inner
def restore_mean(weight):
    """Give a row of weights, not all of them zero, a mean of 1 again."""
    scale = f32(weight.shape[0]) / total_weight(weight)
    for i in range(weight.shape[0]):
        weight[i] *= scale


@compiled
def heaviest(weight):
    """Index of the largest weight (the first of equals)."""
    best = 0
    for i in range(weight.shape[0]):
        if weight[i] > weight[best]:
            best = i
    return best


@compiled
def resample(particles, weight, fixed, parent, whole, offset):
    """Systematic resampling of one row with one uniform ``offset`` in [0, 1).

    Args:
        particles: (4 or more, N) float32, replaced. weight: (N,) float32, not normalized. fixed: (N,) and parent: (N + 1,) int32,
            whole: (4 N,) float32: scratch; afterwards ``fixed`` holds each particle's first child.
    Returns:
        False, with nothing changed, where the sum of the weights is not within 1e-28 to 1e28, or NaN.
    """
    total = total_weight(weight)
    if not (total > LEAST_TOTAL and total < LARGEST_TOTAL):
        return False
    quantize(weight, fixed, total)
    find_first_pointers(fixed, accumulate(fixed), offset)
    mark_first_children(fixed, parent)
    interleave(particles[0], particles[1], particles[2], particles[3], whole)
    take_descendants(whole, parent, particles[0], particles[1], particles[2], particles[3])
    for component in range(4, particles.shape[0]):
        gather_descendants(particles[component], whole[: particles.shape[1]], parent)
        copy_row(whole, particles[component])
    return True
