"""What a term of the reward is: a function of what a step came to, as the referee sees it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.calling import Native, Signature, number, numbers, record_of, require_functions
from tagtrack.envs.model import Model

# What a step came to for one vehicle. `time` since the episode began [s]; `error` the mean localization error over the tags and
# `worst_error` the largest, `spread` the standard deviation of the belief, mean over the tags [m]; `range` to the nearest fish
# and `separation` to the nearest other vehicle, infinite without one [m]; `speed` through the water [m/s]; counts of tags
# `heard`, of `tags`, of `messages` sent in this step and of `encroachments` in the episode so far: how often it came too near
# another one.
OUTCOME = np.dtype(
    [
        (name, np.float64)
        for name in (
            "time", "error", "worst_error", "spread", "range", "separation", "speed", "heard", "tags", "messages",
            "encroachments",
        )
    ]
)  # fmt: skip

# The weighted term; a reward is the sum of all.
JUDGE = Signature("judge", number, outcome=record_of(OUTCOME), parameters=numbers)

judge_at = JUDGE.at  # a callable of an address, for compiled code


class Term(Model):
    """Base of all terms. Subclasses are frozen keyword-only dataclasses of parameters, their weight among them."""

    judge: ClassVar[Native]

    def __init_subclass__(cls) -> None:
        require_functions(cls, judge=JUDGE)
