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
    """What each row does, each (B,)."""

    angle: np.ndarray  # off the line to the estimate [rad]; NaN: as the circle would
    age: np.ndarray  # steps since it was chosen


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
        """As ``Policy.predict`` says; row b is world b of the simulation, from whose state the futures begin."""
        rows = np.atleast_2d(np.asarray(observation))
        action, _ = self._circle.predict(rows)
        held, horizon = steps_of(self.scenario, HELD), steps_of(self.scenario, HORIZON)
        angle = np.full(len(rows), np.nan) if state is None else state.angle.copy()
        age = np.full(len(rows), held) if state is None else state.age.copy()
        if episode_start is not None:
            age[np.broadcast_to(np.asarray(episode_start, bool), len(rows))] = held
        clock = self.simulation.worlds.clock
        for world in np.flatnonzero(age >= held).tolist():
            step = int(clock["step"][world])
            left = max(1, min(horizon, self.scenario.episode_steps - step))
            key = (int(clock["seed"][world]), int(clock["episode"][world]), step)
            cost = self._futures.play(self._imagined, None, world, 0, held=held, steps=left, key=key)
            move = better_move(cost)
            angle[world] = np.nan if move == 0 else self._futures.angles[move - 1]
            age[world] = 0
        asked = self._aim.steer(rows, np.array(action), np.nan_to_num(angle), np.full(len(rows), -1))
        chosen = np.where(np.isnan(angle)[:, None], action, asked).astype(np.float32)
        return chosen if np.ndim(observation) > 1 else chosen[0], Move(angle=angle, age=age + 1)
