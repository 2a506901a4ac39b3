"""The rollout planner: what would a circle gain by another move now? Slow, and there to show that something is left above it.

At each decision a few courses are held for five pings in imagined futures (``futures``), the circle steers on, and the move that
costs least is made (Bertsekas & Castanon 1999, J. Heuristics 5, 89).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tagtrack.baselines.circle import Circle
from tagtrack.baselines.futures import HELD, HORIZON, Aim, Futures, better_move, steps_of
from tagtrack.baselines.heuristic import InformedHeuristic, Sighting
from tagtrack.envs.validation import require

LARGEST = 4096


class Move(NamedTuple):
    """What each row does, each (B,), and what the circle remembers."""

    angle: np.ndarray  # off the line to the estimate [rad]; NaN: as the circle would
    age: np.ndarray  # steps since it was chosen
    circle: Any


@dataclass(frozen=True, kw_only=True, eq=False)
class Rollout(InformedHeuristic):
    """Makes the move after which a circle would lead to the least error, by imagined futures."""

    radius: float = 9.0  # of the circle [m]
    futures: int = 128  # of each move
    _circle: Circle = field(init=False, repr=False)
    _futures: Futures = field(init=False, repr=False)
    _imagined: Circle = field(init=False, repr=False)
    _aim: Aim = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.radius > 0, self, "radius", "positive")
        even = f"an even number from 2 to {LARGEST}"
        require(2 <= self.futures <= LARGEST and self.futures % 2 == 0, self, "futures", even)
        futures = Futures(self.simulation, futures=int(self.futures))
        made = {
            "_circle": Circle(scenario=self.scenario, radius=self.radius),
            "_futures": futures,
            "_imagined": Circle(scenario=futures.scenario, radius=self.radius),
            "_aim": Aim(scenario=self.scenario),
        }
        for name, part in made.items():
            object.__setattr__(self, name, part)

    def choose(self, sighting: Sighting, memory: Any) -> tuple[np.ndarray, np.ndarray, Any]:
        """What the circle would do."""
        return self._circle.choose(sighting, memory)

    def predict(
        self,
        observation: np.ndarray,
        state: Any = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = False,
    ) -> tuple[np.ndarray, Any]:
        """As ``Policy.predict`` says; row b is world b of the simulation."""
        rows = np.asarray(observation)
        starts = np.zeros(len(rows), bool) if state is not None else np.ones(len(rows), bool)
        if episode_start is not None:
            starts = starts | np.broadcast_to(np.asarray(episode_start, bool), len(rows))
        memory = None if state is None else state.circle
        action, circle = self._circle.predict(rows, memory, starts, deterministic)
        held, horizon = steps_of(self.scenario, HELD), steps_of(self.scenario, HORIZON)
        angle = np.full(len(rows), np.nan) if state is None else state.angle.copy()
        age = np.full(len(rows), held) if state is None else np.where(starts, held, state.age)
        for world in np.flatnonzero(age >= held).tolist():
            left = self.scenario.episode_steps - int(self.simulation.worlds.clock["step"][world])
            before = circle if starts[world] else memory
            cost = self._futures.play(self._imagined, before, world, 0, held=held, steps=max(1, min(horizon, left)))
            move = better_move(cost)
            angle[world] = np.nan if move == 0 else self._futures.angles[move - 1]
            age[world] = 0
        own = np.isnan(angle)
        none = np.full(len(rows), -1)
        asked = self._aim.steer(rows, np.array(action), np.nan_to_num(angle), none)
        return np.where(own[:, None], action, asked).astype(np.float32), Move(angle=angle, age=age + 1, circle=circle)
