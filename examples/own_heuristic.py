"""A controller of one's own: it sails past the estimate and turns back, again and again.

    tagtrack eval benchmark --env LeopardShark-v0 --policies three_step circle own_heuristic:Zigzag
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tagtrack.baselines.heuristic import Heuristic


class Side(NamedTuple):
    """What it remembers of each world, (B,): the side to which it passes."""

    sign: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Zigzag(Heuristic):
    turn_at: float = 25.0  # distance from the estimate at which it turns back [m]

    def begin(self, sighting):
        return Side(sign=np.ones(len(sighting.distance)))

    def choose(self, sighting, memory):
        """Course relative to the line to the estimate [rad], share of full speed, and the memory of the next step."""
        sign = np.where(sighting.distance > self.turn_at, -memory.sign, memory.sign)
        course = np.where(sighting.distance > self.turn_at, 0.0, sign * 0.6)
        return course, np.ones_like(course), Side(sign=sign)
