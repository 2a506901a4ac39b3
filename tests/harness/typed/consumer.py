"""What a stranger's strictly typed program may write; ``make release-check`` has mypy and pyright read it beside the wheel."""

from __future__ import annotations

from typing import Any

import numpy as np

import tagtrack
from tagtrack.baselines.registry import make_baseline
from tagtrack.envs import TagTrackEnv, TagTrackVectorEnv
from tagtrack.envs.scenario import Scenario, find_scenario
from tagtrack.eval import compare
from tagtrack.policies.files import load_policy


def mean_reward(env_id: str, steps: int) -> float:
    """Drive straight on."""
    env = TagTrackEnv(env_id, particles=50)
    observation, info = env.reset(seed=1)
    rewards: list[float] = []
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(np.zeros(2, np.float32))
        rewards.append(reward)
    size: int = observation.size
    error: Any = info["localization_error"]
    assert size > 0 and error >= 0
    env.close()
    return sum(rewards) / len(rewards)


scenario: Scenario = find_scenario("LeopardShark-v0")
period: float = scenario.tag.period
batch = TagTrackVectorEnv("LeopardShark-v0", num_envs=2, particles=50)
version: str = tagtrack.__version__
print(version, period, mean_reward("LeopardShark-v0", 3), compare, load_policy, make_baseline)
