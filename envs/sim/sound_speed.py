"""Speed of sound in sea water, the factor between a travel time and a range (Mackenzie 1981).

Lin et al. 2013 take 1500 m/s. In water of 10 to 20 degrees it is 1490 to 1522 m/s, so a range of 100 m is up to 1.4 m off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

USUAL_SOUND_SPEED = 1500.0  # v [m/s] of Lin et al. 2013, Fig. 6

# Within which Mackenzie fitted the formula; outside it is a guess.
TEMPERATURES = (2.0, 30.0)  # [degrees Celsius]
SALINITIES = (25.0, 40.0)  # [parts per thousand]
DEPTHS = (0.0, 8000.0)  # [m]


def sound_speed(temperature: ArrayLike, salinity: ArrayLike, depth: ArrayLike) -> NDArray[np.float64]:
    """Speed of sound in sea water (Mackenzie 1981, J. Acoust. Soc. Am. 70(3), 807-812); standard error 0.07 m/s.

    Args:
        temperature: of the water [degrees Celsius], 2 to 30.
        salinity: [parts per thousand], 25 to 40; 35 in the open ocean.
        depth: below the surface [m], 0 to 8000. The three broadcast against each other.
    Returns:
        Speed [m/s], in their common shape; NaN where one of them is.
    Raises:
        ValueError: for a value outside the range of the formula (brackish or icy water: give the speed itself).

    The check value that goes with the formula, and what a sensor of the temperature is worth near the surface:

    >>> round(float(sound_speed(25.0, 35.0, 1000.0)), 3)
    1550.744
    >>> sound_speed([10.0, 20.0], 35.0, 5.0).round(1)
    array([1489.9, 1521.5])
    """
    t = _within(temperature, TEMPERATURES, "temperature", "degrees Celsius")
    s = _within(salinity, SALINITIES, "salinity", "parts per thousand") - 35.0
    d = _within(depth, DEPTHS, "depth", "m")
    of_temperature = 1448.96 + 4.591 * t - 5.304e-2 * t**2 + 2.374e-4 * t**3
    of_depth = 1.630e-2 * d + 1.675e-7 * d**2 - 7.139e-13 * t * d**3
    return np.asarray(of_temperature + 1.340 * s - 1.025e-2 * t * s + of_depth)


def _within(values: ArrayLike, allowed: tuple[float, float], name: str, unit: str) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    outside = (array < allowed[0]) | (array > allowed[1])
    if outside.any():
        raise ValueError(
            f"{name} must be within {allowed[0]:g} to {allowed[1]:g} {unit}, got {array[outside].flat[0]:g}; "
            "give the speed of sound itself there"
        )
    return array
