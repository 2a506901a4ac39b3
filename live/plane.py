"""Longitude and latitude in a local plane: metres east and north of an origin on the WGS84 ellipsoid (pymap3d)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

REACH = 100e3  # m from the origin: there distances away from it come out short by 1.2e-4, 1 - cos(100 km / 6371 km)
GEODETIC_COLUMNS = (("lon", "lat"), ("longitude", "latitude"))


def degree_columns(columns: Sequence[str]) -> tuple[str, str] | None:
    """Which columns of a file tell longitude and latitude [degrees], if any do."""
    return next((pair for pair in GEODETIC_COLUMNS if set(pair) <= set(columns)), None)


def position_columns(columns: Sequence[str]) -> tuple[str, str]:
    """Which columns of a file tell the position: ``x,y``, or else degrees of longitude and latitude."""
    return ("x", "y") if {"x", "y"} <= set(columns) else degree_columns(columns) or ("x", "y")


@dataclass(frozen=True, kw_only=True)
class Plane:
    """The plane that touches the earth at an origin [degrees], x east and y north."""

    longitude: float
    latitude: float

    def __post_init__(self) -> None:
        check_geodetic(np.array([[self.longitude, self.latitude]]))

    @classmethod
    def amid(cls, geodetic: Floats) -> Plane:
        """With the mean of longitudes and latitudes (K, 2) [degrees] as its origin, across the date line too."""
        check_geodetic(geodetic)
        first = geodetic[0, 0]
        longitude = first + np.mean((geodetic[:, 0] - first + 180.0) % 360.0 - 180.0)
        return cls(longitude=float((longitude + 180.0) % 360.0 - 180.0), latitude=float(np.mean(geodetic[:, 1])))

    @property
    def origin(self) -> dict[str, float]:
        """As documents of results tell it [degrees, WGS84]."""
        return {"lon": self.longitude, "lat": self.latitude}

    def to_plane(self, geodetic: Floats) -> Floats:
        """East and north (K, 2) [m] of longitudes and latitudes (K, 2) [degrees] on the ellipsoid.

        Raises:
            ValueError: for degrees there are none of, or a place beyond ``REACH``.
            ImportError: without pymap3d.
        """
        check_geodetic(geodetic)
        east, north, up = _pymap3d().geodetic2enu(geodetic[:, 1], geodetic[:, 0], 0.0, self.latitude, self.longitude, 0.0)
        distance = np.sqrt(east**2 + north**2 + up**2)
        if (distance > REACH).any():
            far = geodetic[int(np.argmax(distance))]
            raise ValueError(
                f"longitude {far[0]:g}, latitude {far[1]:g} is {distance.max() / 1e3:.0f} km from the origin "
                f"{self.longitude:g}, {self.latitude:g} (at most {REACH / 1e3:.0f} km); choose an origin nearby"
            )
        return np.stack([east, north], axis=1)

    def to_geodetic(self, position: Floats) -> Floats:
        """Longitude and latitude (K, 2) [degrees] of the places on the ellipsoid above or below (K, 2) [m].

        Raises:
            ValueError: for a position beyond ``REACH``: UTM coordinates, say, which are no metres from this origin.
            ImportError: without pymap3d.
        """
        distance = np.hypot(position[:, 0], position[:, 1])
        if (distance > REACH).any():
            far = position[int(np.argmax(distance))]
            raise ValueError(
                f"position {far[0]:.0f}, {far[1]:.0f} m is beyond {REACH / 1e3:.0f} km; give metres east and north of the origin"
            )
        up = np.zeros(len(position))
        for _ in range(4):  # the ellipsoid falls away below the plane: 780 m at 100 km
            latitude, longitude, height = _pymap3d().enu2geodetic(
                position[:, 0], position[:, 1], up, self.latitude, self.longitude, 0.0
            )
            up = up - height
        return np.stack([longitude, latitude], axis=1)


def check_geodetic(geodetic: Floats) -> None:
    """Raise ValueError for longitudes and latitudes (K, 2) [degrees] there are none of."""
    bad = ~((np.abs(geodetic[:, 0]) <= 360.0) & (np.abs(geodetic[:, 1]) <= 90.0))
    if bad.any():
        longitude, latitude = geodetic[int(np.argmax(bad))]
        raise ValueError(
            f"longitude must be within +-360 and latitude within +-90 degrees, got {longitude:g} and {latitude:g}"
        )


def _pymap3d() -> Any:
    try:
        import pymap3d
    except ImportError:
        raise ImportError('longitude and latitude need pymap3d: pip install "tagtrack[geo]"') from None
    return pymap3d
