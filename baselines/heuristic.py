"""What all hand-written policies share: reading an observation in SI units, keeping a memory, and giving an action.

A heuristic says which course to hold, relative to the line from the vehicle to the estimate, and how fast to go;
``Heuristic.predict`` turns that into the seam of Stable-Baselines3 (``policies.protocol.Policy``).
"""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tagtrack.envs.frame import Frame
from tagtrack.envs.layout import feature_names
from tagtrack.envs.observation import SILENCE_SCALE
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.validation import require, settle_numbers


class Sighting(NamedTuple):
    """What heuristics use of an observation: the first tag as the vehicle believes it. Each is (B,) float64."""

    distance: np.ndarray  # to the estimate [m]
    bearing: np.ndarray  # of it relative to the compass heading [rad], positive to port
    heading: np.ndarray  # by the compass [rad]
    silence: np.ndarray  # time since the last detection [s]
    ping_phase: np.ndarray  # time since the tag last pinged, as a share of its period (of random intervals: see the feature)

    @property
    def line(self) -> np.ndarray:
        """Absolute bearing of the estimate [rad]."""
        return self.heading + self.bearing  # both as the compass has it, so that its error cancels


def wrap_angles(angle: np.ndarray) -> np.ndarray:
    """The same angles within [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, kw_only=True, eq=False)
class Heuristic(abc.ABC):
    """A hand-written policy for the vehicles of one scenario; with several tags it tracks the first.

    Raises:
        ValueError: for a parameter out of its range, naming the value.
    """

    scenario: Scenario

    def __post_init__(self) -> None:
        settle_numbers(self)

    @abc.abstractmethod
    def choose(self, sighting: Sighting, memory: Any) -> tuple[np.ndarray, np.ndarray, Any]:
        """Course relative to the line [rad] and share of the largest speed, each (B,), and the memory for the next step.

        Where the scenario has no speed control the vehicle goes at full speed whatever the share.
        """

    def begin(self, sighting: Sighting) -> tuple[np.ndarray, ...]:
        """The memory at the first observation of an episode, a NamedTuple of arrays (B, ...); empty where none is needed."""
        return ()

    def predict(
        self,
        observation: np.ndarray,
        state: Any = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = False,
    ) -> tuple[np.ndarray, Any]:
        """Choose the action of each world (see ``policies.protocol.Policy``; ``deterministic`` changes nothing).

        Raises:
            ValueError: for an observation of another layout, or a state of another number of worlds.
        """
        sighting = self._read(np.atleast_2d(np.asarray(observation)))
        memory = self._recall(sighting, state, episode_start)
        course, speed, memory = self.choose(sighting, memory)
        if self.scenario.frame == Frame.HEADING:
            course = course + sighting.bearing
        components = [np.cos(course), np.sin(course)]
        if self.scenario.speed_control:
            components.append(2.0 * speed - 1.0)
        action = np.stack(components, axis=-1).astype(np.float32)
        return (action[0] if np.ndim(observation) == 1 else action), memory or None

    def _recall(self, sighting: Sighting, state: Any, episode_start: np.ndarray | None) -> Any:
        fresh = self.begin(sighting)
        if state is None or not fresh:
            return fresh
        rows = len(sighting.distance)
        if len(state[0]) != rows:
            raise ValueError(f"the state is of {len(state[0])} worlds, the observation of {rows}")
        if episode_start is None:
            return state
        begins = np.broadcast_to(np.asarray(episode_start, bool), rows)
        return type(state)(*(np.where(begins, new, old) for new, old in zip(fresh, state, strict=True)))

    @cached_property
    def _columns(self) -> dict[str, int]:
        """Index of each feature in the observation; where there are several tags, the first one's under their plain names."""
        names = feature_names(self.scenario)
        return {name.removeprefix("tag_0."): index for index, name in enumerate(names)}

    def _read(self, rows: np.ndarray) -> Sighting:
        if rows.ndim != 2 or rows.shape[1] != len(self._columns):
            raise ValueError(f"observations must have shape (B, {len(self._columns)}), got {rows.shape}")

        def column(name: str) -> np.ndarray:
            return rows[:, self._columns[name]].astype(np.float64)

        return Sighting(
            distance=self.scenario.scale.length * column("distance"),
            bearing=np.arctan2(column("bearing_sin"), column("bearing_cos")),
            heading=np.arctan2(column("heading_sin"), column("heading_cos")),
            silence=np.expm1(SILENCE_SCALE * column("silence")),
            ping_phase=np.maximum(column("ping_phase"), 0.0),  # of a tag that was never heard: as if it had just pinged
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class InformedHeuristic(Heuristic):
    """A heuristic that knows more than the observation: row b of what it is asked must be world b of ``simulation``."""

    simulation: Simulation
    scenario: Scenario = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "scenario", self.simulation.scenario)
        super().__post_init__()
        if self.scenario.vehicles != 1:
            raise ValueError(f"{type(self).__name__} steers one vehicle, got a simulation of {self.scenario.vehicles}")

    def _read(self, rows: np.ndarray) -> Sighting:
        sighting = super()._read(rows)
        if len(rows) != self.simulation.num_worlds:
            raise ValueError(f"observations must be of all {self.simulation.num_worlds} worlds, got {len(rows)}")
        return sighting


def require_stopping(policy: Any) -> None:
    """Raise ``ValueError`` where a policy should stop at its perimeter, but the scenario leaves it no choice of speed."""
    require(policy.perimeter >= 0, policy, "perimeter", "at least 0")
    rule = "0 (the scenario has no speed control, so the vehicle cannot stop)"
    require(policy.scenario.speed_control or policy.perimeter == 0, policy, "perimeter", rule)
