"""How likely what was heard is under each particle: the readings of every kind of receiver, as a belief assumes it."""

from __future__ import annotations

import enum
import math

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.resample_loops import fill_row
from tagtrack.envs.kernels.weight_loops import (
    expect_strength,
    weigh_bearing,
    weigh_bearing_range,
    weigh_by_cauchy,
    weigh_combined,
    weigh_detection,
    weigh_range,
    weigh_silence,
    weigh_strength,
)
from tagtrack.envs.sim.receivers import ReceiverKind

f32 = np.float32


class Weighting(enum.IntEnum):
    """Which reading of a stereo hydrophone weighs the particles: h_alpha (Eq. 6), h_ss (Eq. 9) or h_mod (Eq. 10)."""

    BEARING = 0
    STRENGTH = 1
    COMBINED = 2


class Measurements(enum.IntEnum):
    """Which reading of a time-of-flight receiver weighs the particles (Lin et al. 2013, Table IV)."""

    BOTH = 0
    ANGLE = 1
    DISTANCE = 2


@compiled
def is_valid(contact, rule):
    """Whether a ping is used: where ranges are, one that jumps from the range heard before is not (Lin et al. 2013, Alg. 1).

    Its bearing goes with it. The first range, with none before it, passes.
    """
    if rule.receiver.kind != ReceiverKind.TIME_OF_FLIGHT or rule.measurements == Measurements.ANGLE:
        return True
    return not abs(contact.slant_range - contact.previous_range) > rule.largest_jump


@compiled
def begin_weights(scratch):
    fill_row(scratch.weight, f32(1.0))


@compiled
def weigh(particles, vehicle, contact, rule, scratch):
    """Multiply the weights by the likelihood of what one vehicle heard, or of its silence (Clark et al. 2013, Alg. 1)."""
    if rule.receiver.kind == ReceiverKind.RANGE and contact.detected:
        weigh_range(
            scratch.weight, particles[0], particles[1], f32(vehicle.believed_x), f32(vehicle.believed_y), f32(contact.depth),
            f32(contact.slant_range), f32(rule.receiver.range_factor), f32(rule.receiver.range_sigma), f32(rule.weight_floor),
        )  # fmt: skip
    elif rule.receiver.kind == ReceiverKind.PRESENCE or rule.receiver.kind == ReceiverKind.RANGE:
        weigh_presence(particles, vehicle, contact, rule, scratch)
    elif rule.receiver.kind == ReceiverKind.TIME_OF_FLIGHT:
        weigh_time_of_flight(particles, vehicle, contact, rule, scratch)
    else:
        weigh_stereo(particles, vehicle, contact, rule, scratch)


@compiled
def weigh_presence(particles, vehicle, contact, rule, scratch):
    """Masmitja et al. 2020, Eq. 22, by its text and its sigmas: as printed its two cases are interchanged.

    A detection weighs by the survival function, a silence by the CDF, each with a sigma of its own. Where a belief assumes that
    pings within range are missed (a ``reception`` below 1), silence says less: 1 minus reception times the survival function.
    So is the silence of a tag that is asked for ranges.
    """
    receiver = rule.receiver
    own_x = f32(vehicle.believed_x)
    own_y = f32(vehicle.believed_y)
    depth = f32(contact.depth)
    floor = f32(rule.weight_floor)
    if particles.shape[0] > 4:
        reach = particles[4]
    else:
        reach = scratch.normal_1
        fill_row(reach, f32(receiver.max_range))
    if rule.heavy_tails:
        sigma = f32(receiver.detection_sigma if contact.detected else receiver.silence_sigma)
        reception = f32(1.0 if contact.detected else receiver.reception)
        heard = contact.detected
        weigh_by_cauchy(scratch.weight, particles[0], particles[1], reach, own_x, own_y, depth, sigma, reception, heard, floor)
    elif contact.detected:
        sigma = f32(receiver.detection_sigma)
        weigh_detection(scratch.weight, particles[0], particles[1], reach, own_x, own_y, depth, sigma, floor)
    else:
        sigma = f32(receiver.silence_sigma)
        reception = f32(receiver.reception)
        weigh_silence(scratch.weight, particles[0], particles[1], reach, own_x, own_y, depth, sigma, reception, floor)


@compiled
def read_bearing(vehicle, contact, rule):
    """Where the vehicle was and headed when it heard a bearing, the bearing, its sigma, and the floor of the weights."""
    return (
        f32(vehicle.believed_x), f32(vehicle.believed_y), f32(math.cos(vehicle.compass)), f32(math.sin(vehicle.compass)),
        f32(contact.units), f32(rule.receiver.bearing_sigma), f32(rule.weight_floor),
    )  # fmt: skip


@compiled
def weigh_stereo(particles, vehicle, contact, rule, scratch):
    """A bearing, a signal strength or both (Clark et al. 2013, Eqs. 6, 9 and 10)."""
    x, y = particles[0], particles[1]
    own_x, own_y, ahead_x, ahead_y, units, sigma, floor = read_bearing(vehicle, contact, rule)
    receiver = rule.receiver
    slope = f32(receiver.strength_slope)
    log_scale = f32(receiver.strength_scale * math.log(10.0))
    strength = f32(contact.strength)
    strength_sigma = f32(receiver.strength_sigma)
    if rule.weighting == Weighting.BEARING:
        weigh_bearing(scratch.weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, floor)
    elif rule.weighting == Weighting.STRENGTH:
        weigh_strength(scratch.weight, x, y, own_x, own_y, strength, slope, log_scale, strength_sigma, floor)
    else:
        expect_strength(scratch.normal_1, x, y, own_x, own_y, slope, log_scale)
        weigh_combined(
            scratch.weight, scratch.normal_1, x, y, own_x, own_y, ahead_x, ahead_y,
            units, sigma, strength, strength_sigma, floor,
        )  # fmt: skip


@compiled
def weigh_time_of_flight(particles, vehicle, contact, rule, scratch):
    """A bearing, a one-way range or both (Lin et al. 2013, Eq. 8)."""
    x, y = particles[0], particles[1]
    own_x, own_y, ahead_x, ahead_y, units, sigma, floor = read_bearing(vehicle, contact, rule)
    receiver = rule.receiver
    slant_range = f32(contact.slant_range)
    factor = f32(receiver.range_factor)
    range_sigma = f32(receiver.range_sigma)
    if rule.measurements == Measurements.ANGLE:
        weigh_bearing(scratch.weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, floor)
    elif rule.measurements == Measurements.DISTANCE:
        weigh_range(scratch.weight, x, y, own_x, own_y, f32(0.0), slant_range, factor, range_sigma, floor)
    else:
        weigh_bearing_range(
            scratch.weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, slant_range, factor, range_sigma, floor
        )
