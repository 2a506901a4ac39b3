"""Which heuristics a learned policy must beat: for each task the paper's controller and the best that tuning found.

The numbers are those of ``python -m eval tune --env ID --policy circle`` and ``information``, with 192 episodes for tuning.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from tagtrack.envs.sensors.sensor import Sensor
from tagtrack.envs.task import Task

RIVALS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "TagTrack/LeopardShark-v0": ("three_step", "pursuit", "circle:8.4", "information:21"),
        "TagTrack/Glider-v0": ("three_step", "circle:10", "information:21"),
        "TagTrack/TimeOfFlight-v0": ("three_step", "pursuit", "circle:10", "information:10"),
        "TagTrack/RangeOnly-v0": ("three_step", "circle:40", "information:23"),
        "TagTrack/AreaOnly-v0": ("circle", "circle:335", "information:2"),  # the first at 0.8 of the range, as in the paper
        "TagTrack/AreaOnlyUnknownRange-v0": ("circle", "circle:296", "information:3"),
    }
)
OTHERS = ("three_step", "pursuit", "circle")  # of tasks that nobody tuned them for
OF_FLEETS = ("circle", "information")
OF_SEVERAL_TAGS = ("circle", "uncertain", "information")


def rivals_of(task: Task) -> tuple[str, ...]:
    """The heuristics of a task, the one that ratios are of first."""
    named: tuple[str, ...]
    if task.scenario.targets > 1:
        named = OF_SEVERAL_TAGS
    elif task.scenario.vehicles > 1:
        named = OF_FLEETS
    else:
        named = RIVALS.get(task.env_id, OTHERS)
    plans = type(task.scenario.belief.receiver).prospect is not Sensor.prospect  # else nobody can say what it will read
    return tuple(name for name in named if plans or not name.startswith("information"))
