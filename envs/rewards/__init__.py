"""The reward of a step: minus the localization error, and named terms beside it, each with its weight in the scenario."""

from __future__ import annotations

from dataclasses import dataclass

from tagtrack.envs.rewards.localization import Localization
from tagtrack.envs.rewards.standoff import Standoff
from tagtrack.envs.rewards.term import Term
from tagtrack.envs.validation import require, settle_numbers

MOST_TERMS = 8
__all__ = ["MOST_TERMS", "Localization", "Reward", "Standoff", "Term"]


@dataclass(frozen=True, kw_only=True)
class Reward:
    """Named terms of the reward, each with its weight; their sum is the reward of a step."""

    localization: float = 1.0  # weight of minus the localization error, as a share of error_cap
    error_cap: float = 100.0  # errors beyond count as this one, lest lost episodes drown the rest [m]
    standoff: float = 0.0  # weight of minus the share of the perimeter that the vehicle has intruded
    perimeter: float = 0.0  # distance that the vehicle should keep from the fish [m]; 0: none
    own: tuple[Term, ...] = ()  # further terms, as of a user's own file

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.error_cap > 0, self, "error_cap", "positive")
        for name in ("localization", "standoff", "perimeter"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        if not isinstance(self.own, tuple) or not all(isinstance(term, Term) for term in self.own):
            raise ValueError(f"Reward.own must be a tuple of terms of a reward, got {self.own!r}")
        names = self.names
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ValueError(f"Reward.own: two terms go by the name {twice!r}; give one of them another `name`")
        require(len(names) <= MOST_TERMS, self, "own", f"at most {MOST_TERMS - 2} terms")

    @property
    def terms(self) -> tuple[Term, ...]:
        """All terms, in the order of ``names``."""
        return (
            Localization(weight=self.localization, error_cap=self.error_cap),
            Standoff(weight=self.standoff, perimeter=self.perimeter),
            *self.own,
        )

    @property
    def names(self) -> tuple[str, ...]:
        """By which the terms are known in infos and tables."""
        return tuple(term.name or type(term).__name__ for term in self.terms)
