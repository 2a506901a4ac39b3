"""The reward of a step: minus the localization error, and named terms beside it, each with its weight in the scenario."""

from __future__ import annotations

from tagtrack.envs.kernels.compiling import compiled


@compiled
def judge(terms, error, distance, reward):
    """Write the weighted terms (``scenario.REWARD_TERMS``) of one vehicle.

    Args:
        terms: (2,) float64, filled. error: mean localization error over the tags [m]. distance: to the nearest fish [m].
        reward: the scenario's ``Reward``.
    """
    terms[0] = -reward.localization * min(error, reward.error_cap) / reward.error_cap
    terms[1] = 0.0
    if distance < reward.perimeter:
        terms[1] = -reward.standoff * (1.0 - distance / reward.perimeter)
