"""How vehicles say where they are, and how that is held inside: metres east and north, radians from east to north, m/s."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tagtrack.live.plane import Plane

KNOT = 1852.0 / 3600.0  # [m/s]

# What a heading may be: from what is said to radians from east towards north, and back.
HEADINGS: Mapping[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "nautical": (  # degrees clockwise from north, as vehicles log it
        lambda degrees: math.radians((90.0 - degrees + 180.0) % 360.0 - 180.0),
        lambda angle: (90.0 - math.degrees(angle)) % 360.0,
    ),
    "mathematical": (float, float),  # radians counter-clockwise from east
}
SPEEDS: Mapping[str, float] = {"m/s": 1.0, "knots": KNOT}  # one of each in m/s


@dataclass(frozen=True, kw_only=True)
class Conventions:
    """The units in which a mission speaks.

    Args:
        headings: "nautical" (degrees clockwise from north) or "mathematical" (radians counter-clockwise from east).
        speeds: "m/s" or "knots".
        origin: longitude and latitude [degrees] of the place that is (0, 0) [m], where places are given in degrees; None: metres.
    Raises:
        ValueError: for a name that is none of these, or an origin that is no place on earth.
        ImportError: for an origin without pymap3d.
    """

    headings: str = "nautical"
    speeds: str = "m/s"
    origin: tuple[float, float] | None = None
    _plane: Plane | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        for name, known in (("headings", HEADINGS), ("speeds", SPEEDS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} must be {' or '.join(known)}, got {getattr(self, name)!r}")
        if self.origin is not None:
            object.__setattr__(self, "_plane", Plane(longitude=self.origin[0], latitude=self.origin[1]))
            self.place_in(*self.origin)  # without pymap3d it ends here

    def heading_in(self, heading: float) -> float:
        """Radians from east towards north."""
        return HEADINGS[self.headings][0](heading)

    def heading_out(self, angle: float) -> float:
        """A course as the mission speaks of it."""
        return HEADINGS[self.headings][1](angle)

    def speed_in(self, speed: float) -> float:
        """[m/s]"""
        return speed * SPEEDS[self.speeds]

    def speed_out(self, speed: float) -> float:
        """A speed as the mission speaks of it."""
        return speed / SPEEDS[self.speeds]

    def place_in(self, first: float, second: float) -> tuple[float, float]:
        """x, y [m] of x, y or of longitude, latitude."""
        if self._plane is None:
            return first, second
        x, y = self._plane.to_plane(np.array([[first, second]]))[0]
        return float(x), float(y)

    def place_out(self, x: float, y: float) -> tuple[float, float]:
        """x, y, or longitude and latitude [degrees], of a place [m]."""
        if self._plane is None:
            return x, y
        longitude, latitude = self._plane.to_geodetic(np.array([[x, y]]))[0]
        return float(longitude), float(latitude)

    def to_json(self) -> dict[str, Any]:
        return {"headings": self.headings, "speeds": self.speeds, "origin": self.origin}
