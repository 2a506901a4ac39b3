"""Minus the localization error: what all tracking is for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.rewards.term import JUDGE, Term
from tagtrack.envs.validation import require, settle_numbers


@native(JUDGE)
def judge(outcome, parameters):
    weight, error_cap, worst = parameters[0], parameters[1], parameters[2]
    error = outcome.worst_error if worst != 0.0 else outcome.error
    return -weight * min(error, error_cap) / error_cap


@dataclass(frozen=True, kw_only=True)
class Localization(Term):
    """Minus the localization error, mean over the tags or the worst one's, as a share of ``error_cap``."""

    weight: float = 1.0
    error_cap: float = 100.0  # errors beyond count as this one, lest lost episodes drown the rest [m]
    worst: bool = False  # of several tags' errors, instead of their mean
    name: ClassVar[str] = "localization"
    judge: ClassVar[Native] = judge

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.error_cap > 0, self, "error_cap", "positive")
