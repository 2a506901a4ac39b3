"""Policies that need no thought: chase, stay, wander. They tell what the others' figures are worth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tagtrack.baselines.heuristic import Heuristic, Sighting, require_stopping
from tagtrack.envs.validation import require


@dataclass(frozen=True, kw_only=True, eq=False)
class Pursuit(Heuristic):
    """Drives at the mean of the belief, always; where the speed can be chosen it stops within ``perimeter`` of it."""

    perimeter: float = 0.0  # [m]; 0: none

    def __post_init__(self) -> None:
        super().__post_init__()
        require_stopping(self)

    def choose(self, sighting: Sighting, memory: Any) -> tuple[np.ndarray, np.ndarray, Any]:
        near = sighting.distance < self.perimeter
        return np.where(near, -sighting.bearing, 0.0), np.where(near, 0.0, 1.0), memory


@dataclass(frozen=True, kw_only=True, eq=False)
class Stationary(Heuristic):
    """Stays where the episode begins: at rest, its heading as it is.

    Without speed control it cannot rest, and does the nearest thing: it circles to port as tightly as it can turn.
    """

    def choose(self, sighting: Sighting, memory: Any) -> tuple[np.ndarray, np.ndarray, Any]:
        turn = 0.0 if self.scenario.speed_control else 0.75 * math.pi  # so large an error drives P control to its limit
        return turn - sighting.bearing, np.zeros_like(sighting.bearing), memory


class Draw(NamedTuple):
    """What the action that each world holds was drawn from, each (B,)."""

    key: np.ndarray  # uint64: what the episode's draws come from
    drawn: np.ndarray  # how many so far
    age: np.ndarray  # time since the last draw [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Random(Heuristic):
    """A course uniform on the circle and, where it can be chosen, a speed uniform from rest to full, held for a while.

    Draws are keyed by ``seed`` and by the heading at the episode's first observation, so that an episode meets the same
    courses alone and in any batch, and another episode other ones.
    """

    seed: int = 0
    hold: float = 10.0  # time between draws [s]

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.seed >= 0, self, "seed", "at least 0")
        require(self.hold > 0, self, "hold", "positive")

    def begin(self, sighting: Sighting) -> Draw:
        key = mix_bits(sighting.heading.view(np.uint64) ^ mix_bits(np.full(1, self.seed % 2**64, np.uint64)))
        return Draw(key=key, drawn=np.zeros(len(key), np.int64), age=np.zeros(len(key)))

    def choose(self, sighting: Sighting, memory: Draw) -> tuple[np.ndarray, np.ndarray, Draw]:
        over = memory.age > self.hold - 1e-6
        drawn = memory.drawn + over
        age = np.where(over, 0.0, memory.age) + self.scenario.time_step
        bits = mix_bits(memory.key + drawn.astype(np.uint64))
        course = (bits >> np.uint64(32)).astype(np.float64) * (2.0 * math.pi / 2**32)
        speed = (bits & np.uint64(2**32 - 1)).astype(np.float64) / 2**32
        return course - sighting.line, speed, Draw(key=memory.key, drawn=drawn, age=age)


def mix_bits(bits: np.ndarray) -> np.ndarray:
    """Uint64 words whose bits all depend on all bits of the given ones (the finalizer of SplitMix64)."""
    bits = bits + np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
