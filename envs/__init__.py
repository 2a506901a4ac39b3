"""The world, the belief about it, the task, and the shells through which others step it.

The names below load their modules when they are first asked for: a vehicle that imports the filter needs no gymnasium.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tagtrack.envs.area_only import AreaOnlyEnv
    from tagtrack.envs.overrides import with_overrides
    from tagtrack.envs.range_only import RangeOnlyEnv
    from tagtrack.envs.scenario import SCENARIOS, Scenario, find_scenario
    from tagtrack.envs.simulation import Simulation
    from tagtrack.envs.single import TagTrackEnv
    from tagtrack.envs.time_of_flight import TimeOfFlightEnv
    from tagtrack.envs.vector import TagTrackVectorEnv

_HOME_OF = {
    "SCENARIOS": "scenario",
    "AreaOnlyEnv": "area_only",
    "RangeOnlyEnv": "range_only",
    "Scenario": "scenario",
    "Simulation": "simulation",
    "TagTrackEnv": "single",
    "TagTrackVectorEnv": "vector",
    "TimeOfFlightEnv": "time_of_flight",
    "find_scenario": "scenario",
    "with_overrides": "overrides",
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


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
