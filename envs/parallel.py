"""The PettingZoo environment: one world, several vehicles, each an agent. The world itself is in ``simulation.py``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils import parallel_to_aec

from tagtrack.envs.rendering import FRAMES_PER_SECOND, Picture
from tagtrack.envs.scenario import Formation
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import LARGEST_DRAWN_SEED
from tagtrack.envs.spaces import action_space, observation_space
from tagtrack.envs.task import Task, TaskOptions, build_task, episode_limit

if TYPE_CHECKING:
    from typing_extensions import Unpack


class TagTrackParallelEnv(ParallelEnv[str, np.ndarray, np.ndarray]):
    """Several AUVs track one or several tagged fish of one of the suite's tasks.

    Agents are ``auv_0``, ``auv_1`` ...; all stay to the end, which comes to all at once. With one vehicle and one tag it is
    ``TagTrackEnv`` bit for bit, and whatever one more vehicle or tag does, the fish, pings and readings of the others stay.

    ## Observation

    Of each agent a ``Box(D,)`` float32: the block of each tag, ``tag_0.distance`` ..., then its own, ``heading_cos`` ...; with
    one tag the layout is that of the task's Gymnasium environment (see there). ``tagtrack.envs.layout.features(scenario)`` lists
    names, meanings and ranges, ``split_observation`` takes an observation apart by entities. ``state()`` is all agents'
    observations, one after the other.

    ## Action

    Of each agent a ``Box`` as in the task's Gymnasium environment: a course and, where the scenario lets it vary, the speed. The
    course is relative to the line to the estimate where there is one tag, to the vehicle's own heading where there are several
    (``overrides={"steer_by": "line"}`` or ``"heading"``).

    ## Reward, ending, info

    As in the task's Gymnasium environment, to each agent its own; the localization error is the mean over the tags. The infos
    hold ``localization_error`` (mean over the tags), ``range`` to the nearest fish, ``separation`` from the nearest other vehicle
    (infinite alone) [m] and ``detected``, how many tags were heard at this step. All agents are truncated together.

    Args:
        env_id: of ours, or one that somebody registered; or a ``Task``.
        vehicles, tags: how many of each, 1 to 20; those of the scenario if None.
        modem: what the vehicles may tell one another (``"perfect"``, ``"none"``, ``"tdma"``); the scenario's if None (perfect).
        formation: how the vehicles lie at the start, ``"ring"`` or ``"line"``; ``overrides={"start.separation": 20}`` sets how
            far neighbours lie apart [m].
        max_cycles: steps of an episode; the scenario's ``episode_steps`` if None.
        render_mode: ``"rgb_array"``, ``"human"`` or None (needs ``pip install "tagtrack[render]"``).
        options: as for ``TagTrackEnv``.

    ## Version history

    * v0: the first version; it may still change before the first release (see CHANGELOG.md).
    """

    def __init__(
        self,
        env_id: str | Task = "TagTrack/LeopardShark-v0",
        *,
        formation: str | None = None,
        max_cycles: int | None = None,
        render_mode: str | None = None,
        **options: Unpack[TaskOptions],
    ) -> None:
        task = _in_formation(build_task(env_id, **options), formation)
        self.metadata = {
            "name": f"{task.env_id.rpartition('/')[2].lower().replace('-', '_')}",
            "render_modes": ["rgb_array", "human"],
            "render_fps": FRAMES_PER_SECOND,
            "is_parallelizable": True,
        }
        if render_mode not in (None, "rgb_array", "human"):
            raise ValueError(f"render_mode must be None, 'rgb_array' or 'human', got {render_mode!r}")
        self.render_mode = render_mode
        self.simulation = Simulation(task.scenario, tracks=task.tracks)
        self.possible_agents = [f"auv_{v}" for v in range(task.scenario.vehicles)]
        self.agents: list[str] = []
        self.max_cycles = episode_limit(task.scenario, max_cycles)
        self.observation_spaces = {agent: observation_space(task.scenario) for agent in self.possible_agents}
        self.action_spaces = {agent: action_space(task.scenario) for agent in self.possible_agents}
        own = self.observation_spaces[self.possible_agents[0]]
        count = len(self.possible_agents)
        self.state_space = Box(np.tile(own.low, count), np.tile(own.high, count))
        self._picture = Picture(self.simulation) if render_mode else None
        self._begun = False

    def observation_space(self, agent: str) -> Box:
        """The same object at each call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box:
        """The same object at each call."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Begin an episode: of ``seed`` its first, without a seed the next one. ``options`` has no keys."""
        if seed is None and not self._begun:
            seed = int(np.random.default_rng().integers(LARGEST_DRAWN_SEED))
        self.simulation.reset(seed)
        self._begun = True
        self.agents = list(self.possible_agents)
        self._show()
        return self._observations(), self._infos()

    def step(
        self, actions: dict[str, np.ndarray]
    ) -> tuple[
        dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:  # fmt: skip
        """Steer all vehicles for one time step.

        Raises:
            ValueError: where an agent has no action, or somebody has one who is no agent.
        """
        if not self._begun:
            raise ResetNeeded("call reset before step")
        if not self.agents:
            raise ResetNeeded("the episode has ended; call reset")
        if set(actions) != set(self.agents):
            missing, strange = sorted(set(self.agents) - set(actions)), sorted(set(actions) - set(self.agents))
            what = f"no action for {missing[0]}" if missing else f"an action for {strange[0]!r}"
            raise ValueError(f"{what}: the agents are {', '.join(self.agents)}")
        simulation = self.simulation
        simulation.step(np.stack([np.asarray(actions[agent], np.float32) for agent in self.possible_agents])[np.newaxis])
        rewards = dict(zip(self.agents, simulation.reward[0].tolist(), strict=True))
        ended = bool(simulation.worlds.clock["step"][0] >= self.max_cycles)
        observations, infos = self._observations(), self._infos()
        terminations, truncations = dict.fromkeys(self.agents, False), dict.fromkeys(self.agents, ended)
        self._show()
        if ended:
            self.agents = []
        return observations, rewards, terminations, truncations, infos

    def state(self) -> np.ndarray:
        """(V * D,) float32: the observations of all vehicles."""
        return self.simulation.observation[0].ravel().copy()

    def _observations(self) -> dict[str, np.ndarray]:
        return {agent: self.simulation.observation[0, v].copy() for v, agent in enumerate(self.agents)}

    def _infos(self) -> dict[str, dict[str, Any]]:
        outcomes = self.simulation.outputs.outcomes[0]
        names = {"localization_error": "error", "range": "range", "separation": "separation"}
        return {
            agent: {name: float(outcomes[v][own]) for name, own in names.items()} | {"detected": int(outcomes[v]["heard"])}
            for v, agent in enumerate(self.agents)
        }

    def _show(self) -> None:
        if self._picture is not None:
            self._picture.follow()
            if self.render_mode == "human":
                self._picture.show()

    def render(self) -> np.ndarray | None:
        """The picture (H, W, 3) uint8 in mode ``rgb_array``; ``human`` shows every step by itself."""
        return self._picture.paint() if self._picture is not None and self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window and end the simulation's threads."""
        if self._picture is not None:
            self._picture.close()
        self.simulation.close()


def _in_formation(task: Task, formation: str | None) -> Task:
    if formation is None:
        return task
    if formation.upper() not in Formation.__members__:
        raise ValueError(f"formation must be one of {', '.join(Formation.__members__).lower()}, got {formation!r}")
    start = replace(task.scenario.start, formation=Formation[formation.upper()])
    return task._replace(scenario=replace(task.scenario, start=start))


parallel_env = TagTrackParallelEnv


def env(*arguments: Any, **options: Any) -> AECEnv[str, np.ndarray, np.ndarray]:
    """The same for PettingZoo's turn-by-turn API (``AECEnv``), by PettingZoo's own conversion."""
    return parallel_to_aec(parallel_env(*arguments, **options))
