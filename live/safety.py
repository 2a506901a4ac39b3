"""What a vehicle must never be told: to leave its box, or to go on where nobody knows where it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

ACTIONS = ("hold", "stop", "home")
ARRIVED = 15.0  # from home, where a vehicle stays [m]


@dataclass(frozen=True)
class Box:
    """A polygon that the vehicle must stay in: corners (x, y) [m]; none: no box."""

    corners: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        if self.corners and len(self.corners) < 3:
            raise ValueError(f"a box needs at least three corners, got {len(self.corners)}")
        if self.corners and abs(self._area()) < 1.0:
            raise ValueError("a box must enclose some area; give its corners in order")

    def holds(self, x: float, y: float) -> bool:
        """Whether a place lies inside."""
        if not self.corners:
            return True
        inside = False
        for (ax, ay), (bx, by) in zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True):
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside

    def _area(self) -> float:
        pairs = zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True)
        return 0.5 * sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairs)

    @property
    def middle(self) -> tuple[float, float]:
        """A place inside to turn back to: the mean of the corners, or where that lies outside the nearest inner point to it."""
        x = sum(corner[0] for corner in self.corners) / len(self.corners)
        y = sum(corner[1] for corner in self.corners) / len(self.corners)
        if self.holds(x, y):
            return x, y
        middles = [
            ((ax + bx + cx) / 3.0, (ay + by + cy) / 3.0)
            for (ax, ay), (bx, by), (cx, cy) in zip(
                self.corners, (*self.corners[1:], self.corners[0]), (*self.corners[2:], *self.corners[:2]), strict=True
            )
        ]
        inner = [place for place in middles if self.holds(*place)]
        return min(inner, key=lambda place: math.dist(place, (x, y)))


@dataclass(frozen=True, kw_only=True)
class Guard:
    """Looks at each order before it goes out.

    Args:
        box: [m]. action: what is done where navigation is too old: ``hold`` (a circle, slowly), ``stop``, ``home``.
        home: (x, y) [m]. margin: how far ahead an order is followed, beside what the vehicle makes in ``reach`` seconds [m].
    """

    box: Box
    action: str = "hold"
    home: tuple[float, float] = (0.0, 0.0)
    margin: float = 20.0
    reach: float = 10.0
    cruise: float = 1.0  # [m/s], of holding and going home

    def __post_init__(self) -> None:
        if self.action not in ACTIONS:
            raise ValueError(f"the safe action must be {', '.join(ACTIONS)}, got {self.action!r}")
        if not self.box.holds(*self.home):
            raise ValueError(f"home ({self.home[0]:g}, {self.home[1]:g}) lies outside the mission box")

    def check(self, x: float, y: float, course: float, speed: float) -> tuple[float, float, str]:
        """Course [rad] and speed [m/s] to send for an order at a place, and why it is another one ("" if it is not)."""
        if not self.box.corners:
            return course, speed, ""
        if not self.box.holds(x, y):
            return _towards(x, y, self.box.middle), max(speed, self.cruise), "outside the box"
        way = self.margin + speed * self.reach
        steps = max(2, math.ceil(way / 5.0))
        for k in range(1, steps + 1):
            ahead = way * k / steps
            if not self.box.holds(x + ahead * math.cos(course), y + ahead * math.sin(course)):
                return _towards(x, y, self.box.middle), speed, "box"
        return course, speed, ""

    def act(self, x: float, y: float, heading: float) -> tuple[float, float, str]:
        """What is done where navigation is too old, from where the vehicle was last: course [rad], speed [m/s] and its name."""
        if self.action == "stop":
            return heading, 0.0, "stop"
        if self.action == "home":
            near = math.dist((x, y), self.home) <= ARRIVED
            return _towards(x, y, self.home), 0.0 if near else self.cruise, "home"
        return heading + 0.5 * math.pi, self.cruise, "hold"


def _towards(x: float, y: float, place: Sequence[float]) -> float:
    return math.atan2(place[1] - y, place[0] - x)
