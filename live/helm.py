"""What follows from each line that comes aboard. No input or output here: the same lines at the same times give the same orders.

That is why a mission that was killed goes on from its journal bit for bit.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from tagtrack.envs.task import Task
from tagtrack.live.conventions import Conventions
from tagtrack.live.lines import BadLine
from tagtrack.live.receivers import Heard, Receiver
from tagtrack.live.safety import Box, Guard, Reckoning
from tagtrack.live.tracker import LONGEST_LEAP, SYNONYMS, Tracker
from tagtrack.live.vehicles import FASTEST, Fix, Order, VehicleLink, is_order_sane

AHEAD = 5.0  # by which a receiver's clock may be ahead of ours [s]
LEAP = 50.0  # that a place may make beside what the fastest vehicle covers [m]
MOST_REASONS = 50  # that are told apart
LONGEST_REACH = 60.0  # by which an order is followed ahead of the vehicle [s]
AGREE = 3  # fixes that agree with one another after a leap, and are then believed


@dataclass(frozen=True, kw_only=True)
class Orders:
    """What a mission is about."""

    task: Task
    tags: tuple[str, ...]
    policy: str
    conventions: Conventions
    box: tuple[tuple[float, float], ...] = ()  # in the mission's own places
    safe: str = "hold"
    home: tuple[float, float] | None = None  # where the mission begins if None
    depth: float = 0.0  # that the vehicle is told [m]
    late: float = 60.0  # by how much readings may come late [s]
    stale: float = 15.0  # how old navigation may be before the safe action [s]
    seed: int = 0
    step: float = 0.0  # more than 0: the clock counts lines of navigation, this long each, instead of running [s]
    stamp: str = "receiver"  # or "host": whose clock tells when a ping came


class Accepted(NamedTuple):
    """A ping that counted."""

    t: float  # [s]
    tag: str
    heard: bool
    arrival: float | None
    depth: float | None
    values: dict[str, float]


class Helm:
    """Tracker, policy and guard behind one receiver and one vehicle.

    Args:
        orders: what the mission is about. receiver, vehicle: who understands their lines.
    """

    def __init__(self, orders: Orders, receiver: Receiver, vehicle: VehicleLink) -> None:
        self.orders, self.receiver, self.vehicle = orders, receiver, vehicle
        self.counts: Counter[str] = Counter()  # lines that nothing followed from, by reason
        self.tracker: Tracker | None = None
        self.guard: Guard | None = None
        self.last_order: Order | None = None
        self.reason = ""  # why the last order is not the policy's
        self.fixes = 0
        self.heard_lines = 0
        self._last_time = math.nan  # of the last fix that counted [s]
        self._fixed_at = math.nan  # on the host's clock [s]
        self._odd: list[tuple[float, float, float]] = []  # fixes that leapt: time and place [m]
        self._anew: list[float] = []  # what the vehicle's clock was ahead by at fixes after a leap [s]
        self._offset = 0.0  # of the vehicle's clock to the host's [s]
        self._reckoning: Reckoning | None = None
        self._watched_at = math.nan  # [s]
        self.accepted: list[Accepted] | None = None  # pings that counted, where somebody wants to know
        self._at_origin = orders.conventions.origin is not None or not vehicle.in_degrees
        self._start(orders.conventions)  # wrong orders are told before anything is sent
        if not self._at_origin:
            self.tracker = None  # it begins where the vehicle does

    def _start(self, conventions: Conventions) -> None:
        orders = self.orders
        self.tracker = Tracker(
            orders.task,
            tags=orders.tags,
            policy=orders.policy,
            conventions=conventions,
            seed=orders.seed,
            late=orders.late,
            stale=orders.stale,
        )
        self._box = Box(tuple(conventions.place_in(*corner) for corner in orders.box) if self._at_origin else ())
        if self._at_origin and orders.home is not None and not self._box.holds(*conventions.place_in(*orders.home)):
            raise ValueError(f"home ({orders.home[0]:g}, {orders.home[1]:g}) lies outside the mission box; choose a place inside")

    def hear(self, line: bytes, now: float) -> None:
        """A line of the receiver, which came at a time of the host's clock [s]."""
        self.heard_lines += 1
        try:
            for heard in self.receiver.read(line):
                self._count_ping(heard, now)
        except BadLine as error:
            self._drop(f"receiver: {error}")

    def _count_ping(self, heard: Heard, now: float) -> None:
        tag = heard.tag if heard.tag in self.orders.tags else heard.tag.rpartition("-")[2]  # by its number, in any codespace
        if tag not in self.orders.tags:
            raise BadLine("a tag that is not in this mission")
        clock = self._clock(now)
        t = clock if heard.t is None or self.orders.stamp == "host" else heard.t
        if t > clock + max(AHEAD, 2.0 * self.orders.step):
            raise BadLine("clock is ahead of ours")
        if self.tracker is None:
            raise BadLine("before the first navigation")
        arrival = None if self.orders.stamp == "host" else heard.arrival
        names = self.tracker.task.scenario.belief.receiver.readings
        values = {name: value for name, value in heard.values.items() if SYNONYMS.get(name, name) in names}
        try:
            counts = self.tracker.hear(t, tag, heard=heard.heard, arrival=arrival, depth=heard.depth, **values)
        except ValueError as error:
            raise BadLine(_constant(error)) from None
        if counts and self.accepted is not None:
            self.accepted.append(Accepted(t, tag, heard.heard, arrival, heard.depth, values))

    def steer(self, line: bytes, now: float) -> Order | None:
        """A line of the vehicle: the order that follows from it, if any."""
        try:
            fix = self.vehicle.read(line)
            return None if fix is None else self._navigate(fix, now)
        except BadLine as error:
            self._drop(f"vehicle: {error}")
            return None

    def _drop(self, reason: str) -> None:
        """Count a line that nothing follows from; of reasons without end the last ones are one."""
        known = reason in self.counts or len(self.counts) < MOST_REASONS
        self.counts[reason if known else "other reasons"] += 1

    def _navigate(self, fix: Fix, now: float) -> Order | None:
        step = self.orders.step
        t = step * self.fixes if step > 0 else now if fix.t is None else fix.t
        if not math.isnan(self._last_time):
            self._check_clock(t, t - now if fix.t is not None and step == 0 else self._offset)
        if self.tracker is None:
            self._begin(fix)
        assert self.tracker is not None
        x, y = self._place(fix)
        self._refuse_leaps(t, x, y)
        try:
            self.tracker.navigate(t, fix.first, fix.second, fix.heading, fix.speed)
            command = self.tracker.steer(t)
        except ValueError as error:
            raise BadLine(_constant(error)) from None
        self.fixes += 1
        self._last_time, self._fixed_at = t, now
        self._offset = t - now if fix.t is not None else 0.0
        self._reckoning = None
        if self.guard is None:
            self.guard = self._make_guard(x, y)
        conventions = self.tracker.conventions
        course, speed, self.reason = self.guard.check(
            x, y, conventions.heading_in(command.course), conventions.speed_in(command.speed)
        )
        if self.reason:
            self.last_order = self._order(t, conventions.heading_out(course), speed)
        else:
            self.last_order = self._order(t, command.course, command.speed)  # as it was, to the last bit
        return self.last_order

    def _begin(self, fix: Fix) -> None:
        """Where places are degrees and neither origin nor box was named, the first fix is the origin."""
        given = self.orders.conventions
        if self._at_origin:
            self._start(given)
            return
        self._at_origin = True
        try:
            self._start(Conventions(headings=given.headings, speeds=given.speeds, origin=(fix.first, fix.second)))
        except ValueError as error:
            self._at_origin, self.tracker = False, None
            raise BadLine(_constant(error)) from None

    def _check_clock(self, t: float, offset: float) -> None:
        """A clock that leaps is not believed before several fixes agree; then a new belief begins."""
        leaps = t > self._last_time + LONGEST_LEAP or abs(offset - self._offset) > AHEAD
        if not leaps:
            if t < self._last_time:
                raise BadLine("clock goes back")
            self._anew.clear()
            return
        self._anew = [*(each for each in self._anew if abs(each - offset) <= AHEAD), offset][-AGREE:]
        if len(self._anew) < AGREE:
            raise BadLine("clock leaps")
        self._anew.clear()
        self._odd.clear()
        assert self.tracker is not None
        self._start(self.tracker.conventions)
        self._last_time = math.nan

    def _place(self, fix: Fix) -> tuple[float, float]:
        assert self.tracker is not None
        try:
            return self.tracker.conventions.place_in(fix.first, fix.second)
        except ValueError:
            raise BadLine("place is far from the origin") from None

    def _refuse_leaps(self, t: float, x: float, y: float) -> None:
        """A place that the vehicle cannot have reached is not believed before others agree with it."""
        if math.isnan(self._last_time):
            return
        assert self.tracker is not None
        pose = self.tracker.pose
        if math.dist((x, y), (pose.x, pose.y)) <= LEAP + FASTEST * (t - self._last_time):
            self._odd.clear()
            return
        near = [odd for odd in self._odd if math.dist((x, y), odd[1:]) <= LEAP + FASTEST * abs(t - odd[0])]
        self._odd = [*near, (t, x, y)][-AGREE:]
        if len(self._odd) < AGREE:
            raise BadLine("place leaps")
        self._odd.clear()

    def _make_guard(self, x: float, y: float) -> Guard:
        assert self.tracker is not None
        home = (x, y) if self.orders.home is None else self.tracker.conventions.place_in(*self.orders.home)
        vehicle = self.tracker.task.scenario.vehicle
        turn = vehicle.max_speed / vehicle.max_turn_rate
        if not self._box.holds(*home):
            home = self._box.nearest_inside(*home)
        return Guard(
            box=self._box,
            action=self.orders.safe,
            home=home,
            margin=10.0 + turn,
            reach=min(2.0 * self.tracker.time_step, LONGEST_REACH),
            cruise=0.7 * vehicle.max_speed,
            radius=2.0 * turn,
            turn_rate=vehicle.max_turn_rate,
        )

    @property
    def time_of_last_fix(self) -> float:
        """[s]; NaN before the first."""
        return self._last_time

    def watch(self, now: float) -> Order | None:
        """The safe action, where navigation is too old: asked every second or so, and nothing else follows from it."""
        if 0.0 <= now - self._fixed_at <= self.orders.stale or self.tracker is None or self.guard is None:
            return None
        conventions = self.tracker.conventions
        if self._reckoning is None:  # it has gone on since as it was told, or as it went
            pose, order = self.tracker.pose, self.last_order
            course = pose.heading if order is None else conventions.heading_in(order.course)
            speed = pose.speed if order is None else conventions.speed_in(order.speed)
            self._reckoning = Reckoning(self.guard, pose.x, pose.y, pose.heading, course, speed)
            self._watched_at = self._fixed_at
        passed = min(max(now - self._watched_at, 0.0), 60.0)
        self._watched_at = now
        course, speed, name = self._reckoning.act(passed)
        self.reason = f"navigation is {now - self._fixed_at:.0f} s old: {name}"
        self.last_order = self._order(now, conventions.heading_out(course), speed)
        return self.last_order

    def stop(self, now: float) -> Order | None:
        """The last order of all: to stand still; None before there was any."""
        if self.last_order is None:
            return None
        return self._order(now, self.last_order.course, 0.0)

    def _order(self, t: float, course: float, speed: float) -> Order | None:
        order = Order(t, course, speed, self.orders.depth)
        if not is_order_sane(order):
            self.counts["no sane order"] += 1
            return None
        return order

    def _clock(self, now: float) -> float:
        step = self.orders.step
        return now + self._offset if step == 0 else step * max(self.fixes - 1, 0)

    def status(self, now: float) -> dict[str, Any]:
        """What people want to see."""
        said: dict[str, Any] = {"t": round(now, 3), "fixes": self.fixes, "navigation_age_s": _rounded(now - self._fixed_at)}
        if self.tracker is not None and self.fixes:
            said["tags"] = [
                {
                    "tag": estimate.tag,
                    "x": _rounded(estimate.x, 6),
                    "y": _rounded(estimate.y, 6),
                    "sd": _rounded(math.sqrt(float(estimate.covariance.trace()))),
                    "heard_s_ago": _rounded(self._clock(now) - estimate.heard),
                    "lost": estimate.lost,
                }
                for estimate in self.tracker.last_estimates()
            ]
        if self.last_order is not None:
            said["course"], said["speed"] = _rounded(self.last_order.course, 2), _rounded(self.last_order.speed, 2)
        said["reason"] = self.reason
        said["dropped"] = dict(self.dropped)
        return said

    @property
    def dropped(self) -> Counter[str]:
        """Lines that nothing followed from, by reason; those that came late did count."""
        counts = self.counts + (self.tracker.counts if self.tracker is not None else Counter())
        counts.pop("late", None)
        return counts


def _constant(error: ValueError) -> str:
    """What was wrong, without its numbers."""
    return str(error).partition(";")[0].partition(", got")[0].partition(", from")[0].partition(" to ")[0]


def _rounded(value: float, digits: int = 1) -> float | None:
    return round(value, digits) if math.isfinite(value) else None


def parse_corners(text: str) -> tuple[tuple[float, float], ...]:
    """Corners as ``"x,y x,y x,y"``. Raises ValueError."""
    corners = []
    for part in text.split():
        first, comma, second = part.partition(",")
        try:
            corners.append((float(first), float(second)))
        except ValueError:
            raise ValueError(f"a corner is x,y (or lon,lat), got {part!r}") from None
    return tuple(corners)


def describe_counts(counts: Mapping[str, int]) -> str:
    """How many lines were dropped, and why."""
    return ", ".join(f"{count} {reason}" for reason, count in sorted(counts.items())) or "none"
