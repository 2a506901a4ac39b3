"""What a policy is: anything with the `predict` of Stable-Baselines3, whether learned, hand-written or an oracle.

One signature for all of them means that one roll-out, and SB3's own `evaluate_policy`, takes any of them.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np


class Policy(Protocol):
    """Chooses actions for a batch of worlds; of fleets for each vehicle by itself.

    With V vehicles in each world there are B * V rows, row b * V + v being that of vehicle v of world b.
    """

    def predict(
        self,
        observation: np.ndarray,
        state: Any = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = False,
    ) -> tuple[np.ndarray, Any]:
        """Choose the action of each world.

        Args:
            observation: (B, D) float32, one row a world, or (D,) for one world alone.
            state: what the last call returned, None before the first; a memoryless policy ignores it and returns None.
            episode_start: (B,) bool, True where the observation is the first of an episode and memory must be cleared;
                None: True everywhere if `state` is None, else False everywhere.
            deterministic: the policy's best action instead of a draw.
        Returns:
            (B, A) float32 action in [-1, 1], or (A,) if the observation was (D,), and the state for the next call.
        """
        ...
