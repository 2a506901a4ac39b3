"""The Gymnasium vector environment: B worlds stepped as one batch, with all three autoreset modes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from tagtrack.envs.batch_views import RENDERING, Pictures, WorldView
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import LARGEST_DRAWN_SEED
from tagtrack.envs.spaces import action_space, observation_space, team_space
from tagtrack.envs.specification import plain_spec
from tagtrack.envs.task import Task, TaskOptions, build_task, episode_limit
from tagtrack.envs.telling import all_have_left, team_reward, tell
from tagtrack.envs.validation import as_actions

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec
    from typing_extensions import Unpack


class TagTrackVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many worlds of one task at once. World i equals a ``TagTrackEnv`` (see there) with seed + i, bit for bit.

    Args:
        env_id, options: as for ``TagTrackEnv``.
        num_envs: B.
        max_episode_steps: truncates episodes after so many steps instead of the scenario's ``episode_steps``.
        threads: the worlds are split among so many.
        autoreset_mode: what happens to a world whose episode has ended: a new one begins at the next step, whose action
            it ignores; or in the same step, with ``final_obs`` and ``final_info`` in the info; or when
            ``reset(options={"reset_mask": mask})`` asks for it.
        render_mode: ``"rgb_array"`` or None (needs ``pip install "tagtrack[render]"``).

    Arrays that it returns are the caller's: no later step writes to them.
    """

    closed = True  # until it is made: after an error in the constructor there is nothing to close

    def __init__(
        self,
        env_id: str | Task = "TagTrack/LeopardShark-v0",
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Unpack[TaskOptions],
    ) -> None:
        task = build_task(env_id, **options)
        self.simulation = Simulation(task.scenario, num_envs, threads=threads, tracks=task.tracks)
        self.closed = False
        self.num_envs = self.simulation.num_worlds
        self.render_mode = render_mode
        self._pictures = Pictures(self.simulation, render_mode)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**RENDERING, "autoreset_mode": self.autoreset_mode}
        vehicles = task.scenario.vehicles
        self.single_observation_space = team_space(observation_space(task.scenario), vehicles)
        self.single_action_space = team_space(action_space(task.scenario), vehicles)
        self._own = (slice(None), 0) if vehicles == 1 else (slice(None),)  # where rows are in the simulation's arrays
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.episode_limit = episode_limit(task.scenario, max_episode_steps)
        self._ended = np.zeros(self.num_envs, bool)
        self._spec: EnvSpec | None = None
        self._begun = False

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]
        """As that of ``TagTrackEnv``."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = plain_spec(spec)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin episodes: world i of ``seed`` + i its first, without a seed the next one.

        Args:
            seed: one for all, or a sequence of one for each world, in which None stands for going on.
            options: ``reset_mask``, (B,) bool: only these worlds; the rows of the others stay as they are.
        """
        super().reset(seed=seed if isinstance(seed, int) else None)
        chosen = self._chosen_worlds(options)
        self._begin(seed, chosen)
        self._begun = True
        self._ended[chosen] = False
        self._pictures.follow()
        return self.simulation.observation[self._own].copy(), self._info(chosen, ~chosen)

    def _begin(self, seed: int | Sequence[int | None] | None, chosen: np.ndarray) -> None:
        """Reset the chosen worlds: those with a seed to its first episode, the others to their next."""
        if isinstance(seed, (str, bytes)) or not (seed is None or isinstance(seed, (Sequence, np.ndarray))):
            self.simulation.reset(seed, chosen)
            return
        each: list[int | None] = [None] * self.num_envs if seed is None else list(seed)
        if len(each) != self.num_envs:
            raise ValueError(f"there must be one seed for each of {self.num_envs} worlds, got {len(each)}")
        if not self._begun:
            drawn = int(self.np_random.integers(LARGEST_DRAWN_SEED))
            each = [drawn + i if own is None else own for i, own in enumerate(each)]
        seeded = np.array([own is not None for own in each])
        if (chosen & seeded).any():
            self.simulation.reset([0 if own is None else own for own in each], chosen & seeded)
        if (chosen & ~seeded).any():
            self.simulation.reset(None, chosen & ~seeded)

    def _chosen_worlds(self, options: dict[str, Any] | None) -> np.ndarray:
        if options is None or "reset_mask" not in options:
            return np.ones(self.num_envs, bool)
        mask = options["reset_mask"]
        shape = (self.num_envs,)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != shape or not mask.any():
            raise ValueError(f"reset_mask must be a bool array of shape {shape} with a True in it, got {mask!r}")
        if not self._begun and not mask.all():
            raise ResetNeeded("the first reset must be of all worlds, without a reset_mask")
        return mask

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Steer all worlds for one time step.

        Args:
            actions: (B, A), or (B, V, A) of several vehicles.
        Returns:
            observations (B, D) or (B, V, D), three arrays (B,) and the info.
        """
        if not self._begun:
            raise ResetNeeded("call reset before step")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            ended = np.flatnonzero(self._ended).tolist()
            raise ResetNeeded(f'the episodes of worlds {ended} have ended; reset(options={{"reset_mask": mask}}) them')
        simulation = self.simulation
        actions = as_actions(actions)
        simulation.step(actions[:, np.newaxis] if len(self._own) == 2 else actions)
        fresh = np.zeros(self.num_envs, bool)  # worlds whose observation is the first of an episode
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and self._ended.any():
            fresh = self._ended
            simulation.reset(mask=fresh)
        reward = np.where(fresh, 0.0, team_reward(simulation))
        terminated, truncated = all_have_left(simulation), simulation.worlds.clock["step"] >= self.episode_limit
        self._ended = terminated | truncated
        final: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._ended.any():
            final = self._final(self._ended, ~fresh)
            fresh = self._ended
            simulation.reset(mask=fresh)
        info = self._info(np.ones(self.num_envs, bool), ~fresh) | final
        self._pictures.follow()
        return simulation.observation[self._own].copy(), reward, terminated, truncated, info

    def _info(self, present: np.ndarray, stepped: np.ndarray) -> dict[str, Any]:
        """What ``TagTrackEnv`` puts into its info, each with the mask of the worlds that have it."""
        values = tell(self.simulation, stepped)
        return values | {f"_{name}": present.copy() for name in values}

    def _final(self, ended: np.ndarray, stepped: np.ndarray) -> dict[str, Any]:
        """The last observation and info of the episodes that have just ended."""
        observations = np.full(self.num_envs, None, object)
        for world in np.flatnonzero(ended):
            observations[world] = self.simulation.observation[self._own][world].copy()
        return {
            "final_obs": observations,
            "_final_obs": ended.copy(),
            "final_info": self._info(ended, stepped),
            "_final_info": ended.copy(),
        }

    def render(self) -> tuple[np.ndarray, ...] | None:  # type: ignore[override]
        """A picture (H, W, 3) uint8 of each world in mode ``rgb_array``, else None."""
        frames = [self._paint(world) for world in range(self.num_envs)]
        return tuple(frame for frame in frames if frame is not None) or None

    def _paint(self, world: int) -> np.ndarray | None:
        if self.render_mode is not None and not self._begun:
            raise ResetNeeded("call reset before render")
        return self._pictures.paint(world)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """As Gymnasium's own vectors do: an attribute of each world, or what its method (``render``) returns.

        Raises:
            AttributeError: for what worlds of a batch do not have or do one by one (``step``, ``reset``).
        """
        found = [getattr(view, name) for view in self._views()]
        return tuple(each(*args, **kwargs) if callable(each) else each for each in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each world."""
        return tuple(getattr(view, name) for view in self._views())

    def _views(self) -> list[WorldView]:
        own = {"observation_space": self.single_observation_space, "action_space": self.single_action_space}
        return [WorldView(self, i, **own, render=partial(self._paint, i)) for i in range(self.num_envs)]

    def close_extras(self) -> None:
        """End the simulation's threads."""
        self.simulation.close()
