"""What the numbers of an observation are called, and what makes them numbers near one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from tagtrack.envs.validation import require, settle_numbers


class Feature(NamedTuple):
    """One number of the observation."""

    name: str
    meaning: str
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Scale:
    """What makes the features of a task numbers near one; a policy is at home at the scale it was trained with."""

    length: float = 50.0  # distances are given as shares of this [m]
    near: float = 15.0  # the distance whose logarithm is 0 [m]
    spread: float = 5.0  # the standard deviation whose logarithm is 0 [m]
    memory: float = 20.0  # over which the belief's bearing is averaged [s]

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("length", "near", "spread", "memory"):
            require(getattr(self, name) > 0, self, name, "positive")
