"""The PettingZoo environment: one world, several vehicles, each an agent. The world itself is in ``simulation.py``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils import parallel_to_aec

import tagtrack
from tagtrack.envs.rendering import FRAMES_PER_SECOND, Picture
from tagtrack.envs.scenario import Formation
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import LARGEST_DRAWN_SEED
from tagtrack.envs.spaces import action_space, observation_space
from tagtrack.envs.task import Task, TaskOptions, build_task, episode_limit
from tagtrack.envs.telling import tell_fish, tell_vehicles
from tagtrack.envs.validation import as_actions, brief

if TYPE_CHECKING:
    from typing_extensions import Unpack


class TagTrackParallelEnv(ParallelEnv[str, np.ndarray, np.ndarray]):
    """Several AUVs track one or several tagged fish of one of the suite's tasks.

    Agents are ``auv_0``, ``auv_1`` ... With one vehicle and one tag it is ``TagTrackEnv`` bit for bit, and whatever one more
    vehicle or tag does, the fish, pings and readings of the others stay.

    ## Observation

    Of each agent a ``Box(D,)`` float32, what this vehicle knows and nothing else, block after block:

    * a row of features for each tag, ``tag_0.distance`` ..., as in the task's Gymnasium environment, and with teammates one more,
      ``mate_log_distance``: how near the nearest known teammate is to this tag's estimate;
    * a row for each teammate by its number, itself left out, ``mate_0.known`` ...: whether anything is known of it, how old that
      is (``log_age``), and where it was then, relative to the own place and heading. All 0 where nothing is known;
    * the vehicle itself, ``heading_cos`` ...; also ``battery``, ``slot_phase`` and ``waiting`` (modem), ``border``,
      ``inward_cos`` and ``inward_sin`` (arena), each where there is one.

    ``tagtrack.envs.layout.features(scenario)`` lists names, meanings and ranges; ``split_observation(observation, scenario)``
    gives ``own``, ``tags`` and ``mates`` as sets with ``tag_mask`` and ``mate_mask``. ``state()`` is the observations of all
    possible agents, one after the other, zeros for those that have left; its length never changes.

    ## Action

    Of each agent a ``Box(A,)`` float32 in [-1, 1]:

    | name | meaning | where |
    |---|---|---|
    | ahead, port | the desired course as a vector, of which only the direction counts; (0, 0) is straight on | always |
    | speed | from rest (-1) to full speed (1) | ``speed_control`` |
    | tag_0, tag_1 ... | the largest one says which tag's line the course is relative to | ``steer_by="chosen"`` |
    | message | above 0: send in the next own slot | ``message_control`` |

    The course is relative to the line from the vehicle to the estimate where there is one tag, to the vehicle's own heading where
    there are several; ``overrides={"steer_by": "line"}``, ``"heading"`` or ``"chosen"`` decides otherwise.

    ## Reward

    To each agent its own, as in the task's Gymnasium environment; the localization error is the mean over the tags, or the worst
    one's (``reward.over_tags="worst"``). ``reward.separation`` is the weight of coming nearer to another vehicle than
    ``reward.least_separation``, ``reward.message`` the price of a message; ``reward.shared=True`` gives everybody the mean over
    those that take part.

    ## Messages, batteries, arena, bursts

    * ``modem="perfect"``: one belief for all, of all that any vehicle hears. ``"none"``: each has its own and knows nothing of
      the others. ``"instant"``: each has its own, and all tell all at each step but for losses. ``"tdma"``: each has its own,
      and packets of pose and measurements travel in turn, at the speed of sound, and may be lost or late (``modem.slot``,
      ``modem.loss`` ...); late ones change the belief as if they had come in time.
    * ``vehicle.battery`` [Wh] above 0: a vehicle whose battery is empty leaves.
    * ``vehicle.arena`` [m] above 0: a vehicle farther from the origin turns back of itself, whatever its action says.
    * ``tag.burst`` [s] above 0: pings that come to a vehicle at once destroy one another.

    ## Ending

    An agent whose battery is empty is terminated in that step, with its last reward and info and an observation of zeros;
    afterwards it is no longer among ``agents`` and takes no action. All that are left are truncated after ``max_cycles``.

    ## Info

    Of each agent ``localization_error`` (mean over the tags) [m], ``range`` to the nearest fish and ``separation`` from the
    nearest other vehicle that takes part, infinite without one [m], ``encroachments``: how often in the episode it came nearer
    than ``reward.least_separation`` to another one, ``detected``: how many tags it heard in this step, ``messages`` sent and
    ``received`` in the episode, ``battery``, the share that is left, where there is one, and ``vehicle_position`` (2,), where it
    believes it is [m]. Of the truth, which no policy may see: ``true_vehicle_position`` (2,), ``true_fish_position`` (T, 2) [m].

    Args:
        env_id: of ours, or one that somebody registered; or a ``Task``.
        vehicles, tags: how many of each, 1 to 20; those of the scenario if None.
        modem: what the vehicles may tell one another (``"perfect"``, ``"none"``, ``"instant"``, ``"tdma"``); the scenario's if
            None (perfect).
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
            "name": _NAMES.get(task.env_id, task.env_id).rpartition("/")[2],
            "render_modes": ["rgb_array", "human"],
            "render_fps": FRAMES_PER_SECOND,
            "is_parallelizable": True,
        }
        if render_mode not in (None, "rgb_array", "human"):
            raise ValueError(f"render_mode must be None, 'rgb_array' or 'human', got {render_mode!r}")
        self.render_mode = render_mode
        self.simulation = Simulation(task.scenario, tracks=task.tracks)
        self.possible_agents = [f"auv_{v}" for v in range(task.scenario.vehicles)]
        self._places = {agent: v for v, agent in enumerate(self.possible_agents)}
        self.agents: list[str] = []
        self.max_cycles = episode_limit(task.scenario, max_cycles, "max_cycles")
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
        """Steer all agents for one time step.

        Raises:
            ValueError: where an agent has no action, or somebody has one who is no agent or has left.
        """
        simulation, agents = self.simulation, self.agents
        simulation.step(self._gather(actions)[np.newaxis])
        places = [self._places[agent] for agent in agents]
        reward, active = simulation.reward[0], simulation.worlds.navigation["active"][0]
        ended = bool(simulation.worlds.clock["step"][0] >= self.max_cycles)
        observations, infos = self._observations(), self._infos()
        rewards = {agent: float(reward[v]) for agent, v in zip(agents, places, strict=True)}
        terminations = {agent: not active[v] for agent, v in zip(agents, places, strict=True)}
        self._show()
        self.agents = [] if ended else [agent for agent in agents if not terminations[agent]]
        return observations, rewards, terminations, dict.fromkeys(agents, ended), infos

    def _gather(self, actions: dict[str, np.ndarray]) -> np.ndarray:
        """(V, A) actions of all vehicles; those that have left rest."""
        if not self._begun:
            raise ResetNeeded("call reset before step")
        if not self.agents:
            raise ResetNeeded("the episode has ended; call reset")
        present = ", ".join(self.agents)
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions must map agents to arrays, got {type(actions).__name__}; the agents are {present}")
        for agent in self.agents:
            if agent not in actions:
                raise ValueError(f"no action for {agent}: the agents are {present}")
        for agent in actions:
            if agent not in self.agents:
                left = f" has left, its battery is empty; agents are still {present}"
                raise ValueError(f"an action for {agent!r}{left if agent in self._places else f': the agents are {present}'}")
        rest = np.zeros(self.action_spaces[self.possible_agents[0]].shape, np.float32)
        return np.stack([_as_action(agent, actions.get(agent, rest), rest.shape) for agent in self.possible_agents])

    def state(self) -> np.ndarray:
        """(V * D,) float32: the observations of all possible agents, zeros for those that have left."""
        return self.simulation.observation[0].ravel().copy()

    def _observations(self) -> dict[str, np.ndarray]:
        return {agent: self.simulation.observation[0, self._places[agent]].copy() for agent in self.agents}

    def _infos(self) -> dict[str, dict[str, Any]]:
        told, fish = tell_vehicles(self.simulation), tell_fish(self.simulation)[0]
        places = {agent: self._places[agent] for agent in self.agents}
        return {
            agent: {**{name: values[0, v] for name, values in told.items()}, "true_fish_position": fish.copy()}
            for agent, v in places.items()
        }

    def _show(self) -> None:
        if self._picture is not None:
            self._picture.follow()
            if self.render_mode == "human":
                self._picture.show()

    def render(self) -> np.ndarray | None:
        """The picture (H, W, 3) uint8 in mode ``rgb_array``; ``human`` shows every step by itself."""
        if self._picture is not None and not self._begun:
            raise ResetNeeded("call reset before render")
        return self._picture.paint() if self._picture is not None and self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window and end the simulation's threads."""
        if self._picture is not None:
            self._picture.close()
        self.simulation.close()


def _as_action(agent: str, action: Any, shape: tuple[int, ...]) -> np.ndarray:
    """One agent's action. Raises ValueError that names the agent."""
    try:
        found = as_actions(action)
    except ValueError:
        raise ValueError(f"the action of {agent} must be numbers, got {brief(action)}") from None
    if found.shape != shape:
        raise ValueError(f"the action of {agent} must have shape {shape}, got {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"the action of {agent} must be finite, got {found.tolist()}")
    return found


_NAMES = {env_id: name for name, env_id in tagtrack._FLEETS.items()}  # in PettingZoo


def _in_formation(task: Task, formation: str | None) -> Task:
    if formation is None:
        return task
    if str(formation).upper() not in Formation.__members__:
        raise ValueError(f"formation must be one of {', '.join(Formation.__members__).lower()}, got {formation!r}")
    start = replace(task.scenario.start, formation=Formation[formation.upper()])
    return task._replace(scenario=replace(task.scenario, start=start))


parallel_env = TagTrackParallelEnv


def env(*arguments: Any, **options: Any) -> AECEnv[str, np.ndarray, np.ndarray]:
    """The same for PettingZoo's turn-by-turn API (``AECEnv``), by PettingZoo's own conversion."""
    return parallel_to_aec(parallel_env(*arguments, **options))
