"""Where particles come from when resampling has none to give: a first range, compound resampling, jitter; and their fifth row.

Masmitja et al. 2020 spread a share of the particles around the last estimate at each resampling, Musso, Oudjane & Le Gland 2001
draw all of them from a density about the old ones; a number that a belief estimates
together with the position, as the unknown range of a presence receiver, is ours.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.belief.recovery import first_moved
from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.maths import sin_of_turns
from tagtrack.envs.kernels.motion_loops import displace, scatter_on_annulus
from tagtrack.envs.kernels.random import (
    JITTER,
    PURPOSES,
    REACH,
    RENEWAL,
    SPREAD,
    bits_to_normals,
    fill_bits,
    high_unit,
    uniform_pair,
)
from tagtrack.envs.kernels.resample_loops import fill_row, restore_mean, total_weight
from tagtrack.envs.kernels.summary_loops import mean_about, mean_of, spread_about, squares_about
from tagtrack.envs.kernels.weighted_loops import weighted_mean_of, weighted_squares_about

f32 = np.float32
RING = 4.0  # half width of the ring of a range, in its standard deviations
LEAST_FIT = 1.0 / 200.0


@compiled
def is_refuted(weight, readings, rule):
    """Whether ranges fit hardly any particle: of the largest likelihood less than 1/200 is left on average.

    A cloud that covers the fish stays above this until it is some hundred times as wide as a range is sure: a belief so
    refuted sits in the wrong place, as in the mirror image of the right one.
    """
    peak = 1.0 / (math.sqrt(2.0 * math.pi) * rule.ring_sigma)
    return total_weight(weight) / weight.shape[0] < (rule.weight_floor + LEAST_FIT * peak) ** readings


@compiled
def scatter_on_ring(particles, carried, measurement, stream, row, rule, scratch):
    """A first range, or one that refutes the belief, says where particles must be: on a ring about the vehicle.

    They are spread evenly across it, so that the weighing that follows gives them the range's own density. What weights they
    carried is forgotten.
    """
    fill_row(carried, f32(1.0))
    fill_bits(stream, SPREAD + PURPOSES * row, scratch.bits)
    width = RING * rule.ring_sigma / rule.ring_factor
    middle = measurement.readings[rule.ring_reading] / rule.ring_factor
    least = max(middle - width, measurement.depth)
    largest = max(middle + width, measurement.depth + width)
    scatter_on_annulus(
        particles[0], particles[1], scratch.bits, f32(measurement.x), f32(measurement.y),
        f32(math.sqrt(max((least - measurement.depth) * (least + measurement.depth), 0.0))),
        f32(math.sqrt(max((largest - measurement.depth) * (largest + measurement.depth), 0.0))),
    )  # fmt: skip


@compiled
def renew(particles, carried, belief, stream, row, rule):
    """Compound resampling: every n-th particle moves to a random place about the last estimate, before all are weighed.

    Children of one parent lie side by side after resampling: every n-th takes from all alike. Among particles that carry weights
    the moved ones take the mean one.
    """
    count = int(rule.renewed_share * particles.shape[1])
    first = first_moved(carried, count, stream, RENEWAL + PURPOSES * row)
    for k in range(count):
        i = (first + k * particles.shape[1] // count) % particles.shape[1]
        area, direction = uniform_pair(stream, RENEWAL + PURPOSES * row, 2 * k)
        distance = f32(rule.renewed_radius) * np.sqrt(f32(area))
        turn = f32(direction) - f32(0.5)
        particles[0, i] = f32(belief.estimate_x) + distance * sin_of_turns(f32(0.25) - abs(turn))
        particles[1, i] = f32(belief.estimate_y) + distance * sin_of_turns(turn)
        if particles.shape[0] > 4:
            unit, _ = uniform_pair(stream, RENEWAL + PURPOSES * row, 2 * k + 1)
            particles[4, i] = rule.middle + rule.reach * (2.0 * unit - 1.0)
        if carried.shape[0] > 0:
            carried[i] = f32(1.0)
    if count > 0:
        restore_mean(carried)


@inner
def part_siblings(particles, belief, stream, row, rule, scratch):
    """Regularized resampling: normals with the covariance of the resampled particles, as narrow as so many particles allow.

    The bandwidth is that of two dimensions, N^(-1/6). Musso et al. take the covariance of the weighted particles before they are
    resampled; systematic resampling keeps it, and here it needs no loop of its own. Their kernel is for one peak: on the ring of
    a first range or between two mirror images it would blur what ranges have told, so it is never wider than a range is sure.
    """
    x, y = particles[0], particles[1]
    origin_x, origin_y = f32(belief.mean_x), f32(belief.mean_y)
    offset_x, offset_y, _ = mean_about(x, y, origin_x, origin_y, f32(1.0), f32(0.0))
    xx, yy, xy = spread_about(x, y, origin_x + offset_x, origin_y + offset_y)
    width = rule.jitter * x.shape[0] ** (-1.0 / 6.0)
    spread = math.sqrt(xx + yy)
    if rule.ring_reading >= 0 and width * spread > rule.ring_sigma:
        width = rule.ring_sigma / spread
    along = f32(math.sqrt(xx))  # Cholesky: x = along n1, y = shared n1 + own n2
    shared = xy / along if along > f32(0.0) else f32(0.0)
    own = f32(math.sqrt(max(yy - shared * shared, f32(0.0))))
    fill_bits(stream, JITTER + PURPOSES * row, scratch.bits)
    bits_to_normals(scratch.bits, scratch.normal_1, scratch.normal_2)
    displace(x, y, scratch.normal_1, scratch.normal_2, f32(width) * along, f32(width) * shared, f32(width) * own)


@inner
def spread_estimated(values, stream, row, rule, scratch):
    """First values of the number that is estimated with the position, uniform over the interval that the belief assumes."""
    fill_bits(stream, REACH + PURPOSES * row, scratch.bits)
    middle = f32(rule.middle)
    width = f32(2.0 * rule.reach)
    for i in range(values.shape[0]):
        values[i] = middle + width * (high_unit(scratch.bits[i]) - f32(0.5))


@inner
def walk_estimated(values, stream, row, rule, scratch):
    """A small step of each value within the interval: resampling alone would leave but a few of them."""
    fill_bits(stream, REACH + PURPOSES * row, scratch.bits)
    bits_to_normals(scratch.bits, scratch.normal_1, scratch.normal_2)
    step = f32(rule.walk)
    least = f32(rule.middle - rule.reach)
    largest = f32(rule.middle + rule.reach)
    for i in range(values.shape[0]):
        values[i] = min(max(values[i] + step * scratch.normal_1[i], least), largest)


@inner
def summarize_estimated(values, carried, belief):
    """Mean and standard deviation of the values, by their weights where they carry any."""
    if carried.shape[0] > 0:
        mean, total = weighted_mean_of(values, carried)
        squares = weighted_squares_about(values, carried, mean)
    else:
        mean, total = mean_of(values), f32(values.shape[0])
        squares = squares_about(values, mean)
    belief.estimated = mean
    belief.estimated_spread = math.sqrt(squares / total)
