"""What shells tell beside observations: numbers of all worlds for their infos, the reward of a team, who has ended.

An axis of one vehicle, or of one tag, is left out, so that a single vehicle with a single tag has plain numbers.
"""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import Any

import numpy as np

from tagtrack.envs.kernels.binding import bind
from tagtrack.envs.referee import LONE, gather_lone
from tagtrack.envs.simulation import Simulation

_bound: list[Any] = []  # the compiled ``gather_lone``: not kept in environments, for it cannot be pickled


def lone_sources(simulation: Simulation) -> tuple[np.ndarray, ...]:
    """What ``tell_lone`` reads; whole arrays, for a copy of a view would be cut off from the copied simulation."""
    worlds, outputs = simulation.worlds, simulation.outputs
    truth, known = (worlds.encounters, worlds.vehicles, worlds.fish), (worlds.beliefs, worlds.navigation)
    return (*truth, *known, outputs.error, outputs.terms)


def tell_lone(sources: tuple[np.ndarray, ...]) -> np.ndarray:
    """(14 + K,) numbers of one vehicle and one tag in the order of ``gather_lone``, an array of the caller's own.

    Compiled, for to read the arrays from Python took as long as a quarter of a step.
    """
    told = np.empty(LONE + sources[-1].shape[2])
    if not _bound:
        _bound.extend(bind((gather_lone, *sources, told)))
    _bound[0](*sources, told)
    return told


def tell_vehicles(simulation: Simulation) -> dict[str, np.ndarray]:
    """Of each vehicle, (B, V): mean error over the tags, distances from fish and vehicles [m], counts, share of the battery."""
    worlds, outcomes = simulation.worlds, simulation.outputs.outcomes
    told = {
        "localization_error": outcomes["error"].copy(),
        "range": outcomes["range"].copy(),
        "separation": outcomes["separation"].copy(),
        "encroachments": outcomes["encroachments"].astype(np.int64),
        "detected": outcomes["heard"].astype(np.int64),
        "messages": worlds.radios["sent"].copy(),
        "received": worlds.radios["received"].copy(),
        **_tell_positions(simulation),
    }
    if simulation.scenario.vehicle.battery > 0:
        told["battery"] = worlds.navigation["battery"].copy()
    return told


def _tell_positions(simulation: Simulation) -> dict[str, np.ndarray]:
    """Where vehicles believe they are and where they are, (B, V, 2) [m]."""
    navigation = simulation.worlds.navigation
    return {
        "vehicle_position": np.stack([navigation["x"], navigation["y"]], axis=-1),
        "true_vehicle_position": simulation.vehicle_position,
    }


def tell_fish(simulation: Simulation) -> np.ndarray:
    """(B, T, 2) where the fish are [m]; float64, as all other numbers that are told."""
    return simulation.fish_position.astype(np.float64)


def tell(simulation: Simulation, stepped: np.ndarray) -> dict[str, np.ndarray]:
    """What Gymnasium's infos hold, (B, ...): see ``TagTrackEnv``.

    Args:
        stepped: (B,) bool, the worlds that a step has brought where they are; where a reset did, no reward was given yet.
    """
    vehicles = simulation.scenario.vehicles
    info = {
        "localization_error": simulation.outputs.outcomes["error"].copy(),
        "range": simulation.outputs.outcomes["range"].copy(),
        "detected": _squeeze_tags(simulation.detected, simulation),
        "belief_mean": _squeeze_tags(_of_each(simulation.mean, vehicles), simulation),
        "belief_covariance": _squeeze_tags(_of_each(simulation.covariance, vehicles), simulation),
        **_tell_positions(simulation),
        **_tell_terms(simulation, stepped),
    }
    if simulation.scenario.vehicle.battery > 0:
        info["battery"] = simulation.worlds.navigation["battery"].copy()
    fish = tell_fish(simulation)
    fish_info = {"true_fish_position": fish[:, 0] if simulation.scenario.targets == 1 else fish}
    if vehicles == 1:
        return {name: values[:, 0] for name, values in info.items()} | fish_info
    told = tell_vehicles(simulation)
    counts = {name: told[name] for name in ("separation", "encroachments", "messages", "received")}
    return info | fish_info | counts | {"active": simulation.worlds.navigation["active"].copy()}


def _of_each(beliefs: np.ndarray, vehicles: int) -> np.ndarray:
    """(B, V, T, ...) of (B, O, T, ...): a shared belief is every vehicle's."""
    return beliefs if beliefs.shape[1] == vehicles else np.repeat(beliefs, vehicles, axis=1)


def _squeeze_tags(values: np.ndarray, simulation: Simulation) -> np.ndarray:
    """Values (B, V, T, ...) without the axis of a single tag."""
    return values[:, :, 0] if simulation.scenario.targets == 1 else values


def _tell_terms(simulation: Simulation, stepped: np.ndarray) -> dict[str, np.ndarray]:
    """The weighted terms of the reward by the names of ``term_names``, (B, V); 0 where no step was made."""
    terms = np.where(stepped[:, np.newaxis, np.newaxis], simulation.outputs.terms, 0.0)
    return {name: terms[..., k].copy() for k, name in enumerate(term_names(simulation))}


def term_names(simulation: Simulation) -> list[str]:
    """By which infos know the terms of the reward: flat, for most libraries batch no dictionaries in dictionaries."""
    return [f"reward_{name}" for name in simulation.scenario.reward.names]


def team_reward(simulation: Simulation) -> np.ndarray:
    """(B,) the mean of the rewards of the vehicles that took part in the last step; 0 where none did."""
    reward = simulation.reward
    if simulation.scenario.vehicles == 1:
        return reward[:, 0]
    part = ~simulation.worlds.vehicles["gone"]
    return np.where(part, reward, 0.0).sum(axis=1) / np.maximum(part.sum(axis=1), 1)


def lone_reward(terms: np.ndarray) -> float:
    """The sum of one vehicle's ``terms`` (K,) as ``Simulation.reward`` has it, bit for bit, in a third of the time.

    Fewer than eight numbers numpy adds one after the other, more of them in eight sums at once.
    """
    return reduce(add, terms.tolist()) if len(terms) < 8 else float(np.add.reduce(terms))


def all_have_left(simulation: Simulation) -> np.ndarray:
    """(B,) bool: no vehicle of the world takes part any more."""
    return np.logical_not(simulation.worlds.navigation["active"].any(axis=1))
