"""Fleets among several tags: who goes to which, decided by each vehicle from what it knows, held for a while, then circled.

A tag is worth going to for how little is known of it, its spread, and costs the way: ``per_metre`` of spread for each metre.
Shared knowledge gives equal answers; with late or no messages vehicles may choose the same tag.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tagtrack.baselines.circle import Circling
from tagtrack.baselines.heuristic import Sighting
from tagtrack.baselines.sharing import assign_jointly, choose_in_turn, rate_tags
from tagtrack.envs.validation import require


class Duty(NamedTuple):
    """The tag each vehicle goes to, each (B,)."""

    tag: np.ndarray  # int
    age: np.ndarray  # time since it was chosen [s]; infinite before the first


@dataclass(frozen=True, kw_only=True, eq=False)
class Dividing(Circling):
    """Base of those that choose a tag for each vehicle, hold the choice and circle it."""

    hold: float = 12.0  # time for which a choice is held [s]
    per_metre: float = 0.2  # metres of spread that outweigh a metre of way

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.hold > 0, self, "hold", "positive")
        require(self.per_metre >= 0, self, "per_metre", "at least 0")

    @abc.abstractmethod
    def divide(self, value: np.ndarray, own: np.ndarray) -> np.ndarray:
        """The tag (B,) of vehicle ``own`` (B,), given what tags are worth (B, V, T) [m]."""

    def begin(self, sighting: Sighting) -> Duty:
        return Duty(tag=sighting.tag, age=np.full(len(sighting.tag), np.inf))

    def choose(self, sighting: Sighting, memory: Duty) -> tuple[np.ndarray, np.ndarray, Duty]:
        duty = self.renew(sighting, memory)
        watched = self.look_at(sighting, duty.tag)
        course, speed = self.circle(watched)
        return course + (watched.bearing - sighting.bearing), speed, duty

    def renew(self, sighting: Sighting, duty: Duty) -> Duty:
        """The duties of this step: chosen anew where they have been held long enough."""
        over = duty.age > self.hold - 1e-6
        tag = duty.tag
        if over.any() and self.scenario.targets > 1:
            chosen = self.divide(rate_tags(self.look_around(sighting), self.per_metre), sighting.vehicle)
            tag = np.where(over, chosen, tag)
        return Duty(tag=tag, age=np.where(over, 0.0, duty.age) + self.scenario.time_step)


@dataclass(frozen=True, kw_only=True, eq=False)
class Assignment(Dividing):
    """Tags to vehicles so that the sum of what they are worth is the largest: if none is left over, the shortest ways in sum."""

    def divide(self, value: np.ndarray, own: np.ndarray) -> np.ndarray:
        return assign_jointly(value, own)


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertain(Dividing):
    """Vehicles choose in turn the tag that is worth most and that no one before has taken (greedy)."""

    def divide(self, value: np.ndarray, own: np.ndarray) -> np.ndarray:
        return choose_in_turn(value, own)
