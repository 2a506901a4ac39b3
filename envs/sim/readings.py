"""Readings of heard pings as the truth draws them: bearing, signal strength, time of arrival, range, and chance of presence."""

from __future__ import annotations

import math

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import READING, normal_pair, uniform_pair
from tagtrack.envs.sim.geometry import relative_bearing
from tagtrack.envs.sim.receivers import LARGEST_UNIT, RATIO_STEP, RATIOS


@compiled
def bearing_in_units(bearing):
    """Lotek units, real-valued, of a relative bearing [rad] (Eq. 5): the same to port and to starboard."""
    degrees = 90.0 - abs(bearing) * 180.0 / math.pi
    return ((-1e-6 * degrees + 2e-5) * degrees + 0.0947) * degrees - 0.2757


@compiled
def expected_strength(distance, receiver):
    """Signal strength at a distance [m] (Eq. 8)."""
    return 10.0**receiver.strength_scale * max(distance, 1e-3) ** receiver.strength_slope


@compiled
def presence_chance(distance, max_range, reception, receiver):
    """Chance that a presence receiver logs a ping from a distance [m]: Eq. 22's survival function, or the measured ratio."""
    if receiver.measured:
        row = int(distance / RATIO_STEP)
        return receiver.ratios[row] if row < RATIOS else 0.0
    return reception * 0.5 * math.erfc((distance - max_range) / (math.sqrt(2.0) * receiver.detection_sigma))


@compiled
def round_units(units):
    """Whole units within the receiver's scale."""
    return min(max(math.floor(units + 0.5), -LARGEST_UNIT), LARGEST_UNIT)


@compiled
def read_stereo(contact, vehicle, fish_x, fish_y, stream, index, receiver):
    """Bearing, rounded to whole units, and strength."""
    bearing = relative_bearing(vehicle.x, vehicle.y, vehicle.heading, fish_x, fish_y)
    unit_noise, strength_noise = normal_pair(stream, READING, index)
    contact.units = round_units(bearing_in_units(bearing) + receiver.bearing_sigma * unit_noise)
    contact.strength = expected_strength(contact.range, receiver) + receiver.strength_sigma * strength_noise


@compiled
def read_range(contact, distance, stream, index, receiver):
    """Slant range from a true one [m]: scaled, with Gaussian and uniform noise, never negative."""
    noise, _ = normal_pair(stream, READING, 2 * index)
    unit, _ = uniform_pair(stream, READING, 2 * index + 1)
    reading = receiver.range_factor * distance + receiver.range_sigma * noise + receiver.range_tolerance * (2.0 * unit - 1.0)
    contact.slant_range = max(reading, 0.0)


@compiled
def read_time_of_flight(contact, vehicle, fish_x, fish_y, distance, target, stream, index, tag, receiver):
    """Bearing and, by the time of arrival, slant range within +-v*T_c/2 (Lin et al. 2013, Eqs. 5-7). Keeps the range before."""
    bearing = relative_bearing(vehicle.x, vehicle.y, vehicle.heading, fish_x, fish_y)
    unit_noise, arrival_noise = normal_pair(stream, READING, 2 * index)
    misread, _ = uniform_pair(stream, READING, 2 * index + 1)
    contact.units = round_units(bearing_in_units(bearing) + receiver.bearing_sigma * unit_noise)
    flight = (receiver.range_factor * distance + receiver.range_sigma * arrival_noise) / receiver.sound_speed
    arrival = target.last_ping + flight + contact.clock_error
    if misread < receiver.misread:
        arrival += receiver.code_spacing
    late = receiver.tick * math.floor(arrival / receiver.tick + 0.5) - target.first_ping
    contact.previous_range = contact.slant_range
    contact.slant_range = receiver.sound_speed * (late - tag.period * math.floor(late / tag.period + 0.5))
