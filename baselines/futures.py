"""Imagined futures: from the state of a simulation many worlds go on, drawn from what its vehicles know, not from the truth.

The fish of a future is one of the particles and swims as the belief supposes; the tag pings on as it was heard to; where the
vehicle truly is, its compass, currents, clocks and the state of the water are drawn about what it believes. Of water, receiver
and vehicle the futures have what the scenario says. Different moves are tried in the same futures. (A teammate's own belief,
packets under way, and how deep a tag is below the vehicle are taken over as they are.)
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from tagtrack.baselines.particle_sample import sample_particles
from tagtrack.baselines.simple import Pursuit
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.policies.protocol import Policy

PARTICLES = 200  # of the filters in the futures
HELD, HORIZON = 5, 25  # pings for which a move is held, and to which futures go
SURE = 1.0  # standard errors by which another move must be better than one's own
ANGLES = tuple(math.radians(angle) for angle in (0, 45, -45, 90, -90))  # off the line to the nearest tag, of moves to try


class Futures:
    """One state at a time, with K first moves of one vehicle in the same M futures; worlds stand in the order (K, M).

    The first move is the policy's own; the others hold courses at fixed angles to the line to the estimate of the nearest tag
    and, where there are several, head for each of the others.

    Args:
        source: the simulation whose states are imagined on.
        futures: M, an even number. particles: of the filters in the futures, at most the source's.
    """

    def __init__(
        self, source: Simulation, *, futures: int = 128, particles: int = PARTICLES, threads: int = 1, seed: int = 0
    ) -> None:
        if futures < 2 or futures % 2:
            raise ValueError(f"futures must be an even number of at least 2, got {futures}")
        self.source = source
        self.scenario = _imagined(source.scenario, particles)
        self.angles = ANGLES + (0.0,) * (source.scenario.targets - 1)
        self.shape = (1 + len(self.angles), futures)
        self.simulation = Simulation(self.scenario, self.shape[0] * futures, threads=threads)
        self.simulation.reset(0)
        self._aim = Aim(scenario=self.scenario)
        self._generator = np.random.default_rng(seed)

    def close(self) -> None:
        """End the threads."""
        self.simulation.close()

    def play(
        self,
        policy: Policy,
        memory: Any,
        world: int,
        vehicle: int,
        *,
        held: int,
        steps: int,
        key: tuple[int, ...] | None = None,
    ) -> np.ndarray:
        """Error (K, M) [m], summed over the steps and averaged over beliefs, after each first move.

        Args:
            policy: made for ``simulation``; steers all vehicles, but for the move that one of them is made to hold.
            memory: its state in the source, of all worlds.
            world: of the source. vehicle: who is made to move.
            held: steps for which a move is held. steps: how far the futures go.
            key: of the draws, so that the same state has the same futures; without it each call has others.
        """
        if key is not None:
            self._generator = np.random.default_rng(key)
        simulation, fleet = self.simulation, self.scenario.vehicles
        self._imagine(world, vehicle)
        rows = np.tile(world * fleet + np.arange(fleet), simulation.num_worlds)
        state = take_rows(memory, rows, self.source.num_worlds * fleet)
        starts = np.full(len(rows), memory is None)
        moved = fleet * np.arange(self.shape[1], simulation.num_worlds) + vehicle
        angle = np.repeat(self.angles, self.shape[1])
        other = np.repeat(np.maximum(np.arange(len(self.angles)) - len(ANGLES), -1), self.shape[1])
        total = np.zeros(simulation.num_worlds)
        for step in range(steps):
            observation = simulation.observation.reshape(len(rows), -1)
            action, state = policy.predict(observation, state, starts, deterministic=True)
            starts = np.zeros(len(rows), bool)
            if step < held:
                action = np.array(action)
                action[moved] = self._aim.steer(observation[moved], action[moved], angle, other)
            simulation.step(action.reshape(simulation.num_worlds, fleet, -1))
            total += mean_error(simulation)
        return total.reshape(self.shape)

    def _imagine(self, world: int, vehicle: int) -> None:
        """Set the futures' worlds to a state of the source's, and draw anew what nobody knows."""
        simulation, source = self.simulation, self.source
        thins = source.scenario.belief.particles > self.scenario.belief.particles
        chosen = self._choose_particles(world) if thins else None
        for own, theirs in zip(simulation.worlds, source.worlds, strict=True):
            if own.size == 0:
                continue
            state = theirs[world]
            if chosen is not None and own.shape[1:] != state.shape:
                between = (1,) * (state.ndim - chosen.ndim)
                state = np.take_along_axis(state, chosen.reshape(*chosen.shape[:2], *between, -1), axis=-1)
            own[...] = state
        if thins:  # drawn by the weights that they carried
            simulation.worlds.carried[...] = 1.0
            for name in ("beliefs", "past_beliefs"):
                getattr(simulation.worlds, name)["best"] = 0
            simulation.worlds.past_carried[...] = 1.0
        simulation.outputs.observation[...] = source.outputs.observation[world]
        simulation.worlds.clock["seed"] = self._for_all(self._generator.integers(0, 2**62, self.shape[1], dtype=np.uint64))
        self._draw_vehicles(world)
        self._draw_fish(world, vehicle)
        self._draw_water(world)

    def _for_all(self, drawn: np.ndarray) -> np.ndarray:
        """(M, ...) of the futures for all worlds (K * M, ...): every move meets the same."""
        return np.broadcast_to(drawn, (self.shape[0], *drawn.shape)).reshape(-1, *drawn.shape[1:])

    def _choose_particles(self, world: int) -> np.ndarray:
        """(O, T, n) particles that stand for all of each belief, its best one first."""
        count, best = self.scenario.belief.particles, self.source.worlds.beliefs["best"][world]
        owner, tag = (part.ravel() for part in np.indices(best.shape))
        chosen = np.empty((owner.size, count), np.int64)
        chosen[...] = sample_particles(self.source.worlds, np.full_like(owner, world), owner, tag, count)
        chosen[:, 0] = best.ravel()
        return chosen.reshape(*best.shape, count)

    def _draw_vehicles(self, world: int) -> None:
        """Where vehicles truly are and look: about what they believe, by the errors of fix, reckoning and compass."""
        rule, generator, futures = self.scenario.vehicle, self._generator, self.shape[1]
        known = self.source.worlds.navigation[world]
        true = np.repeat(self.source.worlds.vehicles[world][None], futures, axis=0)
        sigma = np.sqrt(rule.fix_sigma**2 + rule.drift_sigma**2 * true["since_fix"])
        for axis in ("x", "y"):
            true[axis] = known[axis] + sigma * generator.standard_normal(sigma.shape)
        true["compass_bias"] = rule.compass_bias * generator.standard_normal(sigma.shape)
        noise = rule.compass_sigma * generator.standard_normal(sigma.shape)
        true["heading"] = known["heading"] - true["compass_bias"] - noise
        speed = rule.random_current * generator.random((futures, 1))
        direction = 2.0 * math.pi * generator.random((futures, 1))
        true["current_x"], true["current_y"] = speed * np.cos(direction), speed * np.sin(direction)
        self.simulation.worlds.vehicles[...] = self._for_all(true)

    def _draw_fish(self, world: int, vehicle: int) -> None:
        """Fish are particles of the belief of who is made to move; their tags ping on as that has heard them."""
        source, futures, generator = self.source.worlds, self.shape[1], self._generator
        owner = vehicle if self.scenario.owners > 1 else 0
        now = float(source.clock["step"][world]) * self.scenario.time_step
        targets = np.repeat(source.targets[world][None], futures, axis=0)
        fish = np.empty((futures, self.scenario.targets, 4, 1), np.float32)
        for t in range(self.scenario.targets):
            some = sample_particles(source, np.array([world]), np.array([owner]), np.array([t]), futures)[0]
            particles = source.particles[world, owner, t][:, generator.permutation(np.resize(some, futures))]  # (rows, M)
            fish[:, t, :, 0] = particles[:4].T
            for k, (middle, reach) in enumerate(self.scenario.receiver.draws):
                targets["drawn"][:, t, k] = middle + reach * generator.uniform(-1.0, 1.0, futures)
            if len(particles) > 4:
                targets["drawn"][:, t, 0] = particles[4]
            if not self.scenario.receiver.asks:  # a tag that is asked pings when it is asked
                heard = source.listeners["arrival"][world, owner, t]  # (V,)
                self._draw_pings(targets[:, t], float(np.fmax.reduce(heard)), now)
        self.simulation.worlds.targets[...] = self._for_all(targets)
        self.simulation.worlds.fish[...] = self._for_all(fish)

    def _draw_pings(self, target: np.ndarray, heard: float, now: float) -> None:
        """When tags (M,) pinged last and ping next, given when they were last heard [s] (NaN: never)."""
        tag, generator = self.scenario.tag, self._generator
        last = np.full(target.shape, -1.0)
        following = now + (tag.period + tag.random_delay) * generator.random(target.shape)
        if not math.isnan(heard):
            following[...] = heard
        while (due := following <= now).any():
            last = np.where(due, following, last)
            following = np.where(due, following + tag.period + tag.random_delay * generator.random(target.shape), following)
        target["previous_ping"], target["last_ping"], target["next_ping"] = -1.0, last, following
        target["first_ping"] = (following - 1e-6) % tag.period  # of fixed periods; rounding must not make one ping two

    def _draw_water(self, world: int) -> None:
        """Bursts of losses, by how often they are and by what the last ping heard told of them; clocks."""
        water, hydrophones = self.scenario.water, self.scenario.receiver.hydrophones
        listeners = self.source.listeners[world]  # (V, T)
        met = np.repeat(self.source.worlds.encounters[world][None], self.shape[1], axis=0)
        share = water.noisy_share
        noisy, clear = share * water.noisy_hearing**hydrophones, (1.0 - share) * water.clear_hearing**hydrophones
        then = noisy / (noisy + clear) if noisy + clear > 0 else share
        fades = np.exp(-listeners["silence"] / water.noisy_duration)
        chance = np.where(np.isnan(listeners["arrival"]), share, share + (then - share) * fades)
        met["noisy"] = self._generator.random(met.shape) < chance
        met["clock_error"] = self.scenario.receiver.clock_sigma * self._generator.standard_normal(met.shape)
        self.simulation.worlds.encounters[...] = self._for_all(met)


def steps_of(scenario: Scenario, pings: int) -> int:
    """Steps in which so many pings come."""
    tag = scenario.tag
    return max(1, round(pings * max(tag.period + 0.5 * tag.random_delay, scenario.time_step) / scenario.time_step))


def better_move(cost: np.ndarray) -> int:
    """The move of least mean cost (K, M), or 0, one's own, where it is not better by a standard error of the difference.

    Moves are tried in the same futures, so that differences are paired. Where all moves are alike, to take whichever seems best
    would often be to take a worse one.
    """
    saved = cost[0] - cost
    mean, error = saved.mean(axis=1), saved.std(axis=1) / math.sqrt(cost.shape[1] - 1)
    mean[mean < SURE * error] = 0.0
    return int(mean.argmax())


def mean_error(simulation: Simulation) -> np.ndarray:
    """(B,) error [m], mean over tags and over the beliefs of vehicles that take part; of all where none does any more."""
    error = simulation.error.mean(axis=2)
    if error.shape[1] == 1:
        return error[:, 0]
    part = ~simulation.worlds.vehicles["gone"]
    part = part | ~part.any(axis=1, keepdims=True)
    return (error * part).sum(axis=1) / part.sum(axis=1)


def take_rows(state: Any, rows: np.ndarray, count: int) -> Any:
    """The same rows of every array of a policy's memory. Raises ValueError where one does not have ``count`` of them."""
    if state is None:
        return None
    if isinstance(state, tuple):
        parts = [take_rows(part, rows, count) for part in state]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    if not isinstance(state, np.ndarray) or len(state) != count:
        raise ValueError(f"a policy's memory must be arrays of {count} rows to be imagined on, got {type(state).__name__}")
    return state[rows].copy()


class Aim(Pursuit):
    """Pursuit that can be told to head off the line to a tag, and for which one."""

    def steer(self, observation: np.ndarray, action: np.ndarray, angle: np.ndarray, other: np.ndarray) -> np.ndarray:
        """The actions (B, A) with their courses at an ``angle`` (B,) to the line to the nearest tag, or to the ``other`` (B,)
        one of the rest where that is not -1, at full speed."""
        nearest = self._nearest(observation)
        tag = np.where(other < 0, nearest, other + (other >= nearest))
        asked = self._encode(angle, np.ones_like(angle), self._sight(observation, tag))
        if self.scenario.message_control:
            asked[:, -1] = action[:, -1]
        return asked

    def _nearest(self, observation: np.ndarray) -> np.ndarray:
        if self.scenario.targets == 1:
            return np.zeros(len(observation), np.int64)
        return observation[:, self._places["distance"]].argmin(axis=1)


def _imagined(scenario: Scenario, particles: int) -> Scenario:
    """The scenario whose fish swim as the belief supposes, with smaller filters."""
    belief = dataclasses.replace(scenario.belief, particles=min(particles, scenario.belief.particles))
    return dataclasses.replace(scenario, fish=scenario.belief.motion, belief=belief)
