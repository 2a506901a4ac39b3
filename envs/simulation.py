"""The batched core: the only holder of state. Every shell (Gymnasium, vector, Stable-Baselines3, PettingZoo) is a view of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tagtrack.envs.belief.row import make_scratch
from tagtrack.envs.belief.summary import covariance
from tagtrack.envs.exchange import exchange_worlds
from tagtrack.envs.feature import Feature
from tagtrack.envs.kernels.action_loops import find_broken_action
from tagtrack.envs.kernels.binding import bind
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.layout import action_names, features
from tagtrack.envs.measurement import Status
from tagtrack.envs.motions import Replay
from tagtrack.envs.motions.replay import NO_TRACKS, TrackTable, make_table
from tagtrack.envs.motions.tracks import Track
from tagtrack.envs.rewards.term import OUTCOME
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.validation import brief, whole_number
from tagtrack.envs.workers import Workers
from tagtrack.envs.world import reset_worlds, step_worlds
from tagtrack.envs.world_rule import world_rule
from tagtrack.envs.world_state import Outputs, make_worlds

LARGEST_SEED = 2**63 - 1
# What a copy, or a pickle in another process, makes for itself.
CONNECTIONS = {
    "_workers", "_reset_arguments", "_step_arguments", "_exchange_arguments", "_exchange_worlds", "_reset_worlds", "_step_worlds",
}  # fmt: skip


class Simulation:
    """B worlds of one scenario, stepped together.

    Arrays that it hands out (``observation``, ``reward``, ``worlds`` ...) are its own and change with the next step: copy what
    you keep. World ``i`` has seed ``seed + i``; its episodes are numbered from 0. The same (seed, episode) gives the same
    numbers bit for bit, alone, in any batch and on any number of threads, and the fish swims the same whatever the vehicle does.

    Args:
        scenario: what is simulated. num_worlds: B. threads: worlds are split among so many.
        tracks: recorded tracks, one for each animal, for a scenario whose fish is a ``Replay``.
    """

    def __init__(
        self, scenario: Scenario, num_worlds: int = 1, *, threads: int = 1, tracks: Sequence[Track] | None = None
    ) -> None:
        for name, value in (("num_worlds", num_worlds), ("threads", threads)):
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
                raise ValueError(f"{name} must be a whole number of at least 1, got {value!r}")
        self.scenario = scenario
        self.num_worlds = int(num_worlds)
        self.threads = min(int(threads), self.num_worlds)
        self.features: tuple[Feature, ...] = features(scenario)
        self.action_names = action_names(scenario)
        self._tracks = _track_table(scenario, tracks)
        self._places = np.array(scenario.start.places(scenario.vehicles))
        b, v, t, o = self.num_worlds, scenario.vehicles, scenario.targets, scenario.owners
        self.worlds = make_worlds(b, v, t, o, scenario.belief, world_rule(scenario).modem)
        self.outputs = Outputs(
            observation=np.zeros((b, v, len(self.features)), np.float32),
            terms=np.zeros((b, v, len(scenario.reward.names))),
            error=np.zeros((b, o, t)),
            outcomes=np.zeros((b, v), OUTCOME),
        )
        self._begun = np.zeros(b, bool)
        self._ready = False  # whether all have begun
        self._actions = np.zeros((b, v, len(self.action_names)), np.float32)
        self._chosen = np.zeros(b, bool)
        self._connect()

    def _connect(self) -> None:
        """Make what is good for this object in this process alone: threads, addresses, compiled code for the arrays."""
        b, particles = self.num_worlds, self.scenario.belief.particles
        parameters = to_record(world_rule(self.scenario))
        self._workers = Workers(b, self.threads, lambda: make_scratch(particles))
        self._reset_arguments = (self._chosen, parameters, self._tracks, self._places, self.worlds, self.outputs)
        self._step_arguments = (parameters, self._tracks, self._actions, self.worlds, self.outputs)
        self._exchange_arguments = (parameters, self._actions, self.worlds)
        kernels = {reset_worlds: self._reset_arguments, step_worlds: self._step_arguments}
        if self.scenario.modem.talks:
            kernels = {exchange_worlds: self._exchange_arguments, **kernels}
        calls = [(kernel, 0, b, *arguments, self._workers.scratch[0]) for kernel, arguments in kernels.items()]
        *exchange, self._reset_worlds, self._step_worlds = bind(*calls)
        self._exchange_worlds = exchange[0] if exchange else None

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in CONNECTIONS}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._connect()

    def reset(self, seed: int | Sequence[int] | None = None, mask: np.ndarray | None = None) -> np.ndarray:
        """Begin a new episode: of ``seed`` its first, without a seed the next one (before any seed was given, of seed 0).

        Args:
            seed: of world 0 (world i gets seed + i), or one for each world.
            mask: (B,) bool, the worlds to reset; all if None.
        Returns:
            (B, V, D) float32 observation, of which only the chosen worlds' rows are new.
        """
        if mask is not None and np.shape(mask) != (self.num_worlds,):
            raise ValueError(f"mask must have shape ({self.num_worlds},), got {np.shape(mask)}")
        chosen = self._chosen
        chosen[...] = True if mask is None else mask
        clock = self.worlds.clock
        fresh = chosen if seed is not None else chosen & ~self._begun
        clock["episode"][chosen & ~fresh] += np.uint64(1)
        clock["seed"][fresh] = self._seeds(0 if seed is None else seed)[fresh]
        clock["episode"][fresh] = 0
        self._begun |= chosen
        self._ready = bool(self._begun.all())
        self._workers.run(self._reset_worlds, *self._reset_arguments)
        return self.outputs.observation

    def _seeds(self, seed: int | Sequence[int]) -> np.ndarray:
        if isinstance(seed, (Sequence, np.ndarray)) and not isinstance(seed, (str, bytes)):
            seeds = [whole_number(each, "a seed") for each in seed]
        else:
            seeds = [whole_number(seed, "seed") + i for i in range(self.num_worlds)]
        if len(seeds) != self.num_worlds:
            raise ValueError(f"there must be one seed for each of {self.num_worlds} worlds, got {len(seeds)}")
        if not 0 <= min(seeds) <= max(seeds) <= LARGEST_SEED:
            raise ValueError(f"seeds must be from 0 to {LARGEST_SEED}, got {brief(min(seeds))} to {brief(max(seeds))}")
        return np.array(seeds, np.uint64)

    def step(self, actions: np.ndarray) -> None:
        """Advance all worlds by one time step under ``actions`` (B, V, A) in [-1, 1] (values beyond are clipped).

        Raises:
            ValueError: for another shape, or a NaN or infinity among the actions.
            RuntimeError: for a world that was never reset.
        """
        if not self._ready:
            raise RuntimeError(f"world {int(np.argmin(self._begun))} has no episode to step; call reset first")
        if np.shape(actions) != self._actions.shape:
            raise ValueError(f"actions must have shape {self._actions.shape}, got {np.shape(actions)}")
        self._actions[...] = actions
        world = find_broken_action(self._actions)
        if world >= 0:
            raise ValueError(f"actions must be finite, got {self._actions[world].tolist()} for world {world}")
        if self._exchange_worlds is not None:
            self._workers.run(self._exchange_worlds, *self._exchange_arguments)
        self._workers.run(self._step_worlds, *self._step_arguments)

    @property
    def observation(self) -> np.ndarray:
        """(B, V, D) float32."""
        return self.outputs.observation

    @property
    def reward(self) -> np.ndarray:
        """(B, V) sum of the weighted terms of the last step."""
        return self.outputs.terms.sum(axis=-1)

    @property
    def reward_terms(self) -> dict[str, np.ndarray]:
        """The weighted terms of the last step by name, each (B, V)."""
        return {name: self.outputs.terms[..., k] for k, name in enumerate(self.scenario.reward.names)}

    @property
    def error(self) -> np.ndarray:
        """(B, O, T) distance from estimate to true fish [m]."""
        return self.outputs.error

    @property
    def range(self) -> np.ndarray:
        """(B, V, T) true distance from vehicle to fish [m]."""
        return self.worlds.encounters["range"]

    @property
    def detected(self) -> np.ndarray:
        """(B, V, T) whether a usable signal came in at the last step."""
        return self.worlds.measurements["status"] == int(Status.HEARD)

    @property
    def listeners(self) -> np.ndarray:
        """(B, V, T) of ``LISTENER``: what each vehicle remembers of its own listening."""
        kept = self.worlds.listeners  # (B, O, T, V)
        if self.scenario.owners == 1:
            return kept[:, 0].swapaxes(1, 2)
        each = np.arange(self.scenario.vehicles)
        return kept[:, each, :, each].swapaxes(0, 1)

    @property
    def mean(self) -> np.ndarray:
        """(B, O, T, 2) mean of the particles [m]."""
        return np.stack([self.worlds.beliefs["mean_x"], self.worlds.beliefs["mean_y"]], axis=-1)

    @property
    def estimate(self) -> np.ndarray:
        """(B, O, T, 2) what the filter reports: the mean or the best particle [m]."""
        return np.stack([self.worlds.beliefs["estimate_x"], self.worlds.beliefs["estimate_y"]], axis=-1)

    @property
    def covariance(self) -> np.ndarray:
        """(B, O, T, 2, 2) covariance of the particles [m^2]."""
        return covariance(self.worlds.beliefs)

    @property
    def fish_position(self) -> np.ndarray:
        """(B, T, 2) true positions [m], float32."""
        return self.worlds.fish[:, :, :2, 0]

    @property
    def vehicle_position(self) -> np.ndarray:
        """(B, V, 2) true positions [m]."""
        return np.stack([self.worlds.vehicles["x"], self.worlds.vehicles["y"]], axis=-1)

    def save_state(self) -> tuple[np.ndarray, ...]:
        """A copy of the whole state, for ``load_state``."""
        return tuple(array.copy() for array in (*self.worlds, *self.outputs, self._begun))

    def load_state(self, state: tuple[np.ndarray, ...]) -> None:
        """Return to a state that ``save_state`` gave (of a simulation of the same shape)."""
        for own, saved in zip((*self.worlds, *self.outputs, self._begun), state, strict=True):
            np.copyto(own, saved)
        self._ready = bool(self._begun.all())

    def close(self) -> None:
        """End the threads."""
        self._workers.close()
        self.threads = 1


def _track_table(scenario: Scenario, tracks: Sequence[Track] | None) -> TrackTable:
    if isinstance(scenario.fish, Replay):
        if tracks is None:
            raise ValueError("a scenario with a replayed fish needs a track; give tracks=FILE")
        return make_table(tuple(tracks), scenario.fish, scenario.time_step, scenario.episode_steps)
    if tracks is not None:
        raise ValueError(f"a track was given, but the fish moves by {type(scenario.fish).__name__}; make it a Replay")
    return NO_TRACKS
