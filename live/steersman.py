"""Who steers: a policy and its memory, asked once a step."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.baselines.circle import OracleCircle
from tagtrack.baselines.registry import BASELINES, make_baseline
from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.task import Task
from tagtrack.live.believer import Believer
from tagtrack.policies.box import LEARNED, boxed_policy
from tagtrack.policies.entities import EntityPolicy
from tagtrack.policies.files import load_policy
from tagtrack.policies.protocol import Policy

PolicyLike = str | Path | Policy | None


class Steersman:
    """Asks a policy at each step, and keeps its memory."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy
        self._memory: Any = None

    def act(self, observation: np.ndarray, *, begins: bool) -> np.ndarray:
        """(A,) action for an observation (D,)."""
        memory = None if begins else self._memory
        action, self._memory = self.policy.predict(observation[None], memory, np.array([begins]), deterministic=True)
        return action[0]


def make_steersman(policy: PolicyLike, believer: Believer, task: Task) -> Steersman | None:
    """The steersman of a baseline's specification, a run's folder or a policy; None of none.

    Raises:
        ValueError: for an unknown name, a policy of another task, or one that looks at the truth.
        FileNotFoundError: for a folder without a policy.
    """
    if policy is None:
        return None
    if isinstance(policy, (str, Path)):
        policy = _find_policy(str(policy), believer, task)
    if not hasattr(policy, "predict"):
        raise ValueError(f"a policy is a baseline's name, the folder of a run, or something with predict, got {policy!r:.60}")
    return Steersman(policy)


def _find_policy(spec: str, believer: Believer, task: Task) -> Policy:
    name = spec.partition(":")[0]
    if name in BASELINES:
        if issubclass(BASELINES[name], OracleCircle):
            raise ValueError(f"{name} looks at the true place of the fish, which nobody knows at sea; name another policy")
        return make_baseline(spec, believer)
    scenario = believer.scenario
    folder = boxed_policy(task.env_id, tags=scenario.targets) if spec == LEARNED else Path(spec)
    if not folder.exists():
        raise ValueError(f"unknown policy {spec!r}: there is no such folder, and known are {LEARNED}, {', '.join(BASELINES)}")
    loaded = load_policy(folder, feature_names(scenario), action_names=action_names(scenario), env_id=task.env_id)
    if not isinstance(loaded, EntityPolicy):
        return loaded
    return dataclasses.replace(loaded, courses=scenario.frame.name.lower())
