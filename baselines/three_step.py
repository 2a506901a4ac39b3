"""The controller of Clark et al. 2013: three headings in turn, from which the two sides of a bearing can be told apart.

Section 4.2 and Eqs. 11-12; the perimeter is section 6.1's, the search section 8's, of which the paper gives no numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tagtrack.baselines.circle import circling_course
from tagtrack.baselines.heuristic import Heuristic, Sighting, require_stopping, wrap_angles
from tagtrack.envs.validation import require

STEP_ANGLES = np.array([math.pi / 4, -math.pi / 4, 0.0])  # gamma of Eq. 12 [rad]


class Cycle(NamedTuple):
    """Where each vehicle is in its cycle of steps, each (B,)."""

    step: np.ndarray  # 0, 1 or 2
    line: np.ndarray  # beta_0, the absolute bearing of the belief at the start of step 0 [rad]


@dataclass(frozen=True, kw_only=True, eq=False)
class ThreeStep(Heuristic):
    """Steers 45 degrees to port of the belief, 45 degrees to starboard and straight, each until the heading is within ``tau``.

    Where the speed can be chosen, it lies motionless, its heading as it is, within ``perimeter`` of the belief's mean. After a
    silence it circles where the belief is, ever wider, until the next detection. After either it begins with step 0.
    """

    # Tolerance on the heading [rad], in degrees where it is given as text. The paper leaves it open. Mean errors in
    # LeopardShark-v0 by `tagtrack eval tune --policy three_step`: 8.1 m at 5 degrees, 7.4 at 10, 6.7 at 20, 6.5 at 30, 6.3 at
    # 45. A smaller one spends its time on the last degrees of a turn, away from the fish. Beyond 45 degrees the steps end
    # before they are steered and the controller fades into pursuit (5.75 m at 90, as ``pursuit`` itself).
    tau: float = field(default=math.radians(45.0), metadata={"from_text": math.radians})
    perimeter: float = 0.0  # [m]; 0: none
    patience: float = 30.0  # silence that starts the search [s]: the longest gap that is part of normal tracking (6.2)
    search_growth: float = 0.2  # of the search circle's radius [m/s]

    def __post_init__(self) -> None:
        super().__post_init__()
        require(0 < self.tau <= math.pi, self, "tau", "more than 0 and at most 180 degrees")
        require(self.patience > 0, self, "patience", "positive")
        require(self.search_growth >= 0, self, "search_growth", "at least 0")
        require_stopping(self)

    def begin(self, sighting: Sighting) -> Cycle:
        return Cycle(step=np.zeros(len(sighting.line), np.int64), line=sighting.line)

    def choose(self, sighting: Sighting, memory: Cycle) -> tuple[np.ndarray, np.ndarray, Cycle]:
        searching = sighting.silence > self.patience
        near = (sighting.distance < self.perimeter) & ~searching
        cycle = self._advance(memory, sighting, interrupted=searching | near)
        course = cycle.line + STEP_ANGLES[cycle.step] - sighting.line
        course = np.where(searching, self._search(sighting), course)
        course = np.where(near, -sighting.bearing, course)
        return course, np.where(near, 0.0, 1.0), cycle

    def _advance(self, cycle: Cycle, sighting: Sighting, interrupted: np.ndarray) -> Cycle:
        """The next step where the heading is reached; beta_0 is taken anew at the start of step 0."""
        error = wrap_angles(cycle.line + STEP_ANGLES[cycle.step] - sighting.heading)
        reached = np.abs(error) < self.tau
        step = np.where(reached, (cycle.step + 1) % len(STEP_ANGLES), cycle.step)
        step = np.where(interrupted, 0, step)
        anew = (reached & (step == 0)) | interrupted
        return Cycle(step=step, line=np.where(anew, sighting.line, cycle.line))

    def _search(self, sighting: Sighting) -> np.ndarray:
        vehicle = self.scenario.vehicle
        smallest = max(self.perimeter, vehicle.max_speed / vehicle.max_turn_rate)
        radius = smallest + self.search_growth * np.maximum(sighting.silence - self.patience, 0.0)
        return circling_course(sighting.distance, radius, self.scenario)
