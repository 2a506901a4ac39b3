"""Loop over the actions that somebody hands in, before they reach the world."""

from __future__ import annotations

import numpy as np

from tagtrack.envs.kernels.compiling import compiled


@compiled
def find_broken_action(actions):
    """The first world with a NaN or an infinity among its actions (B, V, A); -1 if there is none."""
    for b in range(actions.shape[0]):
        for v in range(actions.shape[1]):
            for a in range(actions.shape[2]):
                if not np.isfinite(actions[b, v, a]):
                    return b
    return -1
