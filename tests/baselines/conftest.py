"""Observations written by hand, and small worlds in which nothing is left to chance."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tagtrack.envs.layout import feature_names
from tagtrack.envs.observation import SILENCE_SCALE
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import find_scenario
from tagtrack.envs.simulation import Simulation

SCENARIO = find_scenario("LeopardShark-v0")
EXACT = {"vehicle.compass_sigma": 0.0, "vehicle.fix_sigma": 0.0, "vehicle.drift_sigma": 0.0}
STILL = {"fish.max_speed": 1e-9, "belief.motion.max_speed": 1e-9}


@pytest.fixture(scope="session")
def make_simulation() -> Callable[..., Simulation]:
    def make(env_id: str = "LeopardShark-v0", worlds: int = 1, **overrides: Any) -> Simulation:
        return Simulation(with_overrides(find_scenario(env_id), {"belief.particles": 64, **overrides}), worlds)

    return make


@pytest.fixture(scope="session")
def make_exact_simulation(make_simulation: Callable[..., Simulation]) -> Callable[..., Simulation]:
    """Vehicles that know where they are, fish and particles that rest."""

    def make(env_id: str = "LeopardShark-v0", worlds: int = 1, **overrides: Any) -> Simulation:
        return make_simulation(env_id, worlds, **{**EXACT, **STILL, **overrides})

    return make


@pytest.fixture(scope="session")
def sight() -> Callable[..., np.ndarray]:
    """An observation (B, D) of what heuristics read; the rest is zero. Distances [m], angles [degrees], silence [s]."""

    def make(
        *, distance: Any = 50.0, bearing: Any = 0.0, heading: Any = 0.0, silence: Any = 0.0, ping_phase: Any = 0.0
    ) -> np.ndarray:
        columns = {
            "distance": np.asarray(distance) / SCENARIO.scale.length,
            "bearing_cos": np.cos(np.radians(bearing)),
            "bearing_sin": np.sin(np.radians(bearing)),
            "silence": np.log1p(silence) / SILENCE_SCALE,
            "ping_phase": np.asarray(ping_phase),
            "heading_cos": np.cos(np.radians(heading)),
            "heading_sin": np.sin(np.radians(heading)),
        }
        rows = np.atleast_1d(np.broadcast_arrays(*columns.values())[0]).shape[0]
        observation = np.zeros((rows, len(feature_names(SCENARIO))), np.float32)
        for name, value in columns.items():
            observation[:, feature_names(SCENARIO).index(name)] = value
        return observation

    return make


@pytest.fixture(scope="session")
def course_of() -> Callable[..., np.ndarray]:
    """The course of an action relative to the line [degrees]."""
    return lambda action: np.degrees(np.arctan2(action[..., 1], action[..., 0]))
