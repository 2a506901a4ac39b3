"""A belief about tagged animals, and a policy that steers by it, fed with navigation and readings as they come.

Time runs on the grid of the task: from the first navigation on, a step each ``time_step``. A reading counts at its own time, from
where the vehicle was then; in the steps without any the receiver has listened and heard nothing. Given what an environment's
episode holds, estimates, observations and actions are that episode's, bit for bit.

What is done where things go wrong:

* a tag that never pinged keeps the growing cloud of its first particles: ``Estimate.heard`` is NaN, ``lost`` is true;
* a reading that comes late, by up to ``late`` seconds, gives the belief that it would have given in time (what the observation
  remembers of the last minute, and what was ordered meanwhile, stays as it was); older ones are dropped;
* a second reading of a tag within ``SAME_PING`` of another is an echo or a doubled line, and dropped;
* where navigation stalls the vehicle is reckoned to go on as it last said, for ``stale`` seconds, and to stay there afterwards;
  ``Command.stale`` says so;
* navigation whose clock goes back, or a clock that leaps ahead by more than ``LONGEST_LEAP``, is refused: the tracker stays
  as it was.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tagtrack.envs.belief.filter import require_sensible
from tagtrack.envs.measurement import Status, measurement
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.sensors.bearing import LARGEST_UNIT
from tagtrack.envs.task import Task, build_task
from tagtrack.live.believer import Believer
from tagtrack.live.conventions import Conventions
from tagtrack.live.steersman import PolicyLike, make_steersman

SAME_TIME = 1e-6  # two times nearer than this are one [s]: what is left of a time of day in float64
SAME_PING = 0.1  # [s]
LONGEST_LEAP = 3600.0  # that a clock may make [s]
# Names of readings beside a sensor's own.
SYNONYMS: Mapping[str, str] = {"bearing_units": "units", "range": "slant_range"}


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Where a tag is believed to be, as of the last step of the task."""

    tag: Hashable
    time: float  # [s]
    x: float  # mean of the particles, in the mission's own units, as are ``best_x`` and ``best_y``
    y: float
    covariance: np.ndarray  # (2, 2) east and north [m^2]
    best_x: float  # what the filter reports: the mean, or the particle that weighed most
    best_y: float
    heard: float  # when it was last heard [s]; NaN: never
    lost: bool  # never heard, or spread wider than the task's ``lost_error``


@dataclass(frozen=True, kw_only=True)
class Command:
    """What to steer until the next one."""

    course: float  # in the mission's own units, as the speed
    speed: float
    stale: bool = False  # navigation is older than it may be: take a safe action instead


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Where the vehicle said it was."""

    time: float  # since the beginning [s]
    x: float  # [m]
    y: float
    heading: float  # [rad]
    speed: float  # [m/s]


class Ping(NamedTuple):
    """A tag was heard, or asked in vain."""

    time: float  # since the beginning [s]
    status: Status
    arrival: float  # by the receiver's clock, since the beginning [s]
    readings: list[float]
    depth: float | None = None  # of the tag below the vehicle, where it was told [m]


class Tracker:
    """One vehicle's beliefs about its tags, and a policy's orders.

    >>> tracker = Tracker("RangeOnly-v0", tags=["A69-1601-27"], policy="circle:100")
    >>> tracker.navigate(0.0, x=0.0, y=0.0, heading=90.0, speed=1.0)
    >>> tracker.hear(30.0, "A69-1601-27", range=210.0)
    True
    >>> tracker.navigate(30.0, x=30.0, y=0.0, heading=90.0, speed=1.0)
    >>> command = tracker.steer(30.0)
    >>> 0 <= command.course < 360 and not command.stale
    True
    >>> [estimate.heard for estimate in tracker.estimates(30.0)]
    [30.0]

    Args:
        task: an environment id, or a ``Task``; its truth is not looked at.
        tags: names of the tags, in the order of the observation; without any as many as the task has, from 0.
        policy: a baseline (``circle:40``), the folder of a training run, or a policy; None: nobody steers.
        conventions: units of places, headings and speeds.
        particles: of each belief; the task's own if None. seed, episode: of its random numbers.
        depths: of tags below the vehicle [m]; 0 where none is given.
        late: by how much readings may come late [s]. stale: how old the last navigation may be [s]; two steps, at least 5 s,
            if None.
    Raises:
        ValueError: for an unknown id, tag or policy, a number out of range, a policy for another task.
    """

    def __init__(
        self,
        task: str | Task,
        *,
        tags: Sequence[Hashable] | None = None,
        policy: PolicyLike = None,
        conventions: Conventions | None = None,
        particles: int | None = None,
        seed: int = 0,
        episode: int = 0,
        depths: Mapping[Any, float] | None = None,
        late: float = 60.0,
        stale: float | None = None,
    ) -> None:
        if isinstance(tags, str):
            raise ValueError(f"tags is a list of names, got {tags!r}; write [{tags!r}]")
        for name, key in (("seed", seed), ("episode", episode)):
            if isinstance(key, bool) or not isinstance(key, (int, np.integer)) or not 0 <= key < 2**63:
                raise ValueError(f"{name} must be a whole number of at least 0, got {key!r}")
        made = build_task(task)
        changes: dict[str, Any] = {} if particles is None else {"belief.particles": particles}
        if tags is not None:
            changes["targets"] = len(tags)
        scenario = with_overrides(made.scenario, changes)
        self.task = made._replace(scenario=scenario)
        self.tags = tuple(range(scenario.targets)) if tags is None else tuple(tags)
        if len(set(self.tags)) < len(self.tags):
            raise ValueError(f"each tag is named once, got {list(self.tags)}")
        self.conventions = conventions or Conventions()
        self.time_step = scenario.time_step
        self.stale = max(5.0, 2.0 * self.time_step) if stale is None else stale
        for name, value in (("late", late), ("stale", self.stale)):
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be at least 0 seconds, got {value}")
        self.late = late
        self.counts: Counter[str] = Counter()  # what was dropped, by reason
        self.believer = Believer(scenario, remember=math.ceil(late / self.time_step) + 1)
        self.steersman = make_steersman(policy, self.believer, self.task)
        self._keys = (int(seed), int(episode))
        self._place = {tag: t for t, tag in enumerate(self.tags)}
        self._depth = {t: 0.0 for t in range(len(self.tags))}
        for tag, depth in (depths or {}).items():
            require_sensible(depth, f"the depth of tag {tag!r}")
            self._depth[self._find(tag)] = float(depth)
        self._start = math.nan  # time of the first navigation, as the mission counts [s]
        self._step = 0
        self._poses: list[Pose] = []
        self._waiting: list[list[Ping]] = [[] for _ in self.tags]  # readings that are still to be counted
        self._heard: list[list[float]] = [[] for _ in self.tags]  # times of readings within reach of what may come
        self._order: tuple[float, float] | None = None

    # What comes in.

    def navigate(self, t: float, x: float, y: float, heading: float | None = None, speed: float | None = None) -> None:
        """Where the vehicle believes to be.

        Args:
            t: time [s], any clock that runs on. x, y: [m], or longitude and latitude where ``conventions`` has an origin.
            heading: by the compass; the course made good if None. speed: through the water; that made good if None.
        Raises:
            ValueError: for a number that is not finite, or a clock that goes back or leaps.
        """
        t, x, y = (_number(value, f"navigation: {name}") for name, value in (("t", t), ("x", x), ("y", y)))
        heading = None if heading is None else _number(heading, "navigation: heading")
        speed = None if speed is None else _number(speed, "navigation: speed")
        east, north = self.conventions.place_in(x, y)
        begins = math.isnan(self._start)
        time = 0.0 if begins else self._since_start(t)
        last = self._poses[-1] if self._poses else None
        if last is not None and time < last.time - SAME_TIME:
            raise ValueError(f"navigation goes back in time, from {self._start + last.time:.12g} to {t:.12g} s; drop it")
        angle, pace = self._made_good(last, time, east, north)
        pose = Pose(
            time=time,
            x=east,
            y=north,
            heading=angle if heading is None else self.conventions.heading_in(heading),
            speed=pace if speed is None else self.conventions.speed_in(speed),
        )
        if last is not None and time <= last.time + SAME_TIME:
            self._poses.pop()
        self._poses.append(pose)
        if begins:
            self._begin(t, pose)

    def hear(
        self,
        t: float,
        tag: Hashable,
        *,
        heard: bool = True,
        arrival: float | None = None,
        depth: float | None = None,
        **readings: float,
    ) -> bool:
        """A ping of a tag, or that it was asked and did not answer (``heard=False``).

        Args:
            t: when it came [s], by the clock of the navigation.
            tag: one of ``tags``. arrival: when the ping came by the receiver's clock [s]; ``t`` if None. depth: of the tag below
                the vehicle [m].
            readings: by their names: ``bearing_units``, ``strength``, ``range`` ... as far as the sensor tells.
        Returns:
            Whether it counts: an echo, or one that is too late, does not (``counts`` says how many there were).
        Raises:
            ValueError: for an unknown tag or reading, one that is missing or not finite, a clock that leaps.
        """
        t = _number(t, f"tag {tag!r}: t")
        place, values = self._find(tag), self._values(tag, heard, readings)
        depth = None if depth is None else _number(depth, f"tag {tag!r}: depth", least=0.0)
        arrival = None if arrival is None else _number(arrival, f"tag {tag!r}: arrival")
        if math.isnan(self._start):
            self.counts["before the first navigation"] += 1
            return False
        time = self._since_start(t)
        if time <= SAME_TIME:
            self.counts["before the first step"] += 1
            return False
        if time < self._step * self.time_step - self.late:
            self.counts["too late"] += 1
            return False
        earlier = self._heard[place]
        near = bisect.bisect_left(earlier, time - SAME_PING)
        if near < len(earlier) and earlier[near] <= time + SAME_PING:
            self.counts["doubled"] += 1
            return False
        bisect.insort(earlier, time)
        came = math.nan if not heard else time if arrival is None else arrival - self._start
        ping = Ping(time, Status.HEARD if heard else Status.MISSED, came, values, depth)
        if time > self._step * self.time_step + SAME_TIME:
            bisect.insort(self._waiting[place], ping)
        else:
            self._go_back(place, ping)
        return True

    # What goes out.

    def steer(self, t: float) -> Command:
        """What to steer at a time: the order of the last step of the task.

        Raises:
            RuntimeError: before the first navigation, or without a policy. ValueError: for a clock that leaps.
        """
        if self.steersman is None:
            raise RuntimeError("nobody steers; give the tracker a policy")
        self.advance(t)
        if self._order is None:
            raise RuntimeError("there is nothing to steer by before the first navigation")
        course, speed = self._order
        old = self._since_start(t) - self._poses[-1].time
        return Command(
            course=self.conventions.heading_out(course), speed=self.conventions.speed_out(speed), stale=old > self.stale
        )

    def estimates(self, t: float) -> list[Estimate]:
        """Where each tag is believed to be at a time, in the order of ``tags``. Raises as ``advance`` does."""
        self.advance(t)
        return self.last_estimates()

    def in_metres(self, estimates: Sequence[Estimate]) -> list[Estimate]:
        """The same, with places in metres whatever the mission's units."""
        found = []
        for each in estimates:
            x, y = self.conventions.place_in(each.x, each.y)
            best_x, best_y = self.conventions.place_in(each.best_x, each.best_y)
            found.append(dataclasses.replace(each, x=x, y=y, best_x=best_x, best_y=best_y))
        return found

    @property
    def waiting(self) -> int:
        """Pings that no step has counted yet."""
        return sum(map(len, self._waiting))

    def last_estimates(self) -> list[Estimate]:
        """As ``estimates``, of the last step."""
        now = self._start + self._step * self.time_step
        return [self._estimate(place, now) for place in range(len(self.tags))]

    def advance(self, t: float) -> None:
        """Bring beliefs and orders up to a time: the last step of the task that ends by then. An earlier time changes nothing.

        Raises:
            RuntimeError: before the first navigation. ValueError: for a clock that leaps.
        """
        if math.isnan(self._start):
            raise RuntimeError("the tracker begins with the first navigation")
        until = self._since_start(_number(t, "t"))
        while (self._step + 1) * self.time_step <= until + SAME_TIME:
            self._advance()

    @property
    def pose(self) -> Pose:
        """What the vehicle said of itself last [m, rad, m/s]; its time counts from the first navigation."""
        return self._poses[-1]

    @property
    def observation(self) -> np.ndarray:
        """(D,) float32: what a policy sees; the tracker's own, copy what you keep."""
        return self.believer.observation[0, 0]

    # How.

    def _since_start(self, t: float) -> float:
        time = t - self._start
        now = self._step * self.time_step
        if self._poses and time > max(now, self._poses[-1].time) + LONGEST_LEAP:
            raise ValueError(f"the clock leaps ahead to {t:.12g} s, by more than {LONGEST_LEAP:g} s; begin a new tracker")
        return time

    def _find(self, tag: Hashable) -> int:
        if tag not in self._place:
            raise ValueError(f"tag {tag!r} is not in this mission; its tags are {', '.join(map(str, self.tags))}")
        return self._place[tag]

    def _values(self, tag: Hashable, heard: bool, given: Mapping[str, float]) -> list[float]:
        """Readings in the sensor's order, NaN where it does not need one that is missing."""
        receiver = self.task.scenario.belief.receiver
        limits = {"slant_range": (0.0, math.inf), "units": (-LARGEST_UNIT, LARGEST_UNIT)}
        readings = {}
        for name, value in given.items():
            own = SYNONYMS.get(name, name)
            least, most = limits.get(own, (-math.inf, math.inf)) if own in receiver.readings else (-math.inf, math.inf)
            if value is None or (isinstance(value, float) and math.isnan(value)):
                continue
            readings[own] = _number(value, f"tag {tag!r}: {name}", least=least, most=most)
        unknown = [name for name in readings if name not in receiver.readings]
        if unknown:
            reads = ", ".join(map(_told_as, receiver.readings)) or "nothing but that a tag is heard"
            raise ValueError(f"tag {tag!r}: a {type(receiver).__name__} reads {reads}, got {_told_as(unknown[0])}")
        if not heard:
            return []
        missing = [receiver.readings[k] for k in receiver.weighed if receiver.readings[k] not in readings]
        if missing:
            raise ValueError(f"tag {tag!r}: a {type(receiver).__name__} needs {_told_as(missing[0])}")
        return [float(readings.get(name, math.nan)) for name in receiver.readings]

    def _made_good(self, last: Pose | None, time: float, x: float, y: float) -> tuple[float, float]:
        if last is None or time <= last.time + SAME_TIME:
            return (0.0, 0.0) if last is None else (last.heading, last.speed)
        moved = math.hypot(x - last.x, y - last.y)
        return (math.atan2(y - last.y, x - last.x) if moved > 1e-9 else last.heading), moved / (time - last.time)

    def _begin(self, t: float, pose: Pose) -> None:
        self._start = t
        self._set_navigation(pose)
        seed, episode = self._keys
        self.believer.begin(pose.x, pose.y, seed=seed, episode=episode)
        self._decide(begins=True)

    def _advance(self) -> None:
        """One step of the task: readings at their times, then silence or the last reading at its end."""
        self._step += 1
        end = self._step * self.time_step
        pose = self._pose_at(end)
        self._set_navigation(pose)
        self.believer.worlds.clock[0]["step"] = self._step
        for place, waiting in enumerate(self._waiting):
            due = bisect.bisect_right(waiting, end + SAME_TIME, key=lambda ping: ping.time)
            self._tell(place, waiting[:due], end)
            del waiting[:due]
        self.believer.look()
        self._decide(begins=False)
        self._forget(end)

    def _tell(self, place: int, due: list[Ping], end: float) -> None:
        """Let one belief go through a step, with the readings that came in it."""
        belief, begin = self.believer.filters[place], end - self.time_step
        pings = [ping._replace(time=end) if ping.time > end - SAME_TIME else ping for ping in due]
        if not pings or pings[-1].time < end:
            pings.append(Ping(end, Status.NOTHING, math.nan, []))
        now = begin
        for ping in pings:
            belief.predict(self.time_step if (now, ping.time) == (begin, end) else ping.time - now)
            if ping.depth is not None:
                self._depth[place] = ping.depth
            belief.correct(self._measure(place, ping))
            now = ping.time

    def _go_back(self, place: int, ping: Ping) -> None:
        """A reading of a step that was counted already: then, the receiver had been said to have heard nothing."""
        end = round(ping.time / self.time_step) * self.time_step
        if abs(ping.time - end) <= SAME_TIME:
            ping = ping._replace(time=end)
        self.believer.filters[place].correct(self._measure(place, ping))
        self.counts["late"] += 1

    def _measure(self, place: int, ping: Ping) -> np.ndarray:
        pose = self._pose_at(ping.time)
        depth = self._depth[place] if ping.depth is None else ping.depth
        return measurement(
            time=ping.time, x=pose.x, y=pose.y, heading=pose.heading, tag=place, depth=depth, status=ping.status,
            arrival=ping.arrival, readings=ping.readings,
        )  # fmt: skip

    def _pose_at(self, time: float) -> Pose:
        """Between two fixes, or reckoned on from the last."""
        poses = self._poses
        after = bisect.bisect_left(poses, time - SAME_TIME, key=lambda pose: pose.time)
        if after < len(poses) and abs(poses[after].time - time) <= SAME_TIME:
            return poses[after]
        if after == 0:
            return poses[0]
        before = poses[after - 1]
        if after == len(poses):
            way = before.speed * min(time - before.time, self.stale)
            return dataclasses.replace(
                before, time=time, x=before.x + way * math.cos(before.heading), y=before.y + way * math.sin(before.heading)
            )
        then = poses[after]
        share = (time - before.time) / (then.time - before.time)
        turn = (then.heading - before.heading + math.pi) % (2.0 * math.pi) - math.pi
        return Pose(
            time=time,
            x=before.x + share * (then.x - before.x),
            y=before.y + share * (then.y - before.y),
            heading=(before.heading + share * turn + math.pi) % (2.0 * math.pi) - math.pi,
            speed=before.speed + share * (then.speed - before.speed),
        )

    def _set_navigation(self, pose: Pose) -> None:
        navigation = self.believer.worlds.navigation
        for name in ("x", "y", "heading", "speed"):
            navigation[name] = getattr(pose, name)
        navigation["battery"], navigation["active"] = 1.0, True

    def _decide(self, *, begins: bool) -> None:
        if self.steersman is not None:
            self._order = self.believer.order(self.steersman.act(self.observation, begins=begins))

    def _forget(self, end: float) -> None:
        """Drop what nothing that may still come can refer to."""
        oldest = end - self.late - self.time_step
        first = bisect.bisect_right(self._poses, oldest, key=lambda pose: pose.time) - 1
        del self._poses[: max(first, 0)]
        for times in self._heard:
            del times[: bisect.bisect_left(times, oldest - SAME_PING)]

    def _estimate(self, place: int, now: float) -> Estimate:
        belief, worlds = self.believer.filters[place], self.believer.worlds
        x, y = self.conventions.place_out(*map(float, belief.mean[0]))
        best_x, best_y = self.conventions.place_out(*map(float, belief.estimate[0]))
        covariance = belief.covariance[0]
        arrival = float(worlds.listeners["arrival"][0, 0, place, 0])
        spread = math.sqrt(float(np.linalg.eigvalsh(covariance)[-1]))
        return Estimate(
            tag=self.tags[place], time=now, x=x, y=y, covariance=covariance, best_x=best_x, best_y=best_y,
            heard=self._start + arrival, lost=math.isnan(arrival) or spread > self.task.scenario.lost_error,
        )  # fmt: skip


def _number(value: Any, what: str, *, least: float = -math.inf, most: float = math.inf) -> float:
    """A number that can be meant. Raises ValueError that names the value."""
    try:
        found = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{what} must be a number, got {value!r:.60}") from None
    require_sensible(found, what)
    if not least <= found <= most:
        raise ValueError(f"{what} must be from {least:g} to {most:g}, got {found:g}")
    return found


def _told_as(reading: str) -> str:
    """What logs call a sensor's reading."""
    return next((name for name, own in SYNONYMS.items() if own == reading), reading)
