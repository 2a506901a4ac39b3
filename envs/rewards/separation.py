"""Keeping away from other vehicles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.rewards.term import JUDGE, Term
from tagtrack.envs.validation import settle_numbers


@native(JUDGE)
def judge(outcome, parameters):
    weight, least = parameters[0], parameters[1]
    if outcome.separation < least:
        return -weight * (1.0 - outcome.separation / least)
    return 0.0


@dataclass(frozen=True, kw_only=True)
class Separation(Term):
    """Minus the share of the least separation that the vehicle has intruded."""

    weight: float = 0.0
    least: float = 10.0  # distance that vehicles should keep from one another [m]
    name: ClassVar[str] = "separation"
    judge: ClassVar[Native] = judge

    def __post_init__(self) -> None:
        settle_numbers(self)
