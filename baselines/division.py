"""Fleets among several tags: who goes to which, decided by each vehicle from what it knows, held for a while, then circled.

A tag is worth going to for how little is known of it, its spread, and costs the way: ``per_metre`` of spread for each metre.
Shared knowledge gives equal answers; with late or no messages vehicles may choose the same tag.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from tagtrack.baselines.circle import Circling
from tagtrack.baselines.heuristic import Sighting
from tagtrack.baselines.surroundings import Surroundings
from tagtrack.envs.validation import require

TAKEN = 1e6  # [m]: what a tag is worth less for each vehicle that has taken it


class Duty(NamedTuple):
    """The tag each vehicle goes to, each (B,)."""

    tag: np.ndarray  # int
    age: np.ndarray  # time since it was chosen [s]; infinite before the first


def rate_tags(around: Surroundings, per_metre: float) -> np.ndarray:
    """What each tag is worth to each vehicle, (B, V, T): its spread less ``per_metre`` times the way [m]; NaN where unknown."""
    away = around.tags[:, None] - around.places[:, :, None]
    return around.spread[:, None] - per_metre * np.hypot(away[..., 0], away[..., 1])


def choose_in_turn(value: np.ndarray, own: np.ndarray) -> np.ndarray:
    """The tag (B,) of vehicle ``own`` (B,) where vehicles choose by their number, each the best that the fewest have taken.

    Args:
        value: (B, V, T) [m], NaN for vehicles of which nothing is known, who take none.
    """
    taken = np.zeros((len(value), value.shape[2]))
    choice = np.zeros(len(value), np.int64)
    rows = np.arange(len(value))
    for v in range(value.shape[1]):
        known = ~np.isnan(value[:, v]).any(axis=1)
        best = np.where(known[:, None], value[:, v] - TAKEN * taken, 0.0).argmax(axis=1)
        taken[rows[known], best[known]] += 1.0
        choice = np.where(own == v, best, choice)
    return choice


def assign_jointly(value: np.ndarray, own: np.ndarray) -> np.ndarray:
    """The tag (B,) of vehicle ``own`` (B,) where the sum over all vehicles is the largest (Hungarian method).

    Where vehicles outnumber tags, each tag is given to as few as can be.

    Args:
        value: (B, V, T) [m], NaN for vehicles of which nothing is known, who get none.
    """
    choice = np.zeros(len(value), np.int64)
    for row, worth in enumerate(value):
        known = np.flatnonzero(~np.isnan(worth).any(axis=1))
        rounds = -(-len(known) // worth.shape[1])
        offer = np.concatenate([worth[known] - TAKEN * k for k in range(rounds)], axis=1)
        vehicles, tags = linear_sum_assignment(offer, maximize=True)
        choice[row] = tags[known[vehicles] == own[row]][0] % worth.shape[1]
    return choice


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
