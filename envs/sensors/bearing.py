"""A bearing without sign, in the whole units of Lotek's receiver: what two hydrophones on one line tell (Clark et al. 2013).

Of a stereo hydrophone the angle from the perpendicular to the baseline is asin(cos(relative bearing)): it is the same to port and
to starboard, which is the sign that the receiver cannot tell.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.feature import Feature
from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.geometry import relative_bearing
from tagtrack.envs.kernels.maths import fast_asin
from tagtrack.envs.sensors.sensor import middle_cosines

f32 = np.float32
LARGEST_UNIT = 9.0  # Lotek bearing units run from -9 to 9
DEGREES = f32(180.0 / math.pi)
CUBIC = (f32(-1e-6), f32(2e-5), f32(0.0947), f32(-0.2757))  # Eq. 5: degrees from the perpendicular to Lotek units
NEAREST = f32(1e-6)  # m^2: keeps a particle on the vehicle itself finite
LAST_UNITS = Feature("last_units", "last bearing reading / 9 Lotek units; 0 before the first", -1.0, 1.0)


@compiled
def bearing_units(sine):
    """Expected Lotek units (real-valued) where ``sine`` is the sine of the angle from the perpendicular (Eq. 5)."""
    degrees = fast_asin(sine) * DEGREES
    return ((CUBIC[0] * degrees + CUBIC[1]) * degrees + CUBIC[2]) * degrees + CUBIC[3]


@compiled
def bearing_in_units(bearing):
    """Lotek units, real-valued, of a relative bearing [rad] (Eq. 5): the same to port and to starboard."""
    degrees = 90.0 - abs(bearing) * 180.0 / math.pi
    return ((-1e-6 * degrees + 2e-5) * degrees + 0.0947) * degrees - 0.2757


@inner
def round_units(units):
    """Whole units within the receiver's scale."""
    return min(max(math.floor(units + 0.5), -LARGEST_UNIT), LARGEST_UNIT)


@compiled
def read_units(encounter, noise):
    """The reading of a fish, rounded to whole units; ``noise`` in units."""
    bearing = relative_bearing(encounter.x, encounter.y, encounter.heading, encounter.fish_x, encounter.fish_y)
    return round_units(bearing_in_units(bearing) + noise)


@compiled
def pose_of(measurement):
    """Place and unit vector of the heading of a measurement, as float32 loops take them."""
    return (
        f32(measurement.x),
        f32(measurement.y),
        f32(math.cos(measurement.heading)),
        f32(math.sin(measurement.heading)),
    )


def side_angles(units: float, sigma: float) -> tuple[float, float]:
    """Angles off the bow [rad] at which a reading, give or take sigma, is expected."""
    sides = np.linspace(math.pi, 0.0, 181)
    expected = np.array([bearing_in_units.py_func(side) for side in sides])  # rising
    nearer, farther = np.interp((units + sigma, units - sigma), expected, sides)
    return float(nearer), float(farther)


def density_by_bearing(sigma: float) -> np.ndarray:
    """(A, 19) density of the readings -9 to 9 by the cosine of the bearing (Eqs. 5, 6)."""
    expected = np.array([bearing_in_units.py_func(angle) for angle in np.arccos(middle_cosines())])
    readings = np.arange(-LARGEST_UNIT, LARGEST_UNIT + 1.0)
    return np.exp(-0.5 * ((readings - expected[:, None]) / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)
