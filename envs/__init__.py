"""The world, the belief about it, the task, and the shells through which others step it.

The names below load their modules when they are first asked for: a vehicle that imports the filter needs no gymnasium.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tagtrack.envs.lazy import lazily

if TYPE_CHECKING:
    from tagtrack.envs.area_only import AreaOnlyEnv
    from tagtrack.envs.overrides import with_overrides
    from tagtrack.envs.range_only import RangeOnlyEnv
    from tagtrack.envs.scenario import SCENARIOS, Scenario, find_scenario
    from tagtrack.envs.simulation import Simulation
    from tagtrack.envs.single import TagTrackEnv
    from tagtrack.envs.time_of_flight import TimeOfFlightEnv
    from tagtrack.envs.vector import TagTrackVectorEnv

_HOMES = {
    "area_only": ("AreaOnlyEnv",),
    "overrides": ("with_overrides",),
    "range_only": ("RangeOnlyEnv",),
    "scenario": ("SCENARIOS", "Scenario", "find_scenario"),
    "simulation": ("Simulation",),
    "single": ("TagTrackEnv",),
    "time_of_flight": ("TimeOfFlightEnv",),
    "vector": ("TagTrackVectorEnv",),
}

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

__getattr__, __dir__ = lazily(__name__, _HOMES)
