"""The Gymnasium environment: one world, steered by one action. The world itself is in ``simulation.py``.

One vehicle and one tag is the rule, and has its own quick way to the info; several vehicles are steered together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np

from tagtrack.envs.measurement import Status
from tagtrack.envs.rendering import FRAMES_PER_SECOND, Picture
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.spaces import action_space, observation_space, team_space
from tagtrack.envs.specification import limit_asked_of_make, plain_spec
from tagtrack.envs.task import Task, TaskOptions, build_task, episode_limit
from tagtrack.envs.telling import LONE, all_have_left, lone_reward, lone_sources, team_reward, tell, tell_lone, term_names
from tagtrack.envs.validation import as_actions

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec
    from typing_extensions import Unpack

LARGEST_DRAWN_SEED = 2**31
HEARD = int(Status.HEARD)


class TagTrackEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """An AUV with a stereo hydrophone follows a fish that carries an acoustic tag (Clark et al. 2013).

    The tag pings every 2 s. Of a ping that both hydrophones hear, the vehicle reads a coarse bearing whose side, port
    or starboard, is unknown, and a signal strength that says little about distance. A particle filter turns the
    readings into a belief about where the fish is; how good it becomes depends on the vehicle's path, and that is what
    a policy decides. Losses come in bursts, so the fish can be lost. One step is 2 s, an episode 10 minutes.

    * ``TagTrack/LeopardShark-v0``: keep the localization error low.
    * ``TagTrack/LeopardSharkStandoff-v0``: the same, without coming nearer than 20 m; the action sets the speed, too.

    * ``TagTrack/Glider-v0``: a vehicle of 0.8 m/s after a fish that may swim as fast: a wrong turn is not made good again.
    * ``TagTrack/GliderPair-v0``: two vehicles of 0.5 m/s, steered together, among four fish (see "Several tags" below).

    ``preset="surf_zone"`` of the first is a second water: sound carries 80 m in place of 100, bursts of losses take 40 % of the
    time in place of 20 and last twice as long.

    ## Observation

    ``Box(21,)`` float32. It holds what the vehicle knows, never the truth. The estimate is what the
    particle filter reports: the mean of its particles, or the best one; its bearing is from the vehicle, relative to the
    compass heading.

    | index | name | meaning | range |
    |---|---|---|---|
    | 0 | distance | to the estimate / 50 m | 0 to 10 |
    | 1 | log_distance | ln((distance + 1 m) / 15 m) | -3 to 4 |
    | 2 | bearing_cos | of the estimate's bearing relative to the heading | -1 to 1 |
    | 3 | bearing_sin | the same; positive to port | -1 to 1 |
    | 4 | log_spread_along | ln(standard deviation along the line of sight / 5 m) | -4 to 5 |
    | 5 | log_spread_across | the same across it | -4 to 5 |
    | 6 | spread_correlation | between along and across | -1 to 1 |
    | 7 | port_balance | share of particles to port minus share to starboard | -1 to 1 |
    | 8 | silence | ln(1 + time since the last detection / 1 s) / 2 | 0 to 5 |
    | 9 | last_units | last bearing reading / 9 Lotek units; 0 before the first | -1 to 1 |
    | 10 | last_strength | last signal strength / 50; 0 before the first | -2 to 4 |
    | 11 | heard_lately | share of pings heard, average over some 5 pings | 0 to 1 |
    | 12 | heard_long | the same over some 33 pings | 0 to 1 |
    | 13 | velocity_along | of the belief along the line of sight, average over some 20 s / 0.25 m/s | -8 to 8 |
    | 14 | velocity_across | the same across it, positive to the left of the line | -8 to 8 |
    | 15 | bearing_cos_lately | bearing_cos, average over some 20 s | -1 to 1 |
    | 16 | bearing_sin_lately | bearing_sin, average over some 20 s | -1 to 1 |
    | 17 | ping_phase | time since the tag last pinged / its period; -1 before it was heard | -1 to 1 |
    | 18 | heading_cos | of the compass heading | -1 to 1 |
    | 19 | heading_sin | the same | -1 to 1 |
    | 20 | speed | through the water / largest speed | 0 to 1 |

    ## Action

    ``Box(2,)`` float32 in [-1, 1], or ``Box(3,)`` where the scenario lets the speed vary (``speed_control``, as
    Standoff does). The first two are the desired course as a vector, of which only the direction counts.

    | index | name | meaning |
    |---|---|---|
    | 0 | ahead | its part along the line from the vehicle to the estimate |
    | 1 | port | its part to the left of that line; (0, 0) means straight on to it |
    | 2 | speed | from rest (-1) to full speed (1) |

    ## Reward

    The sum of the weighted terms, each also in the info (``info["reward_localization"]`` ...):

    * ``localization``: minus the localization error as a share of 100 m, at least -1;
    * ``standoff``: minus the share of the perimeter that the vehicle has intruded (0 in LeopardShark, which has none).

    ## Ending

    An episode terminates when the battery is empty, where there is one (``vehicle.battery``). It is truncated
    after the scenario's ``episode_steps`` (300), which ``overrides={"episode_steps": 600}`` changes, or after as many steps, more
    or fewer, as ``gym.make``'s ``max_episode_steps`` says.

    ## Info

    The same keys after ``reset`` and ``step``, flat, each a numpy array or number: ``localization_error`` [m], ``range`` from
    vehicle to fish [m], ``detected`` (a usable signal came in at this step), ``belief_mean`` (2,) [m], ``belief_covariance``
    (2, 2) [m^2], ``battery`` (the share that is left, where there is one), ``vehicle_position`` (2,) where the vehicle believes
    it is [m], and ``reward_localization``, ``reward_standoff`` ... of each term of the reward, 0 after a reset. Of the truth,
    which no policy may see: ``true_vehicle_position`` and ``true_fish_position`` (2,) [m], as error and range are.

    ## Several tags, several vehicles

    With ``tags=T`` the observation holds a row for each tag, and courses are relative to the vehicle's own heading
    (``overrides={"steer_by": "chosen"}``: to the line to a tag that the action chooses). The error counts as the mean over the
    tags, ``range`` is that to the nearest fish; ``detected`` (T,), ``belief_mean`` (T, 2), ``belief_covariance`` (T, 2, 2)
    and ``true_fish_position`` (T, 2) are of each tag.

    With ``vehicles=V`` one action steers all: observation (V, D), action (V, A), the reward is the mean over the vehicles that
    take part. Values of the info but ``true_fish_position`` get a first axis (V,), and ``separation`` from the nearest other
    vehicle [m], ``encroachments``, ``messages``, ``received`` and ``active`` (whether it still takes part) are among them. A
    vehicle whose battery is empty leaves, its observation is 0 from then on; the episode terminates when all have left. Rows and
    messages are documented in ``tagtrack.envs.parallel.TagTrackParallelEnv``, where each vehicle is an agent of its own.

    ## Seeds

    ``reset(seed=s)`` begins the first episode of seed ``s``; ``reset()`` goes on to the next one of the same seed
    (before any seed was given, of one drawn at random). The fish swims the same whatever the vehicle does.

    ## Arguments

    Args:
        env_id: whose scenario; ``gym.make`` fills it in.
        preset: other people's settings of the task by their name (``RangeOnly`` has some), instead of the id's own.
        particles: particles of the belief (default 1000).
        tracks: csv file (``t_unix_s,x,y``, metres; of several animals with a column ``tag``) of recorded tracks. Each episode the
            fish swims another stretch of one of them, never across a gap of more than ``fish.longest_gap`` (900 s).
        time_scale: how fast it swims them; 0.5 is half the recorded speed.
        overrides: any parameter of the scenario by its dotted name: ``{"water.noisy_share": 0.3, "belief": "levy"}``.
        scenario: a whole ``Scenario`` instead of the id's.
        vehicles: how many, 1 to 20 (default 1); see above.
        tags: how many tagged fish, 1 to 20 (default 1).
        modem: what several vehicles may tell one another: ``"perfect"``, ``"none"``, ``"instant"`` or ``"tdma"``.
        render_mode: ``"rgb_array"``, ``"human"`` or None (needs ``pip install "tagtrack[render]"``).

    ## Version history

    * v0: the first version; it may still change before the first release (see CHANGELOG.md).
    """

    default_id: ClassVar[str] = "TagTrack/LeopardShark-v0"
    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": FRAMES_PER_SECOND}

    def __init__(
        self,
        env_id: str | Task | None = None,
        *,
        render_mode: str | None = None,
        **options: Unpack[TaskOptions],
    ) -> None:
        task = build_task(env_id or self.default_id, **options)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode must be None, 'rgb_array' or 'human', got {render_mode!r}")
        self.task = task
        self.render_mode = render_mode
        self.simulation = Simulation(task.scenario, tracks=task.tracks)
        vehicles = task.scenario.vehicles
        self.observation_space = team_space(observation_space(task.scenario), vehicles)
        self.action_space = team_space(action_space(task.scenario), vehicles)
        self._is_lone = vehicles == 1 and task.scenario.targets == 1 and task.scenario.vehicle.battery == 0
        self._own = (0, 0) if vehicles == 1 else (0,)  # where the world's rows are in the simulation's arrays
        self._lifted = (np.newaxis,) * len(self._own)
        self._terms = term_names(self.simulation)
        # Kept, for looking them up costs.
        self._outputs, self._measurements = self.simulation.outputs, self.simulation.worlds.measurements
        self._sources = lone_sources(self.simulation)
        self._picture = Picture(self.simulation) if render_mode else None
        self.episode_limit = task.scenario.episode_steps
        self._spec: EnvSpec | None = None
        self._begun = False

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]
        """Gymnasium's specification: ``spec.to_json()`` makes the same environment again, whatever options it was made with."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = plain_spec(spec)
        asked = limit_asked_of_make()
        if asked is not None:
            self.episode_limit = episode_limit(self.simulation.scenario, asked)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode: of ``seed`` its first, without a seed the next one. ``options`` has no keys."""
        super().reset(seed=seed)
        if seed is None and not self._begun:
            seed = int(self.np_random.integers(LARGEST_DRAWN_SEED))
        self.simulation.reset(seed)
        self._begun = True
        self._show()
        return self._outputs.observation[self._own].copy(), self._info(stepped=False)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Steer for one time step (see the class)."""
        if not self._begun:
            raise gymnasium.error.ResetNeeded("call reset before step")
        simulation = self.simulation
        simulation.step(as_actions(action)[self._lifted])
        info = self._info(stepped=True)
        if self._is_lone:
            reward, terminated = lone_reward(self._outputs.terms[0, 0]), False
        else:
            reward, terminated = float(team_reward(simulation)[0]), bool(all_have_left(simulation)[0])
        truncated = bool(simulation.worlds.clock["step"][0] >= self.episode_limit)
        self._show()
        return self._outputs.observation[self._own].copy(), reward, terminated, truncated, info

    def _info(self, *, stepped: bool) -> dict[str, Any]:
        """Flat, the same keys after reset and step, and all of numpy: other libraries stack infos by key, shape and dtype."""
        if not self._is_lone:
            return {name: _own(values[0]) for name, values in tell(self.simulation, np.array([stepped])).items()}
        told = tell_lone(self._sources)
        if not stepped:
            told[LONE:] = 0.0
        info = {
            "localization_error": told[0],
            "range": told[1],
            "detected": np.array(self._measurements["status"].item() == HEARD),
            "belief_mean": told[2:4],
            "belief_covariance": told[4:8].reshape(2, 2),
            "vehicle_position": told[8:10],
            "true_vehicle_position": told[10:12],
            "true_fish_position": told[12:14],
        }
        for place, name in enumerate(self._terms, LONE):
            info[name] = told[place]
        return info

    def _show(self) -> None:
        if self._picture is not None:
            self._picture.follow()
            if self.render_mode == "human":
                self._picture.show()

    def render(self) -> np.ndarray | None:
        """The picture (H, W, 3) uint8 in mode ``rgb_array``; ``human`` shows every step by itself."""
        if self._picture is not None and not self._begun:
            raise gymnasium.error.ResetNeeded("call reset before render")
        if self._picture is None:
            gymnasium.logger.warn('nothing to show: make the environment with render_mode="rgb_array" or "human"')
        return self._picture.paint() if self._picture is not None and self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window and end the simulation's threads."""
        if self._picture is not None:
            self._picture.close()
        self.simulation.close()


def _own(value: Any) -> Any:
    """A value of an info; bool alone is an array without axes, for Gymnasium's vectors make objects of numpy's own."""
    return np.array(value) if isinstance(value, np.bool_) else value
