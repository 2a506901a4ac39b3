"""Angles and bearings in the plane: x east, y north, radians counter-clockwise from x; a positive bearing is to port."""

from __future__ import annotations

import math

from tagtrack.envs.kernels.compiling import compiled


@compiled
def wrap_angle(angle):
    """The same angle within [-pi, pi).

    >>> round(wrap_angle(1.5 * math.pi) / math.pi, 9), wrap_angle(math.pi) / math.pi
    (-0.5, -1.0)
    """
    turns = angle / (2.0 * math.pi)
    return (turns - math.floor(turns + 0.5)) * 2.0 * math.pi


@compiled
def relative_bearing(from_x, from_y, heading, to_x, to_y):
    """Bearing of a point relative to a heading, in [-pi, pi) [rad]; 0 where the two points coincide.

    What lies north of a vehicle that heads east is abeam to port:

    >>> math.degrees(relative_bearing(0.0, 0.0, 0.0, 0.0, 50.0))
    90.0
    """
    if from_x == to_x and from_y == to_y:
        return 0.0
    return wrap_angle(math.atan2(to_y - from_y, to_x - from_x) - heading)
