"""The reward of a step: minus the localization error, and named terms beside it, each with its weight in the scenario."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from tagtrack.envs.rewards.localization import Localization
from tagtrack.envs.rewards.message import MessagePrice
from tagtrack.envs.rewards.separation import Separation
from tagtrack.envs.rewards.standoff import Standoff
from tagtrack.envs.rewards.term import Term
from tagtrack.envs.validation import require, settle_numbers

MOST_TERMS = 8
__all__ = ["MOST_TERMS", "Localization", "MessagePrice", "OverTags", "Reward", "Separation", "Standoff", "Term"]


class OverTags(enum.IntEnum):
    """Which localization error counts where there are several tags."""

    MEAN = 0
    WORST = 1


@dataclass(frozen=True, kw_only=True)
class Reward:
    """Named terms of the reward, each with its weight; their sum is the reward of a step."""

    localization: float = 1.0  # weight of minus the localization error, as a share of error_cap
    error_cap: float = 100.0  # errors beyond count as this one, lest lost episodes drown the rest [m]
    standoff: float = 0.0  # weight of minus the share of the perimeter that the vehicle has intruded
    perimeter: float = 0.0  # distance that the vehicle should keep from the fish [m]; 0: none
    over_tags: OverTags = OverTags.MEAN  # of several tags' errors
    shared: bool = False  # whether each vehicle gets the mean over all that take part, or its own reward
    separation: float = 0.0  # weight of minus the share of the least separation that the vehicle has intruded
    least_separation: float = 10.0  # distance that vehicles should keep from one another [m]
    message: float = 0.0  # price of a message
    own: tuple[Term, ...] = ()  # further terms, as of a user's own file

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.error_cap > 0, self, "error_cap", "positive")
        for name in ("localization", "standoff", "perimeter", "separation", "least_separation", "message"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        if not isinstance(self.own, tuple) or not all(isinstance(term, Term) for term in self.own):
            raise ValueError(f"Reward.own must be a tuple of terms of a reward, got {self.own!r}")
        names = self.names
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ValueError(f"Reward.own: two terms go by the name {twice!r}; give one of them another `name`")
        require(len(names) <= MOST_TERMS, self, "own", f"at most {MOST_TERMS - len(names) + len(self.own)} terms")

    @property
    def terms(self) -> tuple[Term, ...]:
        """All terms, in the order of ``names``; those of fleets where they have a weight."""
        terms: tuple[Term, ...] = (
            Localization(weight=self.localization, error_cap=self.error_cap, worst=self.over_tags == OverTags.WORST),
            Standoff(weight=self.standoff, perimeter=self.perimeter),
        )
        if self.separation > 0:
            terms += (Separation(weight=self.separation, least=self.least_separation),)
        if self.message > 0:
            terms += (MessagePrice(price=self.message),)
        return terms + self.own

    @property
    def names(self) -> tuple[str, ...]:
        """By which the terms are known in infos and tables."""
        return tuple(term.name or type(term).__name__ for term in self.terms)
