"""Circling: a view that keeps changing tells port from starboard and crosses bearings, where driving at the fish does not.

The circle is about the mean of the belief or, for an oracle that bounds what circling can reach, about the true fish.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tagtrack.baselines.heuristic import Heuristic, InformedHeuristic, Sighting
from tagtrack.envs.sim.validation import require
from tagtrack.envs.sim.vehicle import Vehicle


def circling_course(distance: np.ndarray, radius: np.ndarray | float, vehicle: Vehicle) -> np.ndarray:
    """Course that leads onto a circle, with its centre to starboard: straight in from afar, along the tangent on it.

    Args:
        distance: (B,) to the centre [m]. radius: of the circle [m].
        vehicle: its P control lags a turning course by turn rate / gain, so the course leads by as much.
    Returns:
        (B,) course relative to the line to the centre [rad].
    """
    tangent = 0.5 * math.pi - np.arctan(2.0 * (distance - radius) / radius)
    turn_rate = np.minimum(vehicle.max_speed / np.maximum(distance, 1e-3), vehicle.max_turn_rate)
    return tangent - turn_rate / vehicle.heading_gain


@dataclass(frozen=True, kw_only=True, eq=False)
class Circle(Heuristic):
    """Circles the mean of the belief at full speed."""

    radius: float = 10.0  # [m]

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.radius > 0, self, "radius", "positive")

    def choose(self, sighting: Sighting, memory: Any) -> tuple[np.ndarray, np.ndarray, Any]:
        course = circling_course(sighting.distance, self.radius, self.scenario.vehicle)
        return course, np.ones_like(course), memory


@dataclass(frozen=True, kw_only=True, eq=False)
class OracleCircle(InformedHeuristic):
    """Circles the true fish at full speed: no policy can do this, for none knows where the fish is."""

    radius: float = 10.0  # [m]

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.radius > 0, self, "radius", "positive")

    def choose(self, sighting: Sighting, memory: Any) -> tuple[np.ndarray, np.ndarray, Any]:
        away = self.simulation.fish_position[:, 0] - self.simulation.vehicle_position[:, 0]
        distance = np.hypot(away[:, 0], away[:, 1])
        course = circling_course(distance, self.radius, self.scenario.vehicle)
        course += np.arctan2(away[:, 1], away[:, 0]) - sighting.line
        return course, np.ones_like(course), memory
