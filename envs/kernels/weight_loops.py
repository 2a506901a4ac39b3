"""Loops that score a row of particles against what a receiver tells: one loop for each kind of reading.

Of a stereo hydrophone (Clark et al. 2013, Eqs. 5-10) the angle from the perpendicular to the hydrophones' baseline is
asin(cos(relative bearing)): it is the same to port and to starboard, which is the sign that the receiver cannot tell. Each loop
multiplies into ``weight``, so that the readings of several vehicles combine.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.maths import fast_asin, fast_exp, fast_log, normal_survival

f32 = np.float32
DEGREES = f32(180.0 / math.pi)
CUBIC = (f32(-1e-6), f32(2e-5), f32(0.0947), f32(-0.2757))  # Eq. 5: degrees from the perpendicular to Lotek units
NEAREST = f32(1e-6)  # m^2: keeps a particle on the vehicle itself finite


@compiled
def bearing_units(sine):
    """Expected Lotek units (real-valued) where ``sine`` is the sine of the angle from the perpendicular (Eq. 5)."""
    degrees = fast_asin(sine) * DEGREES
    return ((CUBIC[0] * degrees + CUBIC[1]) * degrees + CUBIC[2]) * degrees + CUBIC[3]


@compiled
def weigh_bearing(weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, floor):
    """Multiply by h_alpha (Eq. 6). ``ahead`` is the unit vector of the vehicle's heading."""
    precision = f32(-0.5) / (sigma * sigma)
    peak = f32(1.0 / math.sqrt(2.0 * math.pi)) / sigma
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        sine = (dx * ahead_x + dy * ahead_y) / np.sqrt(dx * dx + dy * dy + NEAREST)
        miss = bearing_units(sine) - units
        weight[i] *= floor + peak * fast_exp(precision * miss * miss)


@compiled
def weigh_strength(weight, x, y, own_x, own_y, strength, slope, log_scale, sigma, floor):
    """Multiply by h_ss (Eqs. 8, 9); the expected strength is exp(log_scale + slope * ln(distance))."""
    precision = f32(-0.5) / (sigma * sigma)
    peak = f32(1.0 / math.sqrt(2.0 * math.pi)) / sigma
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        expected = fast_exp(log_scale + f32(0.5) * slope * fast_log(dx * dx + dy * dy + NEAREST))
        miss = expected - strength
        weight[i] *= floor + peak * fast_exp(precision * miss * miss)


@compiled
def expect_strength(expected, x, y, own_x, own_y, slope, log_scale):
    """Expected signal strength of each particle (Eq. 8)."""
    for i in range(expected.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        expected[i] = fast_exp(log_scale + f32(0.5) * slope * fast_log(dx * dx + dy * dy + NEAREST))


@compiled
def weigh_combined(weight, misfit, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, strength, strength_sigma, floor):
    """Multiply by h_mod (Eq. 10, with a sigma where the paper prints an expected value: a density needs its width).

    ``misfit`` holds the expected strengths on entry.
    """
    precision = f32(-0.5) / (sigma * sigma)
    strength_precision = f32(-0.5) / (strength_sigma * strength_sigma)
    peak = f32(0.5 / math.pi) / (sigma * strength_sigma)
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        sine = (dx * ahead_x + dy * ahead_y) / np.sqrt(dx * dx + dy * dy + NEAREST)
        miss = bearing_units(sine) - units
        strength_miss = misfit[i] - strength
        weight[i] *= floor + peak * fast_exp(
            precision * miss * miss + strength_precision * strength_miss * strength_miss
        )


@compiled
def weigh_range(weight, x, y, own_x, own_y, depth, slant_range, factor, sigma, floor):
    """Multiply by the likelihood of a slant range to a fish at a known ``depth`` [m] (Masmitja et al. 2020, Eq. 21)."""
    precision = f32(-0.5) / (sigma * sigma)
    peak = f32(1.0 / math.sqrt(2.0 * math.pi)) / sigma
    below = depth * depth
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        miss = factor * np.sqrt(dx * dx + dy * dy + below) - slant_range
        weight[i] *= floor + peak * fast_exp(precision * miss * miss)


@compiled
def weigh_bearing_range(
    weight, x, y, own_x, own_y, ahead_x, ahead_y, units, sigma, slant_range, factor, range_sigma, floor
):
    """Multiply by the likelihood of a bearing and a range together (Lin et al. 2013, Eq. 8)."""
    precision = f32(-0.5) / (sigma * sigma)
    range_precision = f32(-0.5) / (range_sigma * range_sigma)
    peak = f32(0.5 / math.pi) / (sigma * range_sigma)
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        distance = np.sqrt(dx * dx + dy * dy + NEAREST)
        miss = bearing_units((dx * ahead_x + dy * ahead_y) / distance) - units
        range_miss = factor * distance - slant_range
        weight[i] *= floor + peak * fast_exp(precision * miss * miss + range_precision * range_miss * range_miss)


@compiled
def weigh_detection(weight, x, y, reach, own_x, own_y, depth, sigma, floor):
    """Multiply by the survival function of the distance about each particle's ``reach`` [m] (Eq. 22, a ping was heard)."""
    per_sigma = f32(1.0) / sigma
    below = depth * depth
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        z = (np.sqrt(dx * dx + dy * dy + below) - reach[i]) * per_sigma
        weight[i] *= floor + normal_survival(z)


@compiled
def weigh_silence(weight, x, y, reach, own_x, own_y, depth, sigma, reception, floor):
    """Multiply by 1 minus ``reception`` times that function; with a reception of 1 by the CDF (Eq. 22, none was heard)."""
    per_sigma = f32(1.0) / sigma
    below = depth * depth
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        z = (np.sqrt(dx * dx + dy * dy + below) - reach[i]) * per_sigma
        weight[i] *= floor + f32(1.0) - reception * normal_survival(z)


@compiled
def weigh_by_cauchy(weight, x, y, reach, own_x, own_y, depth, sigma, reception, heard, floor):
    """As ``weigh_detection`` where ``heard``, else as ``weigh_silence``, by the Cauchy distribution's survival function."""
    per_sigma = f32(1.0) / sigma
    below = depth * depth
    least = f32(0.0) if heard else f32(1.0)
    gain = reception if heard else -reception
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        z = (np.sqrt(dx * dx + dy * dy + below) - reach[i]) * per_sigma
        survival = f32(0.5) - f32(math.atan(z) / math.pi)
        weight[i] *= floor + least + gain * survival
