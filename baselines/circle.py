"""Circling: a view that keeps changing tells port from starboard and crosses bearings, where driving at the fish does not.

The circle is about the mean of the belief or, for an oracle, about the true fish. By ``tagtrack eval tune --policy circle`` the
mean error in LeopardShark-v0 is least at 9 m, 5.4 m, and within 0.2 m of it from 5 to 12 m; tune it anew for other tasks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from tagtrack.baselines.formation import crowding, give_way, keep_to_own_circle
from tagtrack.baselines.heuristic import Heuristic, InformedHeuristic, Sighting
from tagtrack.baselines.sharing import assign_jointly
from tagtrack.baselines.surroundings import Surroundings
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.validation import require


def circling_course(distance: np.ndarray, radius: np.ndarray | float, scenario: Scenario) -> np.ndarray:
    """Course that leads onto a circle, with its centre to starboard: straight in from afar, along the tangent on it.

    P control lags a turning course by turn rate / gain, and the tangent turns on while a course is held: it leads by as much.

    Args:
        distance: (B,) to the centre [m]. radius: of the circle [m]. scenario: whose vehicle is steered.
    Returns:
        (B,) course relative to the line to the centre [rad].
    """
    vehicle = scenario.vehicle
    course = 0.5 * math.pi - np.arctan(2.0 * (distance - radius) / radius)
    turn_rate = np.minimum(vehicle.max_speed / np.maximum(distance, 1e-3), vehicle.max_turn_rate)
    held_over = max(0.0, scenario.time_step - vehicle.control_interval)
    return course - turn_rate * (1.0 / vehicle.heading_gain + 0.5 * held_over)


@dataclass(frozen=True, kw_only=True, eq=False)
class Circling(Heuristic):
    """Base of those that circle an estimate, several vehicles about one tag at equal angles."""

    radius: float = 9.0  # [m]
    radius_step: float = 0.0  # by which the circle of each vehicle is wider than that of the one before [m]
    spacing: float = 0.3  # share by which the radius, or the speed where it can be chosen, changes to keep teammates apart

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.radius > 0, self, "radius", "positive")
        require(self.radius_step >= 0, self, "radius_step", "at least 0")
        require(0 <= self.spacing < 1, self, "spacing", "at least 0 and below 1")

    def circle(self, sighting: Sighting) -> tuple[np.ndarray, np.ndarray]:
        """Course relative to the line to the tag sighted [rad] and share of the largest speed, each (B,)."""
        if self.scenario.vehicles == 1:
            course = circling_course(sighting.distance, self.radius, self.scenario)
            return course, np.ones_like(course)
        around = self.look_around(sighting)
        centre = around.tags[np.arange(len(sighting.tag)), sighting.tag]
        places = keep_to_own_circle(around.places, around.tags, sighting.tag)
        return self.go_round(sighting.distance, centre, around._replace(places=places), sighting.vehicle)

    def go_round(
        self, distance: np.ndarray, centre: np.ndarray, around: Surroundings, vehicle: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same about any centre (B, 2), ``distance`` (B,) away [m], at equal angles to those whose places are given."""
        crowded = crowding(centre, around.places, around.speed * around.age, vehicle)
        radius, speed = give_way(self.radius + self.radius_step * vehicle, crowded, self.spacing, self.scenario)
        return circling_course(distance, radius, self.scenario), speed


@dataclass(frozen=True, kw_only=True, eq=False)
class Circle(Circling):
    """Circles the estimate at full speed, of several tags that of the nearest or, if told so, the middle of all.

    Vehicles about the same tag keep equal angles between them, with ``radius_step`` on circles of their own (Shinzaki et al.
    2013, whose vehicles sail about the estimate on circles of several radii and phases).
    """

    centroid: int = 0  # 1: about the middle of all tags' estimates, for which the radius has to be a wider one

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.centroid in (0, 1), self, "centroid", "0 or 1")

    def choose(self, sighting: Sighting, memory: Any) -> tuple[np.ndarray, np.ndarray, Any]:
        if not self.centroid or self.scenario.targets == 1:
            return *self.circle(sighting), memory
        around = self.look_around(sighting)
        centre = around.tags.mean(axis=1)
        course, speed = self.go_round(np.hypot(centre[:, 0], centre[:, 1]), centre, around, sighting.vehicle)
        return course + np.arctan2(centre[:, 1], centre[:, 0]) - sighting.bearing, speed, memory


@dataclass(frozen=True, kw_only=True, eq=False)
class OracleCircle(InformedHeuristic):
    """Circles the true fish at full speed, which no policy can, for none knows where the fish is.

    Of several fish each vehicle takes one, so that the ways are the shortest in sum; of more fish than vehicles some stay alone.

    It tells what nearness alone is worth, and bounds nothing: where the belief is far off, it is the belief's mistake that other
    policies go and disprove.
    """

    fleets: ClassVar[bool] = True
    radius: float = 10.0  # [m]
    spacing: float = 0.3  # as ``circle`` has it

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.radius > 0, self, "radius", "positive")
        require(0 <= self.spacing < 1, self, "spacing", "at least 0 and below 1")

    def choose(self, sighting: Sighting, memory: Any) -> tuple[np.ndarray, np.ndarray, Any]:
        away, radius, speed = self._centre(sighting.vehicle)
        distance = np.hypot(away[:, 0], away[:, 1])
        course = circling_course(distance, radius, self.scenario)
        course += np.arctan2(away[:, 1], away[:, 0]) - sighting.line
        return course, speed, memory

    def _centre(self, vehicle: np.ndarray) -> tuple[np.ndarray, np.ndarray | float, np.ndarray]:
        """Where its fish is from each vehicle, (B, 2) [m], radius [m] and share of the largest speed."""
        fish, places = self.simulation.fish_position, self.simulation.vehicle_position
        if self.scenario.vehicles == self.scenario.targets == 1:
            return fish[:, 0] - places[:, 0], self.radius, np.ones(len(vehicle))
        fleet = self.scenario.vehicles
        fish, mates = np.repeat(fish.astype(np.float64), fleet, axis=0), np.repeat(places, fleet, axis=0)
        away = fish[:, None] - mates[:, :, None]
        rows, tag = np.arange(len(vehicle)), assign_jointly(-np.hypot(away[..., 0], away[..., 1]), vehicle)
        crowded = crowding(fish[rows, tag], keep_to_own_circle(mates, fish, tag), np.zeros(mates.shape[:2]), vehicle)
        radius, speed = give_way(np.full(len(vehicle), self.radius), crowded, self.spacing, self.scenario)
        return away[rows, vehicle, tag], radius, speed
