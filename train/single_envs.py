"""A batch in place of single environments: what the functions that make them, as Stable-Baselines3 has them, ask for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gymnasium
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit
from stable_baselines3.common.monitor import Monitor

from tagtrack.envs.single import TagTrackEnv
from tagtrack.envs.task import Task

DOES_SO_ITSELF = (Monitor, TimeLimit, OrderEnforcing, PassiveEnvChecker)  # wrappers whose work the batch does


class Asked(NamedTuple):
    """What a batch is to be."""

    task: Task
    episode_limit: int
    render_mode: str | None


def read_functions(functions: Sequence[Callable[[], gymnasium.Env[Any, Any]]]) -> Asked:
    """The task of the first environment; it is made for that and closed.

    Raises:
        ValueError: without a function, for another kind of environment, or one in a wrapper whose work the batch does not do.
    """
    functions = list(functions)
    if not functions or not all(callable(each) for each in functions):
        raise ValueError(f"env_id must be an id, a Task, or functions that make environments, got {functions!r:.80}")
    env = functions[0]()
    try:
        _require_plain(env)
        own = env.unwrapped
        assert isinstance(own, TagTrackEnv)
        return Asked(own.task, own.episode_limit, own.render_mode)
    finally:
        env.close()


def _require_plain(env: gymnasium.Env[Any, Any]) -> None:
    if not isinstance(env.unwrapped, TagTrackEnv):
        raise ValueError(f"a batch is made of TagTrack's environments, got {env.unwrapped!r}")
    while isinstance(env, gymnasium.Wrapper):
        if not isinstance(env, DOES_SO_ITSELF):
            raise ValueError(f"{type(env).__name__} wraps single environments; wrap the batch by a VecEnvWrapper instead")
        if isinstance(env, Monitor) and env.results_writer is not None:
            raise ValueError("a Monitor with a file is of single environments; use VecMonitor(env, filename) instead")
        env = env.env
