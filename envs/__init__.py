"""The world, the belief about it, the task, and the shells through which others step it."""

from tagtrack.envs.area_only import AreaOnlyEnv
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.range_only import RangeOnlyEnv
from tagtrack.envs.scenario import SCENARIOS, Scenario, find_scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import TagTrackEnv
from tagtrack.envs.time_of_flight import TimeOfFlightEnv
from tagtrack.envs.vector import TagTrackVectorEnv

__all__ = [
    "SCENARIOS",
    "AreaOnlyEnv",
    "RangeOnlyEnv",
    "Scenario",
    "Simulation",
    "TagTrackEnv",
    "TagTrackVectorEnv",
    "TimeOfFlightEnv",
    "find_scenario",
    "with_overrides",
]
