"""A price on talking: the band is shared, and a modem draws tens of watts while it sends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.rewards.term import JUDGE, Term
from tagtrack.envs.validation import settle_numbers


@native(JUDGE)
def judge(outcome, parameters):
    return -parameters[0] * outcome.messages


@dataclass(frozen=True, kw_only=True)
class MessagePrice(Term):
    """Minus the price of the messages that the vehicle has sent in this step."""

    price: float = 0.0
    name: ClassVar[str] = "messages"
    judge: ClassVar[Native] = judge

    def __post_init__(self) -> None:
        settle_numbers(self)
