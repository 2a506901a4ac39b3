"""Where particles come from when resampling has none to give: a first range, compound resampling; and the row of estimated reach.

Masmitja et al. 2020 spread a share of the particles around the last estimate at each resampling; the unknown range of a
presence receiver as a further row of the particles is ours.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.motion_loops import scatter_on_annulus
from tagtrack.envs.kernels.random import (
    PURPOSES,
    REACH,
    RENEWAL,
    SPREAD,
    bits_to_normals,
    fill_bits,
    high_unit,
    uniform_pair,
)
from tagtrack.envs.kernels.summary_loops import mean_of, variance_about

f32 = np.float32
RING = 4.0  # half width of the ring of a first range, in its standard deviations


@compiled
def scatter_on_ring(particles, vehicle, contact, stream, row, rule, scratch):
    """The first range heard says where the particles must be: on a ring about the vehicle, however few had started there.

    They are spread evenly across it, so that the weighing that follows gives them the range's own density.
    """
    receiver = rule.receiver
    fill_bits(stream, SPREAD + PURPOSES * row, scratch.bits)
    width = RING * receiver.range_sigma / receiver.range_factor
    middle = contact.slant_range / receiver.range_factor
    least = max(middle - width, contact.depth)
    largest = max(middle + width, contact.depth + width)
    scatter_on_annulus(
        particles[0], particles[1], scratch.bits, f32(vehicle.believed_x), f32(vehicle.believed_y),
        f32(math.sqrt(least * least - contact.depth * contact.depth)),
        f32(math.sqrt(largest * largest - contact.depth * contact.depth)),
    )  # fmt: skip


@compiled
def renew(particles, belief, stream, row, rule):
    """Compound resampling: every n-th particle moves to a random place about the last estimate, before all are weighed.

    Children of one parent lie side by side after resampling: every n-th takes from all alike.
    """
    count = int(rule.renewed_share * particles.shape[1])
    spread = rule.receiver.max_range_spread
    for k in range(count):
        i = k * particles.shape[1] // count
        area, turn = uniform_pair(stream, RENEWAL + PURPOSES * row, 2 * k)
        distance = rule.renewed_radius * math.sqrt(area)
        particles[0, i] = belief.estimate_x + distance * math.cos(2.0 * math.pi * turn)
        particles[1, i] = belief.estimate_y + distance * math.sin(2.0 * math.pi * turn)
        if particles.shape[0] > 4:
            unit, _ = uniform_pair(stream, RENEWAL + PURPOSES * row, 2 * k + 1)
            particles[4, i] = rule.receiver.max_range + spread * (2.0 * unit - 1.0)


@compiled
def spread_reach(reach, stream, row, receiver, scratch):
    """First ranges [m], uniform over the interval that the belief assumes."""
    fill_bits(stream, REACH + PURPOSES * row, scratch.bits)
    middle = f32(receiver.max_range)
    width = f32(2.0 * receiver.max_range_spread)
    for i in range(reach.shape[0]):
        reach[i] = middle + width * (high_unit(scratch.bits[i]) - f32(0.5))


@compiled
def walk_reach(reach, stream, row, receiver, scratch):
    """A small step of each range within the interval: resampling alone would leave but a few values."""
    fill_bits(stream, REACH + PURPOSES * row, scratch.bits)
    bits_to_normals(scratch.bits, scratch.normal_1, scratch.normal_2)
    step = f32(receiver.max_range_walk)
    least = f32(receiver.max_range - receiver.max_range_spread)
    largest = f32(receiver.max_range + receiver.max_range_spread)
    for i in range(reach.shape[0]):
        reach[i] = min(max(reach[i] + step * scratch.normal_1[i], least), largest)


@compiled
def summarize_reach(reach, belief):
    """Mean and standard deviation of the ranges [m]."""
    mean = mean_of(reach)
    belief.max_range = mean
    belief.max_range_spread = math.sqrt(variance_about(reach, mean))
