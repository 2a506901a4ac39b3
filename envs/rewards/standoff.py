"""Keeping away from the animal (Clark et al. 2013, 6.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.rewards.term import JUDGE, Term
from tagtrack.envs.validation import settle_numbers


@native(JUDGE)
def judge(outcome, parameters):
    weight, perimeter = parameters[0], parameters[1]
    if outcome.range < perimeter:
        return -weight * (1.0 - outcome.range / perimeter)
    return 0.0


@dataclass(frozen=True, kw_only=True)
class Standoff(Term):
    """Minus the share of the perimeter that the vehicle has intruded."""

    weight: float = 0.0
    perimeter: float = 0.0  # distance that the vehicle should keep from the fish [m]; 0: none
    name: ClassVar[str] = "standoff"
    judge: ClassVar[Native] = judge

    def __post_init__(self) -> None:
        settle_numbers(self)
