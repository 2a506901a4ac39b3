"""What vehicles say of themselves and how they are told where to go. Formats are from public drivers; none was tried on hardware.

Inside, a fix is in the mission's conventions: a place (x, y [m] or longitude, latitude), a heading [degrees clockwise from north]
and a speed [m/s]; so is an order.
"""

from __future__ import annotations

import json
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from tagtrack.live.conventions import KNOT
from tagtrack.live.lines import BadLine, nmea, number, object_of, open_nmea, text_of

FASTEST = 20.0  # no vehicle of ours goes faster [m/s]
PLACES = 1e7  # [m]


@dataclass(frozen=True)
class Fix:
    """What a vehicle says of itself."""

    t: float | None  # [s]; None: now
    first: float  # x [m] or longitude
    second: float
    heading: float | None  # [degrees clockwise from north]
    speed: float | None  # [m/s]


@dataclass(frozen=True)
class Order:
    """What a vehicle is told."""

    t: float  # [s]
    course: float  # [degrees clockwise from north]
    speed: float  # [m/s]
    depth: float  # [m]


class VehicleLink(ABC):
    """Speaks with one kind of vehicle: the payload's side, and for simulations the vehicle's."""

    name: ClassVar[str]
    in_degrees: bool = True  # whether it tells longitude and latitude
    question: ClassVar[bytes] = b""  # sent to be told navigation, where it must be asked

    @abstractmethod
    def read(self, line: bytes) -> Fix | None:
        """Navigation, or None where a line tells of something else. Raises BadLine."""

    @abstractmethod
    def order(self, order: Order) -> bytes:
        """The line that tells it where to go."""

    @abstractmethod
    def tell(self, fix: Fix) -> bytes:
        """As the vehicle: the lines that say where it is."""

    @abstractmethod
    def obey(self, line: bytes) -> tuple[float, float] | None:
        """As the vehicle: course [degrees] and speed [m/s] that a line asks for, or None. Raises BadLine."""

    def asks(self, line: bytes) -> bool:
        """As the vehicle: whether a line asks for navigation."""
        return False


class Goby(VehicleLink):
    """The text of Goby's basic frontseat: ``NAV,LAT:..,LON:..,DEPTH:..,HEADING:..,SPEED:..`` and ``CMD,HEADING:..,SPEED:..``."""

    name = "goby"

    def read(self, line: bytes) -> Fix | None:
        text = text_of(line)
        kind, values = _pairs(text)
        if kind in ("CTRL", "START"):
            return None
        if kind == "CMD":
            if values.get("RESULT") == "ERROR":
                raise BadLine("the vehicle refused a command")
            return None
        if kind != "NAV":
            raise BadLine("no line of Goby's")
        if missing := [name for name in ("LAT", "LON", "HEADING", "SPEED") if name not in values]:
            raise BadLine(f"no {missing[0]}")
        return Fix(
            None,
            *_place(values["LON"], values["LAT"]),
            number(values["HEADING"], "HEADING", least=-360.0, most=360.0),
            number(values["SPEED"], "SPEED", least=-FASTEST, most=FASTEST),
        )

    def order(self, order: Order) -> bytes:
        return f"CMD,HEADING:{order.course:.2f},SPEED:{order.speed:.3f},DEPTH:{order.depth:.1f}\r\n".encode("ascii")

    def tell(self, fix: Fix) -> bytes:
        place = f"LAT:{fix.second:.9f},LON:{fix.first:.9f},DEPTH:0.0"
        return f"NAV,{place},HEADING:{fix.heading or 0.0:.3f},SPEED:{fix.speed or 0.0:.4f}\r\n".encode("ascii")

    def obey(self, line: bytes) -> tuple[float, float] | None:
        kind, values = _pairs(text_of(line))
        if kind != "CMD" or "HEADING" not in values or "SPEED" not in values:
            return None
        return number(values["HEADING"], "HEADING"), number(values["SPEED"], "SPEED", least=0.0, most=FASTEST)


class Iver(VehicleLink):
    """Iver2 and 3 by Remote Helm: asks ``$OSD``, reads ``$OSI`` and the compass line, writes ``$OMS``, all with NMEA checksums.

    Speeds are knots there. Its depth is metres from Remote Helm 5 on, feet before: ``feet`` says which.
    """

    name = "iver"
    question = nmea("OSD,G,C,S,P,,,,")
    PITCH, TIMEOUT = 45.0, 5.0  # largest pitch [degrees]; after how long without an order it gives up [s]
    _COMPASS = re.compile(r"C(-?[\d.]+)P(-?[\d.]+)R(-?[\d.]+)T(-?[\d.]+)D(-?[\d.]+)")

    def __init__(self, *, feet: bool = False) -> None:
        self.feet = feet
        self._compass: float | None = None

    def read(self, line: bytes) -> Fix | None:
        body = open_nmea(text_of(line))
        if found := self._COMPASS.fullmatch(body):
            self._compass = number(found[1], "compass", least=0.0, most=360.0)
            return None
        fields = body.split(",")
        if fields[0] == "ACK":
            if len(fields) >= 4 and fields[3] not in ("", "0"):
                raise BadLine(f"the vehicle refused: error {fields[3][:4]}")
            return None
        if fields[0] != "OSI":
            return None
        if len(fields) < 16:
            raise BadLine("wrong number of fields")
        heading = number(fields[14], "heading", least=0.0, most=360.0) if fields[14] else self._compass
        return Fix(
            None,
            *_place(fields[5], fields[4]),
            heading,
            number(fields[6], "speed", least=-FASTEST, most=FASTEST) * KNOT,
        )

    def order(self, order: Order) -> bytes:
        depth = order.depth / 0.3048 if self.feet else order.depth
        course, speed = round(order.course % 360.0, 1) % 360.0, order.speed / KNOT
        return nmea(f"OMS,{course:.1f},{depth:.1f},{self.PITCH:g},{speed:.1f},{self.TIMEOUT:g}")

    def tell(self, fix: Fix) -> bytes:
        heading = (fix.heading or 0.0) % 360.0
        fields = ["OSI", "8080808080", "P", "1", f"{fix.second:.7f}", f"{fix.first:.7f}", f"{(fix.speed or 0.0) / KNOT:.3f}"]
        fields += ["0", "N", "30.0", "0", "0", "mission", "0", f"{heading:.1f}", "0.0"]
        return nmea(f"C{heading:.1f}P0.0R0.0T20.0D0.0") + nmea(",".join(fields))

    def obey(self, line: bytes) -> tuple[float, float] | None:
        fields = open_nmea(text_of(line)).split(",")
        if fields[0] != "OMS" or len(fields) < 6:
            return None
        return number(fields[1], "heading"), number(fields[4], "speed", least=0.0) * KNOT

    def asks(self, line: bytes) -> bool:
        return line.startswith(b"$OSD")


class JsonVehicle(VehicleLink):
    """Anything else: ``{"t": 12.0, "x": 1.5, "y": -2.0, "heading": 90, "speed": 1.2}`` (or lon, lat) in, and out
    ``{"t": 12.0, "course": 270.0, "speed": 1.3, "depth": 0}``. Without ``t`` it is now."""

    name = "json"

    def __init__(self, *, degrees: bool = False) -> None:
        self.in_degrees = degrees

    def read(self, line: bytes) -> Fix | None:
        said = object_of(line)
        axes = ("lon", "lat") if self.in_degrees else ("x", "y")
        if not set(axes) <= set(said):
            other = {"lon", "lat"} <= set(said) or {"x", "y"} <= set(said)
            raise BadLine("degrees where metres are expected, or the other way round" if other else f"no {axes[0]},{axes[1]}")
        limits = (360.0, 90.0) if self.in_degrees else (PLACES, PLACES)
        first, second = (number(said[axis], axis, least=-most, most=most) for axis, most in zip(axes, limits, strict=True))
        given = {name: None if said.get(name) is None else number(said[name], name) for name in ("t", "heading", "speed")}
        if given["speed"] is not None and abs(given["speed"]) > FASTEST:
            raise BadLine("speed out of range")
        return Fix(given["t"], first, second, given["heading"], given["speed"])

    def order(self, order: Order) -> bytes:
        said = {"t": order.t, "course": order.course, "speed": order.speed, "depth": order.depth}
        return (json.dumps(said) + "\n").encode("ascii")

    def tell(self, fix: Fix) -> bytes:
        axes = ("lon", "lat") if self.in_degrees else ("x", "y")
        said = {"t": fix.t, axes[0]: fix.first, axes[1]: fix.second, "heading": fix.heading, "speed": fix.speed}
        return (json.dumps({name: value for name, value in said.items() if value is not None}) + "\n").encode("ascii")

    def obey(self, line: bytes) -> tuple[float, float] | None:
        said = object_of(line)
        if "course" not in said:
            return None
        return number(said["course"], "course"), number(said.get("speed"), "speed", least=0.0, most=FASTEST)


VEHICLES: Mapping[str, type[VehicleLink]] = {kind.name: kind for kind in (Iver, Goby, JsonVehicle)}


def _pairs(text: str) -> tuple[str, dict[str, str]]:
    kind, *parts = text.split(",")
    pairs = [part.partition(":") for part in parts]
    names = [name.strip().upper() for name, _, _ in pairs]
    if len(set(names)) < len(names):
        raise BadLine("a field is told twice")
    return kind.strip().upper(), {name: value.strip() for name, (_, _, value) in zip(names, pairs, strict=True)}


def _place(longitude: str, latitude: str) -> tuple[float, float]:
    """Degrees. Raises BadLine, also for 0, 0, which receivers of satellites tell as long as they see none."""
    place = number(longitude, "longitude", least=-180.0, most=360.0), number(latitude, "latitude", least=-90.0, most=90.0)
    if place == (0.0, 0.0):
        raise BadLine("no position yet")
    return place


def is_order_sane(order: Order) -> bool:
    """Whether an order is one that may be sent."""
    return all(map(math.isfinite, (order.course, order.speed, order.depth))) and 0.0 <= order.speed <= FASTEST
