"""The vector environment of Stable-Baselines3, over the batched core itself: no Dummy or SubprocVecEnv around worlds."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from tagtrack.envs.simulation import Simulation
from tagtrack.envs.spaces import action_space, observation_space
from tagtrack.envs.task import Task, TaskOptions, build_task, episode_limit, require_single

if TYPE_CHECKING:
    from typing_extensions import Unpack


class TagTrackVecEnv(VecEnv):
    """Worlds of one task for Stable-Baselines3.

    An ordinary step returns empty infos; the numbers of all worlds are arrays in ``simulation``. At an episode's end an
    info holds ``terminal_observation``, ``TimeLimit.truncated`` and ``episode``, which is what ``Monitor`` reports, so
    that no Monitor is needed: the return ``r``, the length ``l``, the time ``t`` since this object was made [s], and
    beside them ``localization_error``, the episode's mean [m].

    Args:
        env_id: or a ``Task``. options: as for ``TagTrackEnv``.
        num_envs, max_episode_steps, threads: as for ``TagTrackVectorEnv``.
        stagger: spread the ends of the first episodes evenly over an episode's length, lest all worlds start anew
            together; those episodes are shorter.
    """

    def __init__(
        self,
        env_id: str | Task = "TagTrack/LeopardShark-v0",
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        threads: int = 1,
        stagger: bool = False,
        **options: Unpack[TaskOptions],
    ) -> None:
        task = build_task(env_id, **options)
        require_single(task.scenario, "TagTrackVecEnv")
        self.simulation = Simulation(task.scenario, num_envs, threads=threads, tracks=task.tracks)
        self.render_mode = None  # the base class asks for it
        super().__init__(self.simulation.num_worlds, observation_space(task.scenario), action_space(task.scenario))
        self.episode_limit = episode_limit(task.scenario, max_episode_steps)
        self.stagger = stagger
        self._begun = False
        self._made = time.perf_counter()
        self._head_start = np.zeros(self.num_envs, np.int64)  # steps by which a staggered episode is shorter
        self._return = np.zeros(self.num_envs)
        self._error = np.zeros(self.num_envs)  # sum over the episode [m]
        self._actions = np.zeros((self.num_envs, len(self.simulation.action_names)), np.float32)

    def reset(self) -> np.ndarray:
        """Begin episodes in all worlds: the first of the seed given to ``seed``, else the next."""
        if self._seeds[0] is None and not self._begun:
            self.seed()
        self.simulation.reset(self._seeds[0])
        self._begun = True
        self._reset_seeds()
        self._reset_options()
        self._head_start[:] = 0
        if self.stagger:
            self._head_start[:] = np.arange(self.num_envs) * self.episode_limit // self.num_envs
        self._return[:] = 0.0
        self._error[:] = 0.0
        return self.simulation.observation[:, 0].copy()

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all worlds; those whose episode has ended begin the next one in the same step."""
        simulation = self.simulation
        simulation.step(self._actions[:, np.newaxis])
        reward = simulation.reward[:, 0]
        self._return += reward
        self._error += simulation.error[:, 0, 0]
        ended = simulation.worlds.clock["step"] + self._head_start >= self.episode_limit
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if ended.any():
            for world in np.flatnonzero(ended).tolist():
                infos[world] = self._report(world)
            simulation.reset(mask=ended)
            self._head_start[ended] = 0
            self._return[ended] = 0.0
            self._error[ended] = 0.0
        return simulation.observation[:, 0].copy(), reward.astype(np.float32), ended, infos

    def _report(self, world: int) -> dict[str, Any]:
        """The info of a world whose episode has just ended."""
        length = int(self.simulation.worlds.clock["step"][world])
        episode = {
            "r": round(float(self._return[world]), 6),
            "l": length,
            "t": round(time.perf_counter() - self._made, 6),
            "localization_error": float(self._error[world]) / length,
        }
        observation = self.simulation.observation[world, 0].copy()
        return {"terminal_observation": observation, "TimeLimit.truncated": True, "episode": episode}

    def close(self) -> None:
        """End the simulation's threads."""
        self.simulation.close()

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """An attribute of the batch, once for each world: all worlds share it."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Not to be had: worlds of a batch share their attributes."""
        raise NotImplementedError(f"worlds of a batch share {attr_name!r}; make the environment with what you need")

    def env_method(
        self, method_name: str, *method_args: Any, indices: int | Iterable[int] | None = None, **method_kwargs: Any
    ) -> list[Any]:
        """Not to be had: no world of a batch is an object of its own."""
        raise NotImplementedError(f"no world of a batch has its own {method_name!r}; see its simulation")

    def env_is_wrapped(self, wrapper_class: type, indices: int | Iterable[int] | None = None) -> list[bool]:
        """True for ``Monitor``, whose report this class gives by itself."""
        return [issubclass(Monitor, wrapper_class)] * len(list(self._get_indices(indices)))
