"""A greedy planner: the course whose next pings are expected to tell most about where the fish is.

It reads the particles, so it is given the simulation when it is made. Of receiver and water it assumes what the scenario says
of them on average; whether a burst of losses is on it does not know, nor where the fish is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from tagtrack.baselines.division import Duty
from tagtrack.baselines.heuristic import InformedHeuristic, Sighting, wrap_angles
from tagtrack.baselines.information_loops import add_up_information
from tagtrack.baselines.particle_sample import sample_particles
from tagtrack.baselines.reading_tables import ReadingTables, tabulate_readings
from tagtrack.baselines.sharing import choose_in_turn, rate_tags
from tagtrack.envs.sim.vehicle import Vehicle
from tagtrack.envs.validation import require

LARGEST = 10_000  # pings, courses or particles: more would take for ever
INTRUSION_COST = 1000.0  # nats per metre, so that a perimeter outweighs any information


class Plan(NamedTuple):
    """The course each vehicle holds and the tag it is for, each (B,)."""

    course: np.ndarray  # absolute [rad]
    age: np.ndarray  # time since it was chosen [s]; infinite before the first
    tag: np.ndarray  # int
    tag_age: np.ndarray  # time since the tag was chosen [s]


class Poses(NamedTuple):
    """Where vehicles expect to be, each (B, K, S): B worlds, K candidate courses, S steps."""

    x: np.ndarray  # [m]
    y: np.ndarray  # [m]
    heading: np.ndarray  # [rad]


@dataclass(frozen=True, kw_only=True, eq=False)
class Information(InformedHeuristic):
    """Takes, of ``courses`` evenly spaced ones, the one with the highest expected mutual information (greedy).

    Summed over the next ``horizon`` pings; each counts by itself, so that what two pings tell alike counts twice. Simplified: the
    particles rest meanwhile; of a stereo hydrophone, with or without ranges, only the bearing counts; silence tells nothing,
    because the filter does not weigh by it, unless the receiver is one of presence. Of the courses that keep out of the perimeter
    the best is taken; failing these the one that intrudes least.

    Of a fleet each vehicle plans alone on its own belief, or the shared one, about the tag that ``uncertain`` would give it: as
    each ping counts by itself, what teammates hear adds the same to all courses.
    """

    fleets: ClassVar[bool] = True
    horizon: int = 12  # pings: fewer end within the turn, more change nothing (LeopardShark-v0, tuning episodes)
    hold: float = 4.0  # time for which a course is held [s]
    courses: int = 12  # K
    sample: int = 64  # particles that stand for all
    perimeter: float = 0.0  # about the mean of the belief [m]; 0: none
    watch: float = 12.0  # time for which a tag is held, where there are several [s]
    per_metre: float = 0.2  # metres of spread that outweigh a metre of way, where a tag is chosen
    _tables: ReadingTables = field(init=False, repr=False)
    _entropy: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("horizon", "courses", "sample"):
            require(1 <= getattr(self, name) <= LARGEST, self, name, f"a whole number of at least 1 and at most {LARGEST}")
        require(self.hold > 0, self, "hold", "positive")
        require(self.watch > 0, self, "watch", "positive")
        for name in ("perimeter", "per_metre"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        tables = tabulate_readings(self.scenario.belief, self.scenario.water)
        likelihood = tables.likelihood
        object.__setattr__(self, "_tables", tables)
        object.__setattr__(self, "_entropy", -(likelihood * np.log(np.maximum(likelihood, 1e-30))).sum(axis=1))

    def begin(self, sighting: Sighting) -> Plan:
        never = np.full(len(sighting.line), np.inf)
        return Plan(course=sighting.line, age=never, tag=sighting.tag, tag_age=never)

    def choose(self, sighting: Sighting, memory: Plan) -> tuple[np.ndarray, np.ndarray, Plan]:
        duty = self._renew(sighting, Duty(memory.tag, memory.tag_age))
        watched = self.look_at(sighting, duty.tag) if self.scenario.targets > 1 else sighting
        over = (memory.age > self.hold - 1e-6) | (duty.tag != memory.tag)
        course = memory.course
        if over.any():
            rows = np.flatnonzero(over)
            course = course.copy()
            course[rows] = self._plan(rows, duty.tag[rows], watched.line[rows], watched.ping_phase[rows])
        age = np.where(over, 0.0, memory.age) + self.scenario.time_step
        return course - sighting.line, np.ones_like(course), Plan(course, age, duty.tag, duty.age)

    def _renew(self, sighting: Sighting, duty: Duty) -> Duty:
        """The tags of this step, chosen anew where they have been held long enough."""
        over = duty.age > self.watch - 1e-6
        tag = duty.tag
        if over.any() and self.scenario.targets > 1:
            value = rate_tags(self.look_around(sighting), self.per_metre)
            tag = np.where(over, choose_in_turn(value, sighting.vehicle), tag)
        return Duty(tag=tag, age=np.where(over, 0.0, duty.age) + self.scenario.time_step)

    def _belief_of(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """World, vehicle and owner of the belief of some rows, each (R,)."""
        world, vehicle = np.divmod(rows, self.scenario.vehicles)
        return world, vehicle, vehicle if self.scenario.owners > 1 else np.zeros_like(vehicle)

    def _plan(self, rows: np.ndarray, tags: np.ndarray, line: np.ndarray, ping_phase: np.ndarray) -> np.ndarray:
        """The best course (R,) [rad] for some of the vehicles, given the tag of each (R,)."""
        world, vehicle, owner = self._belief_of(rows)
        candidates = line[:, None] + np.arange(self.courses) * (2.0 * math.pi / self.courses)
        tag = self.scenario.tag
        periods = max((tag.period + 0.5 * tag.random_delay) / self.scenario.time_step, 1.0)  # at most one reading a step
        track = expect_track(
            self.simulation.worlds.navigation[world, vehicle],
            candidates,
            self.scenario.vehicle,
            self.scenario.time_step,
            steps=math.ceil(self.horizon * periods),
        )
        # Readings are taken at the end of the step in which the tag pings; phase and rounding must not make that the next one.
        pings = (1.0 - ping_phase[:, None] + np.arange(self.horizon)) * periods
        at_ping = np.maximum(np.ceil(pings - 1e-4).astype(np.int64) - 1, 0)[:, None, :]
        value = self._expect_information(rows, tags, Poses(*(np.take_along_axis(part, at_ping, axis=2) for part in track)))
        belief = self.simulation.mean[world, owner, tags]
        distance = np.hypot(track.x - belief[:, 0, None, None], track.y - belief[:, 1, None, None])
        value = value - INTRUSION_COST * np.maximum(self.perimeter - distance, 0.0).mean(axis=2)
        return np.take_along_axis(candidates, value.argmax(axis=1)[:, None], axis=1)[:, 0]

    def _expect_information(self, rows: np.ndarray, tags: np.ndarray, poses: Poses) -> np.ndarray:
        """(R, K) expected information [nats] of pings heard at ``poses`` (R, K, P)."""
        particles = self.simulation.worlds.particles
        world, vehicle, owner = self._belief_of(rows)
        chosen = sample_particles(self.simulation.worlds, world, owner, tags, self.sample)
        x, y = (particles[world[:, None], owner[:, None], tags[:, None], axis, chosen] for axis in (0, 1))
        ahead = (poses.x, poses.y, np.cos(poses.heading), np.sin(poses.heading))
        depth = self.simulation.listeners["depth"][world, vehicle, tags]
        # The tables are of the number assumed, the belief may know better.
        offset = self.scenario.belief.receiver.assumed - self.simulation.worlds.beliefs["estimated"][world, owner, tags]
        information = np.zeros(poses.x.shape[:2], np.float32)
        add_up_information(
            *(part.astype(np.float32) for part in (x, y, *ahead, depth, offset)),
            self._tables.chance, self._tables.likelihood, self._entropy, self._tables.by_distance,
            np.empty(self._tables.likelihood.shape[1], np.float32), information,
        )  # fmt: skip
        return information.astype(np.float64)


def expect_track(vehicles: np.ndarray, courses: np.ndarray, vehicle: Vehicle, time_step: float, steps: int) -> Poses:
    """Where vehicles expect to be after 1, 2 ... steps at full speed on each course: ``hold_course`` without noise or current.

    Args:
        vehicles: (B,) of dtype ``NAVIGATION``. courses: (B, K) absolute [rad].
    """
    shape = courses.shape
    x, y, heading, speed = (
        np.broadcast_to(vehicles[name][:, None], shape) for name in ("x", "y", "heading", "speed")
    )
    track = Poses(*(np.empty((*shape, steps)) for _ in range(3)))
    ticks = max(1, round(time_step / vehicle.control_interval))
    tick = time_step / ticks
    for s in range(steps):
        for _ in range(ticks):
            turn_rate = vehicle.heading_gain * wrap_angles(courses - heading)
            turn = tick * np.clip(turn_rate, -vehicle.max_turn_rate, vehicle.max_turn_rate)
            speed = np.minimum(speed + vehicle.acceleration * tick, vehicle.max_speed)
            x = x + speed * tick * np.cos(heading + 0.5 * turn)
            y = y + speed * tick * np.sin(heading + 0.5 * turn)
            heading = heading + turn
        for part, value in zip(track, (x, y, heading), strict=True):
            part[:, :, s] = value
    return track
