"""What all hand-written policies share: reading an observation in SI units, keeping a memory, and giving an action.

A heuristic says which course to hold, relative to the line from the vehicle to the estimate, and how fast to go;
``Heuristic.predict`` turns that into the seam of Stable-Baselines3 (``policies.protocol.Policy``).
"""

from __future__ import annotations

import abc
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from tagtrack.baselines.surroundings import Surroundings, read_surroundings
from tagtrack.envs.frame import Frame
from tagtrack.envs.layout import blocks
from tagtrack.envs.observation import SILENCE_SCALE
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.validation import require, settle_numbers


class Sighting(NamedTuple):
    """What heuristics use of an observation: one tag as the vehicle believes it, of several the nearest. Each is (B,) float64.

    There is a row for each vehicle of each world: B of them are B / V worlds.
    """

    distance: np.ndarray  # to the estimate [m]
    bearing: np.ndarray  # of it relative to the compass heading [rad], positive to port
    heading: np.ndarray  # by the compass [rad]
    silence: np.ndarray  # time since the last detection [s]
    ping_phase: np.ndarray  # time since the tag last pinged, as a share of its period (of random intervals: see the feature)
    tag: np.ndarray  # (B,) int: which tag it is
    vehicle: np.ndarray  # (B,) int: whose sighting it is
    observation: np.ndarray  # (B, D) what all this was read from

    @property
    def line(self) -> np.ndarray:
        """Absolute bearing of the estimate [rad]."""
        return self.heading + self.bearing  # both as the compass has it, so that its error cancels


def wrap_angles(angle: np.ndarray) -> np.ndarray:
    """The same angles within [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, kw_only=True, eq=False)
class Heuristic(abc.ABC):
    """A hand-written policy for the vehicles of one scenario; with several tags it tracks the nearest, as the vehicle believes.

    Of a fleet each row is one vehicle's: row b * V + v is vehicle v of world b, and knows what that vehicle observes, no more.

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
        """Choose the action of each vehicle (see ``policies.protocol.Policy``; ``deterministic`` changes nothing).

        Raises:
            ValueError: for an observation of another layout or of half a fleet, or a state of another number of rows.
        """
        sighting = self._read(np.atleast_2d(np.asarray(observation)))
        memory = self._recall(sighting, state, episode_start)
        course, speed, memory = self.choose(sighting, memory)
        action = self._encode(course, speed, sighting)
        return (action[0] if np.ndim(observation) == 1 else action), memory or None

    def look_around(self, sighting: Sighting) -> Surroundings:
        """All tags and teammates of a sighting."""
        return read_surroundings(sighting.observation, self.scenario)

    def look_at(self, sighting: Sighting, tag: np.ndarray) -> Sighting:
        """The same for other tags, (B,) int."""
        return self._sight(sighting.observation, tag)

    def _encode(self, course: np.ndarray, speed: np.ndarray, sighting: Sighting) -> np.ndarray:
        """The action of a course relative to the line to the tag that is sighted; a message is always sent."""
        scenario = self.scenario
        if scenario.frame == Frame.HEADING:
            course = course + sighting.bearing
        elif scenario.frame == Frame.LINE and scenario.targets > 1:
            first = self._sight(sighting.observation, np.zeros_like(sighting.tag))
            course = course + (sighting.bearing - first.bearing)
        components = [np.cos(course), np.sin(course)]
        if scenario.speed_control:
            components.append(2.0 * speed - 1.0)
        if scenario.frame == Frame.CHOSEN:
            components += [np.where(sighting.tag == tag, 1.0, -1.0) for tag in range(scenario.targets)]
        if scenario.message_control:
            components.append(np.ones_like(course))
        return np.stack(components, axis=-1).astype(np.float32)

    def _recall(self, sighting: Sighting, state: Any, episode_start: np.ndarray | None) -> Any:
        fresh = self.begin(sighting)
        if state is None or not fresh:
            return fresh
        rows = len(sighting.distance)
        if len(state[0]) != rows:
            raise ValueError(f"the state is of {len(state[0])} rows, the observation of {rows}")
        if episode_start is None:
            return state
        begins = np.broadcast_to(np.asarray(episode_start, bool), rows)
        return type(state)(*(np.where(begins, new, old) for new, old in zip(fresh, state, strict=True)))

    @cached_property
    def _places(self) -> Mapping[str, np.ndarray]:
        """Where each feature of the tags, (T,) int, and of the vehicle itself, (1,), stands in the observation."""
        parts = blocks(self.scenario)
        tags, own = parts[: self.scenario.targets], parts[-1]
        places = {f.name: np.array([tag.first + k for tag in tags]) for k, f in enumerate(tags[0].features)}
        return places | {f.name: np.array([own.first + k]) for k, f in enumerate(own.features)}

    def _read(self, rows: np.ndarray) -> Sighting:
        """What is seen of the nearest tag, given (B, D)."""
        width = blocks(self.scenario)[-1].places.stop
        if rows.ndim != 2 or rows.shape[1] != width:
            raise ValueError(f"observations must have shape (B, {width}), got {rows.shape}")
        if len(rows) % self.scenario.vehicles:
            fleet = self.scenario.vehicles
            raise ValueError(f"observations must be of whole fleets, {fleet} rows for each world, got {len(rows)} rows")
        if self.scenario.targets == 1:
            return self._sight(rows, np.zeros(len(rows), np.int64))
        return self._sight(rows, rows[:, self._places["distance"]].argmin(axis=1))

    def _sight(self, rows: np.ndarray, tag: np.ndarray) -> Sighting:
        each = np.arange(len(rows))

        def column(name: str) -> np.ndarray:
            places = self._places[name]
            return rows[each, places[tag if len(places) > 1 else 0]].astype(np.float64)

        return Sighting(
            distance=self.scenario.scale.length * column("distance"),
            bearing=np.arctan2(column("bearing_sin"), column("bearing_cos")),
            heading=np.arctan2(column("heading_sin"), column("heading_cos")),
            silence=np.expm1(SILENCE_SCALE * column("silence")),
            ping_phase=np.maximum(column("ping_phase"), 0.0),  # of a tag that was never heard: as if it had just pinged
            tag=tag,
            vehicle=each % self.scenario.vehicles,
            observation=rows,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class InformedHeuristic(Heuristic):
    """A heuristic that knows more than the observation: row b * V + v of what it is asked must be vehicle v of world b.

    One that has been written for fleets says so by ``fleets``; others are refused several vehicles or tags.
    """

    fleets: ClassVar[bool] = False
    simulation: Simulation
    scenario: Scenario = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "scenario", self.simulation.scenario)
        super().__post_init__()
        v, t = self.scenario.vehicles, self.scenario.targets
        if not self.fleets and (v > 1 or t > 1):
            rule = "for one vehicle and one tag (unless its class says fleets = True)"
            raise ValueError(f"{type(self).__name__} is {rule}, got vehicles={v}, tags={t}")

    def _read(self, rows: np.ndarray) -> Sighting:
        sighting = super()._read(rows)
        if len(rows) != self.simulation.num_worlds * self.scenario.vehicles:
            of = f" of {self.scenario.vehicles} vehicles" if self.scenario.vehicles > 1 else ""
            raise ValueError(f"observations must be of all {self.simulation.num_worlds} worlds{of}, got {len(rows)}")
        return sighting


def require_stopping(policy: Any) -> None:
    """Raise ``ValueError`` where a policy should stop at its perimeter, but the scenario leaves it no choice of speed."""
    require(policy.perimeter >= 0, policy, "perimeter", "at least 0")
    rule = "0 (the scenario has no speed control, so the vehicle cannot stop)"
    require(policy.scenario.speed_control or policy.perimeter == 0, policy, "perimeter", rule)
