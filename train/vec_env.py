"""The vector environment of Stable-Baselines3, over the batched core itself: no Dummy or SubprocVecEnv around worlds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from tagtrack.envs.batch_views import MOST_PICTURES, RENDERING, Pictures, WorldView
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.spaces import action_space, observation_space
from tagtrack.envs.task import Task, TaskOptions, build_task, episode_limit
from tagtrack.envs.telling import all_have_left, tell_vehicles
from tagtrack.envs.validation import as_actions, whole_number
from tagtrack.train.holding import HeldCourse
from tagtrack.train.single_envs import read_functions

if TYPE_CHECKING:
    from typing_extensions import Unpack


class TagTrackVecEnv(VecEnv):
    """Vehicles in worlds of one task for Stable-Baselines3.

    Each row is a vehicle, and all learn one policy (shared parameters): row b * V + v is vehicle v of world b, with an
    observation, an action and a reward of its own. With one vehicle a row is a world. The rows of a world end together: at the
    limit, or when all its vehicles have left. A vehicle whose battery is empty before that has observations and rewards of 0
    until then.

    An ordinary step returns empty infos; the numbers of all worlds are arrays in ``simulation``. At an episode's end an
    info holds ``terminal_observation``, ``TimeLimit.truncated`` (False for a vehicle that has left) and ``episode``, which is
    what ``Monitor`` reports, so that no Monitor is needed: the return ``r``, the length ``l``, the time ``t`` since this object
    was made [s], and beside them ``localization_error``, the episode's mean [m]. Length and mean are over the steps in which the
    vehicle took part. Beside it stands what the last step told of the vehicle, for ``VecMonitor(info_keywords=...)``: keys as in
    ``TagTrackParallelEnv``.

    ``make_vec_env(id, n_envs=8, vec_env_cls=TagTrackVecEnv)`` makes one, too.

    Args:
        env_id: or a ``Task``; or functions that make one single environment each, as ``make_vec_env`` hands over: as many worlds
            of the first one's task. options: as for ``TagTrackEnv``.
        num_envs: rows, worlds times vehicles, as Stable-Baselines3 counts them; those of one world if None.
        max_episode_steps, threads, render_mode: as for ``TagTrackVectorEnv``. ``get_images`` gives a picture of each world;
            made of functions, it draws tracks from the first picture on, and beyond 64 worlds it gives none.
        stagger: spread the ends of the first episodes evenly over an episode's length, lest all worlds start anew
            together; those episodes are shorter.
        hold: steps of the environment that one action lasts. The course chosen is held: where actions are relative to the own
            heading, the vehicle does not go on turning; relative to the line to a tag, the action counts anew at each step, as
            that line turns. Other components are repeated. A reward is the sum over these steps, so a discount is one for each
            action; lengths count steps of the environment. The last action of an episode lasts no longer than the episode.
    """

    def __init__(
        self,
        env_id: str | Task | Sequence[Callable[[], gymnasium.Env]] = "TagTrack/LeopardShark-v0",
        num_envs: int | None = None,
        *,
        max_episode_steps: int | None = None,
        threads: int = 1,
        render_mode: str | None = None,
        stagger: bool = False,
        hold: int = 1,
        **options: Unpack[TaskOptions],
    ) -> None:
        if isinstance(env_id, (str, Task)):
            task = build_task(env_id, **options)
        else:
            made = read_functions(env_id)
            task, max_episode_steps = made.task, max_episode_steps or made.episode_limit
            num_envs = num_envs or len(env_id) * task.scenario.vehicles
            # ``make_vec_env`` asks for pictures by itself; of more worlds than anybody can look at nobody wants them.
            render_mode = made.render_mode if num_envs <= MOST_PICTURES * task.scenario.vehicles else None
        self.hold = _whole_number("hold", hold)
        worlds = _count_worlds(num_envs, task.scenario.vehicles)
        self.simulation = Simulation(task.scenario, worlds, threads=threads, tracks=task.tracks)
        self.render_mode = render_mode  # the base class asks for it
        self._pictures = Pictures(self.simulation, render_mode)
        self._watched = isinstance(env_id, (str, Task))  # others say who wants pictures by asking for the first one
        rows = worlds * task.scenario.vehicles
        super().__init__(rows, observation_space(task.scenario), action_space(task.scenario))
        self.metadata = {**self.metadata, "render_fps": RENDERING["render_fps"]}
        self.episode_limit = episode_limit(task.scenario, max_episode_steps)
        self.stagger = stagger
        self._may_leave = task.scenario.vehicle.battery > 0
        self._begun = False
        self._made = time.perf_counter()
        self._head_start = np.zeros(worlds, np.int64)  # steps by which a staggered episode is shorter
        shape = (worlds, task.scenario.vehicles)
        self._return = np.zeros(shape)
        self._error = np.zeros(shape)  # sum over the episode [m]
        self._length = np.zeros(shape, np.int64)  # steps in which the vehicle took part
        self._actions: np.ndarray = np.zeros((rows, len(self.simulation.action_names)), np.float32)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seeds of the next reset: ``seed`` and those that follow it. Raises ValueError for no whole number."""
        return super().seed(None if seed is None else whole_number(seed, "seed"))

    def reset(self) -> np.ndarray:
        """Begin episodes in all worlds: the first of the seed given to ``seed``, else the next."""
        if self._seeds[0] is None and not self._begun:
            self.seed()
        self.simulation.reset(self._seeds[0])
        self._begun = True
        self._reset_seeds()
        self._reset_options()
        worlds = self.simulation.num_worlds
        self._head_start[:] = np.arange(worlds) * self.episode_limit // worlds if self.stagger else 0
        self._forget(np.ones(worlds, bool))
        self._follow()
        return self._observe()

    def go_on_from(self, state: tuple[np.ndarray, ...]) -> None:
        """Return the worlds to what ``simulation.save_state`` gave; episodes go on without a reset."""
        self.simulation.load_state(state)
        self._begun = True

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions, (rows, A), for ``step_wait``. Raises ResetNeeded before the first reset."""
        if not self._begun:
            raise ResetNeeded("call reset before step")
        self._actions = np.array(as_actions(actions))

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all worlds under one action of each row; those whose episode has ended begin the next one in the same step."""
        simulation, shape = self.simulation, self._return.shape
        actions: np.ndarray = self._actions
        if len(actions) == self.num_envs:  # else the simulation says what is wrong
            actions = actions.reshape(*shape, -1)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        reward, ended = np.zeros(shape), np.zeros(shape[0], bool)
        held = HeldCourse(simulation) if self.hold > 1 else None
        for _ in range(self.hold):
            simulation.step(actions if held is None else held.apply(actions))
            reward += self._count(~ended)
            just_ended = self._has_ended() & ~ended
            if just_ended.any():
                told = tell_vehicles(simulation)
                for world in np.flatnonzero(just_ended).tolist():
                    self._report(world, told, infos)
                ended |= just_ended
                if ended.all():
                    break
        if ended.any():
            simulation.reset(mask=ended)
            self._head_start[ended] = 0
            self._forget(ended)
        self._follow()
        dones = np.repeat(ended, shape[1])
        return self._observe(), reward.ravel().astype(np.float32), dones, infos

    def _observe(self) -> np.ndarray:
        """(rows, D)."""
        return self.simulation.observation.reshape(self.num_envs, -1).copy()

    def _count(self, going: np.ndarray) -> np.ndarray:
        """(B, V) the last step's reward, 0 where the episode of a world is no longer ``going``; it is added to the episode's."""
        simulation = self.simulation
        reward, error, part = simulation.reward, simulation.outputs.outcomes["error"], np.True_
        if self._may_leave or self.hold > 1:
            part = going[:, np.newaxis] & ~simulation.worlds.vehicles["gone"]
            reward, error = np.where(part, reward, 0.0), np.where(part, error, 0.0)
        self._return += reward
        self._error += error
        self._length += part
        return reward

    def _has_ended(self) -> np.ndarray:
        """(B,) bool."""
        late = self.simulation.worlds.clock["step"] + self._head_start >= self.episode_limit
        return late | all_have_left(self.simulation) if self._may_leave else late

    def _forget(self, worlds: np.ndarray) -> None:
        """Begin new sums in the chosen worlds."""
        for sums in (self._return, self._error, self._length):
            sums[worlds] = 0

    def _report(self, world: int, told: dict[str, np.ndarray], infos: list[dict[str, Any]]) -> None:
        """Fill the infos of a world whose episode has just ended."""
        vehicles = self._return.shape[1]
        for v in range(vehicles):
            length = int(self._length[world, v])
            episode = {
                "r": round(float(self._return[world, v]), 6),
                "l": length,
                "t": round(time.perf_counter() - self._made, 6),
                "localization_error": float(self._error[world, v]) / length,
            }
            infos[world * vehicles + v] = {
                **{name: values[world, v] for name, values in told.items()},
                "terminal_observation": self.simulation.observation[world, v].copy(),
                "TimeLimit.truncated": bool(self.simulation.worlds.navigation["active"][world, v]),
                "episode": episode,
            }

    def close(self) -> None:
        """End the simulation's threads."""
        self.simulation.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture (H, W, 3) uint8 of each world, None without a render mode; ``render`` lays them out as a grid."""
        return [self._paint(world) for world in range(self.simulation.num_worlds)]

    def _follow(self) -> None:
        if self._watched:
            self._pictures.follow()

    def _paint(self, world: int) -> np.ndarray | None:
        if self.render_mode is not None and not self._begun:
            raise ResetNeeded("call reset before render")
        if not self._watched:
            self._watched = True
            self._pictures.follow()
        return self._pictures.paint(world)

    def _views(self, indices: int | Iterable[int] | None) -> list[WorldView]:
        """The world of each row."""
        worlds = [row // self.simulation.scenario.vehicles for row in self._get_indices(indices)]
        return [WorldView(self, world, render=partial(self._paint, world)) for world in worlds]

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """An attribute of the batch, once for each row: all share it."""
        return [getattr(view, attr_name) for view in self._views(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Not to be had: worlds of a batch share their attributes."""
        raise NotImplementedError(f"worlds of a batch share {attr_name!r}; make the environment with what you need")

    def env_method(
        self, method_name: str, *method_args: Any, indices: int | Iterable[int] | None = None, **method_kwargs: Any
    ) -> list[Any]:
        """What a method of each row's world returns: ``render``, ``get_wrapper_attr``, ``has_wrapper_attr``.

        Raises:
            AttributeError: for what worlds of a batch do not do one by one (``step``, ``reset``).
        """
        return [getattr(view, method_name)(*method_args, **method_kwargs) for view in self._views(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: int | Iterable[int] | None = None) -> list[bool]:
        """True for ``Monitor``, whose report this class gives by itself."""
        return [issubclass(Monitor, wrapper_class)] * len(list(self._get_indices(indices)))


def _count_worlds(num_envs: int | None, vehicles: int) -> int:
    """Worlds of so many rows."""
    if num_envs is None:
        return 1
    rows = _whole_number("num_envs", num_envs)
    if rows % vehicles:
        nearest = vehicles * max(1, round(rows / vehicles))
        raise ValueError(f"num_envs counts vehicles of whole worlds, {vehicles} in each, got {rows}; {nearest} would do")
    return rows // vehicles


def _whole_number(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise ValueError(f"{name} must be a whole number of at least 1, got {value!r}")
    return int(value)
