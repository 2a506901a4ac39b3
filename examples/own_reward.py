"""A term of the reward of one's own: the vehicle should keep a distance, neither nearer nor farther.

    tagtrack train --env LeopardShark-v0 --set reward.own=own_reward:KeepDistance reward.own.keep_distance.weight=0.2
"""

from dataclasses import dataclass
from typing import ClassVar

from tagtrack.envs.kernels.calling import native
from tagtrack.envs.rewards.term import JUDGE, Term


@native(JUDGE)
def judge(outcome, parameters):
    """The weighted term of one step; ``outcome`` holds what the referee knows (``rewards/term.py``)."""
    weight, distance = parameters[0], parameters[1]
    return -weight * min(abs(outcome.range - distance) / distance, 1.0)


@dataclass(frozen=True, kw_only=True)
class KeepDistance(Term):
    weight: float = 0.1
    distance: float = 25.0  # [m]
    name: ClassVar[str] = "keep_distance"  # in infos and tables
    judge = judge
