"""The belief's half of one world: what ``Simulation`` holds, without the world."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from tagtrack.envs.belief.filter import KEY, ParticleFilter, Rows
from tagtrack.envs.belief.row import make_scratch
from tagtrack.envs.kernels.random import place_of
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import NAVIGATION
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.workers import Workers
from tagtrack.envs.world import observe_worlds, order_worlds
from tagtrack.envs.world_rule import world_rule


class Believer(Simulation):
    """One vehicle's beliefs, one for each tag, and what it sees of them; there is no fish, and nothing steps by itself.

    What policies are made for: ``observation``, ``worlds`` but for the truth, ``listeners``, ``mean`` ... are those of a
    ``Simulation`` of one world. Given the same navigation and measurements they are the same bit for bit.

    Args:
        scenario: of one vehicle. remember: steps that can be gone back to for what comes late.
    """

    def __init__(self, scenario: Scenario, *, remember: int) -> None:
        if scenario.vehicles != 1:
            raise ValueError(f"a tracker is one vehicle's, got vehicles={scenario.vehicles}; give each a tracker of its own")
        super().__init__(dataclasses.replace(scenario, fish=scenario.belief.motion))
        worlds, belief = self.worlds, scenario.belief
        self.filters: list[ParticleFilter] = []
        for t in range(scenario.targets):
            tag = slice(t, t + 1)
            state = Rows(
                key=np.zeros(1, KEY),
                particles=worlds.particles[0, 0, tag],
                carried=worlds.carried[0, 0, tag],
                beliefs=worlds.beliefs[0, 0, tag],
                listeners=worlds.listeners[0, 0, tag],
                about=np.zeros(1, NAVIGATION),
            )
            tags = [t]
            self.filters.append(ParticleFilter(belief, scenario.tag, tags=tags, remember=remember, state=state))
        self._orders = np.zeros((1, 1, 2))

    def _connect(self) -> None:
        """Only what beliefs need is compiled."""
        self._rule = to_record(world_rule(self.scenario))
        self._workers = Workers(1, 1, lambda: make_scratch(self.scenario.belief.particles))

    def reset(self, seed: int | Sequence[int] | None = None, mask: np.ndarray | None = None) -> np.ndarray:
        raise RuntimeError("a believer begins where its vehicle is; call begin")

    def step(self, actions: np.ndarray) -> None:
        raise RuntimeError("a believer is told measurements; there is no world to step")

    def begin(self, x: float, y: float, *, seed: int, episode: int) -> None:
        """First particles about the vehicle, whose navigation has been set."""
        self.worlds.clock[0] = (seed, episode, 0)
        for t, each in enumerate(self.filters):
            each.begin(x, y, seed=seed, episode=episode, place=place_of(0, t))
        self.look()

    def look(self) -> None:
        """Bring the observation up to date; once a step."""
        self._workers.run(observe_worlds, self._rule, self.worlds, self.outputs)

    def order(self, action: np.ndarray) -> tuple[float, float]:
        """Course [rad] and speed [m/s] of an action (A,)."""
        self._actions[0, 0] = action
        self._workers.run(order_worlds, self._rule, self._actions, self.worlds, self._orders)
        course, speed = self._orders[0, 0]
        return float(course), float(speed)

    @property
    def navigation(self) -> Any:
        """The record of what the vehicle believes of itself."""
        return self.worlds.navigation[0, 0]
