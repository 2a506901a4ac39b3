"""The world, the belief about it, the task, and the shells through which others step it."""

from tagtrack.envs.scenario import SCENARIOS, Scenario, find_scenario, with_overrides
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import TagTrackEnv
from tagtrack.envs.vector import TagTrackVectorEnv

__all__ = [
    "SCENARIOS",
    "Scenario",
    "Simulation",
    "TagTrackEnv",
    "TagTrackVectorEnv",
    "find_scenario",
    "with_overrides",
]
