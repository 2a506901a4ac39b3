"""What shells tell beside observations: numbers of all worlds for their infos, the reward of a team, who has ended.

An axis of one vehicle, or of one tag, is left out, so that a single vehicle with a single tag has plain numbers.
"""

from __future__ import annotations

import numpy as np

from tagtrack.envs.simulation import Simulation


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
    }
    if simulation.scenario.vehicle.battery > 0:
        told["battery"] = worlds.navigation["battery"].copy()
    return told


def tell(simulation: Simulation) -> dict[str, np.ndarray]:
    """What Gymnasium's infos hold, (B, ...): see ``TagTrackEnv``."""
    scenario, told = simulation.scenario, tell_vehicles(simulation)
    names = ["localization_error", "range", *(["battery"] if "battery" in told else [])]
    if scenario.vehicles > 1:
        names += ["separation", "encroachments", "messages", "received"]
    info = {name: _squeeze(told[name], simulation) for name in names}
    info["detected"] = _squeeze(simulation.detected.copy(), simulation, tags=True)
    info["belief_mean"] = _squeeze(_of_each(simulation.mean, scenario.vehicles), simulation, tags=True)
    info["belief_covariance"] = _squeeze(_of_each(simulation.covariance, scenario.vehicles), simulation, tags=True)
    if scenario.vehicles > 1:
        info["active"] = simulation.worlds.navigation["active"].copy()
    return info


def _of_each(beliefs: np.ndarray, vehicles: int) -> np.ndarray:
    """(B, V, T, ...) of (B, O, T, ...): a shared belief is every vehicle's."""
    return beliefs if beliefs.shape[1] == vehicles else np.repeat(beliefs, vehicles, axis=1)


def _squeeze(values: np.ndarray, simulation: Simulation, tags: bool = False) -> np.ndarray:
    """Values (B, V, T, ...), or (B, V) without ``tags``, without the axes of a single vehicle and a single tag."""
    lone = ((1,) if simulation.scenario.vehicles == 1 else ()) + ((2,) if tags and simulation.scenario.targets == 1 else ())
    return np.squeeze(values, axis=lone)


def tell_terms(simulation: Simulation) -> dict[str, np.ndarray]:
    """The weighted terms of the reward by name, (B, V), or (B,) of a single vehicle."""
    return {name: _squeeze(term.copy(), simulation) for name, term in simulation.reward_terms.items()}


def team_reward(simulation: Simulation) -> np.ndarray:
    """(B,) the mean of the rewards of the vehicles that took part in the last step; 0 where none did."""
    reward = simulation.reward
    if simulation.scenario.vehicles == 1:
        return reward[:, 0]
    part = ~simulation.worlds.vehicles["gone"]
    return np.where(part, reward, 0.0).sum(axis=1) / np.maximum(part.sum(axis=1), 1)


def all_have_left(simulation: Simulation) -> np.ndarray:
    """(B,) bool: no vehicle of the world takes part any more."""
    return np.logical_not(simulation.worlds.navigation["active"].any(axis=1))
