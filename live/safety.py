"""What a vehicle must never be told: to leave its box, or to go on where nobody knows where it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

ACTIONS = ("hold", "stop", "home")
ARRIVED = 15.0  # from home, where a vehicle stays [m]
HOLDS = 900.0  # of unknown navigation, after which holding and going home end [s]: the reckoned place is worth nothing then
# Turns that are tried where a course leads out of the box, the smallest first [rad].
TURNS = tuple(sorted((math.radians(10.0 * k - 170.0) for k in range(36)), key=abs))


@dataclass(frozen=True)
class Box:
    """A polygon that the vehicle must stay in: corners (x, y) [m]; none: no box.

    Raises:
        ValueError: for fewer than three corners, a corner that is no number, no area, or edges that cross.
    """

    corners: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        if not self.corners:
            return
        if len(self.corners) < 3:
            raise ValueError(f"a box needs at least three corners, got {len(self.corners)}")
        if bad := [corner for corner in self.corners if not all(map(math.isfinite, corner))]:
            raise ValueError(f"a corner of the box must be two numbers, got {bad[0][0]:g},{bad[0][1]:g}")
        if abs(0.5 * sum(ax * by - bx * ay for (ax, ay), (bx, by) in self._edges())) < 1.0:
            raise ValueError("a box must enclose some area; give its corners in order")
        edges = list(self._edges())
        for i, first in enumerate(edges):
            for j in range(i + 2, len(edges)):
                if (i, j) != (0, len(edges) - 1) and _cross(*first, *edges[j]):
                    raise ValueError("the edges of a box must not cross; give its corners in order")

    def _edges(self) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        return list(zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True))

    def holds(self, x: float, y: float) -> bool:
        """Whether a place lies inside."""
        if not self.corners:
            return True
        inside = False
        for (ax, ay), (bx, by) in self._edges():
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside

    def clear_way(self, x: float, y: float, course: float, way: float) -> float:
        """How far [m] one can go from inside on a course [rad] before an edge, at most ``way``."""
        ahead_x, ahead_y = math.cos(course), math.sin(course)
        for (ax, ay), (bx, by) in self._edges():
            across = ahead_x * (by - ay) - ahead_y * (bx - ax)
            if across == 0.0:
                continue
            distance = ((ax - x) * (by - ay) - (ay - y) * (bx - ax)) / across
            place = ((ax - x) * ahead_y - (ay - y) * ahead_x) / across
            if distance >= 0.0 and -1e-9 <= place <= 1.0 + 1e-9:
                way = min(way, distance)
        return way

    def nearest_inside(self, x: float, y: float) -> tuple[float, float]:
        """A place inside that is near one outside: a little beyond the nearest point of the edge."""
        best = min((_nearest(x, y, *edge) for edge in self._edges()), key=lambda place: math.dist(place, (x, y)))
        onward = math.atan2(best[1] - y, best[0] - x)
        for reach in (10.0, 3.0, 1.0, 0.1):
            for turn in TURNS:
                place = best[0] + reach * math.cos(onward + turn), best[1] + reach * math.sin(onward + turn)
                if self.holds(*place):
                    return place
        return best


@dataclass(frozen=True, kw_only=True)
class Guard:
    """Looks at each order before it goes out.

    Args:
        box: [m]. action: what is done where navigation is too old: ``hold`` (a circle, slowly), ``stop``, ``home``.
        home: (x, y) [m]. margin: how far ahead an order is followed, beside what the vehicle makes in ``reach`` seconds [m].
        cruise: of holding and going home [m/s]. radius: of the circle of holding [m]. turn_rate: the vehicle's fastest [rad/s].
    """

    box: Box
    action: str = "hold"
    home: tuple[float, float] = (0.0, 0.0)
    margin: float = 20.0
    reach: float = 10.0
    cruise: float = 1.0
    radius: float = 15.0
    turn_rate: float = 0.1  # at most [rad/s]

    def __post_init__(self) -> None:
        if self.action not in ACTIONS:
            raise ValueError(f"the safe action must be {', '.join(ACTIONS)}, got {self.action!r}")
        if not self.box.holds(*self.home):
            raise ValueError(f"home ({self.home[0]:g}, {self.home[1]:g}) lies outside the mission box; choose a place inside")

    def check(self, x: float, y: float, course: float, speed: float) -> tuple[float, float, str]:
        """Course [rad] and speed [m/s] to send for an order at a place, and why it is another one ("" if it is not).

        Where the way ahead leads out, the course nearest to the one asked for whose way stays inside is taken.
        """
        if not self.box.corners:
            return course, speed, ""
        if not self.box.holds(x, y):
            back = self.box.nearest_inside(x, y)
            return math.atan2(back[1] - y, back[0] - x), max(speed, self.cruise), "outside the box"
        way = self.margin + speed * self.reach
        room = [(self.box.clear_way(x, y, course + turn, way), turn) for turn in TURNS]
        if room[0][0] >= way:
            return course, speed, ""
        free = [turn for clear, turn in room if clear >= way]
        turn = free[0] if free else max(room)[1]  # in a corner too narrow to turn in: where there is most room
        return course + turn, speed, "box"


@dataclass
class Reckoning:
    """Where a vehicle is believed to be while its navigation is silent: it did as it was told."""

    guard: Guard
    x: float
    y: float
    heading: float  # [rad]
    course: float  # it was told [rad]
    speed: float  # [m/s]
    silence: float = 0.0  # since the last fix [s]

    def act(self, seconds: float) -> tuple[float, float, str]:
        """What is done after so many more seconds: course [rad], speed [m/s] and its name."""
        self.silence += seconds
        ticks = max(1, math.ceil(seconds))
        for _ in range(ticks):
            tick = seconds / ticks
            turn = (self.course - self.heading + math.pi) % (2.0 * math.pi) - math.pi
            self.heading += min(max(turn, -self.guard.turn_rate * tick), self.guard.turn_rate * tick)
            self.x += tick * self.speed * math.cos(self.heading)
            self.y += tick * self.speed * math.sin(self.heading)
        course, speed, name = self._choose(seconds)
        if speed > 0.0:
            course, speed, reason = self.guard.check(self.x, self.y, course, speed)
            name = f"{name}, {reason}" if reason else name
        self.course, self.speed = course, speed
        return course, speed, name

    def _choose(self, seconds: float) -> tuple[float, float, str]:
        guard = self.guard
        if guard.action == "stop" or self.silence > HOLDS:
            return self.course, 0.0, "stop"
        if guard.action == "hold":
            return self.heading + max(seconds, 1.0) * guard.cruise / guard.radius, guard.cruise, "hold"
        arrived = math.dist((self.x, self.y), guard.home) <= ARRIVED
        course = math.atan2(guard.home[1] - self.y, guard.home[0] - self.x)
        return (self.course if arrived else course), (0.0 if arrived else guard.cruise), "home"


Point = tuple[float, float]


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether two edges have an inner point in common."""

    def side(p: Point, q: Point, r: Point) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


def _nearest(x: float, y: float, a: Point, b: Point) -> Point:
    """The point of an edge that is nearest to a place."""
    length = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
    share = 0.0 if length == 0 else ((x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])) / length
    share = min(max(share, 0.0), 1.0)
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
