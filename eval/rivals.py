"""Which heuristics a learned policy must beat: for each task the paper's controller and the best that tuning found.

The numbers are those of ``tagtrack eval tune --env ID --policy circle`` and ``information`` with 192 episodes for tuning, of the
pair with 64 and ``circle:centroid=1``. The last of a task is the best.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.sensors.sensor import Sensor
from tagtrack.envs.task import Task

RIVALS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "TagTrack/LeopardShark-v0": ("three_step", "pursuit", "circle:8.4", "information:21"),
        "TagTrack/Glider-v0": ("three_step", "circle:2.45", "information:16"),
        "TagTrack/GliderPair-v0": ("circle:centroid=1,radius=33.1", "uncertain", "information:34"),
        "TagTrack/TimeOfFlight-v0": ("three_step", "pursuit", "circle:10", "information:10"),
        "TagTrack/RangeOnly-v0": ("three_step", "information:23", "circle:40"),
        "TagTrack/RangeOnlyGlider-v0": ("three_step", "circle:40", "information:33"),
        "TagTrack/AreaOnly-v0": ("circle", "information:2", "circle:335"),  # the first at 0.8 of the range, as in the paper
        "TagTrack/AreaOnlyUnknownRange-v0": ("circle", "information:3", "circle:296"),
    }
)
OTHERS = ("three_step", "pursuit", "circle")  # of tasks that nobody tuned them for
OF_FLEETS = ("circle", "information")
OF_SEVERAL_TAGS = ("circle", "uncertain", "information")


def best_of(task: Task) -> str:
    """The heuristic of a task that tracks best."""
    return rivals_of(task)[-1]


def rivals_of(task: Task) -> tuple[str, ...]:
    """The heuristics of a task, the one that ratios are of first, the best last."""
    scenario, own = task.scenario, SCENARIOS.get(task.env_id)
    if own is not None and (own.vehicles, own.targets) == (scenario.vehicles, scenario.targets):
        named = RIVALS.get(task.env_id, OTHERS)
    elif scenario.targets > 1:
        named = OF_SEVERAL_TAGS
    else:
        named = OF_FLEETS if scenario.vehicles > 1 else OTHERS
    plans = type(task.scenario.belief.receiver).prospect is not Sensor.prospect  # else nobody can say what it will read
    return tuple(name for name in named if plans or not name.startswith("information"))
