"""TagTrack: environments in which autonomous underwater vehicles track acoustically tagged animals.

Importing this package tells Gymnasium and PettingZoo the ids and does nothing else. Entry points are strings, so the
simulation, and numba with it, loads only when an environment is made; ``gymnasium.make("tagtrack:TagTrack/LeopardShark-v0")``
needs no other import.
"""

import os
import sys
from typing import Any

registry: Any = None
pettingzoo: Any = None


def _asks_for_help_alone() -> bool:
    """Whether this process is the command ``tagtrack`` and shows its help or version, which need no ids and should not wait."""
    program, *words = getattr(sys, "argv", None) or [""]
    command = os.path.join(os.path.dirname(sys.executable), "tagtrack")
    asks = not words or not {"-h", "--help", "--version"}.isdisjoint(words)
    return asks and os.path.splitext(os.path.abspath(program))[0] == command


if not _asks_for_help_alone():
    try:
        from gymnasium.envs.registration import register, registry
    except ModuleNotFoundError as error:  # a vehicle needs the filter and a policy, no environments
        if error.name != "gymnasium":
            raise
    try:
        import pettingzoo  # type: ignore[no-redef]
    except ModuleNotFoundError as error:
        if error.name != "pettingzoo":
            raise

__version__ = "0.1.0"

# Id -> class. Episodes end by themselves, after the scenario's episode_steps.
_TASKS = {
    "TagTrack/LeopardShark-v0": "tagtrack.envs.single:TagTrackEnv",
    "TagTrack/LeopardSharkStandoff-v0": "tagtrack.envs.single:TagTrackEnv",
    "TagTrack/Glider-v0": "tagtrack.envs.single:TagTrackEnv",
    "TagTrack/GliderPair-v0": "tagtrack.envs.single:TagTrackEnv",
    "TagTrack/TimeOfFlight-v0": "tagtrack.envs.time_of_flight:TimeOfFlightEnv",
    "TagTrack/RangeOnly-v0": "tagtrack.envs.range_only:RangeOnlyEnv",
    "TagTrack/RangeOnlyGlider-v0": "tagtrack.envs.range_only:RangeOnlyEnv",
    "TagTrack/AreaOnly-v0": "tagtrack.envs.area_only:AreaOnlyEnv",
    "TagTrack/AreaOnlyUnknownRange-v0": "tagtrack.envs.area_only:AreaOnlyEnv",
}

for _id, _entry_point in _TASKS.items() if registry is not None else ():
    if _id not in registry:  # importing twice, or reloading, must not warn
        register(
            id=_id,
            entry_point=_entry_point,
            vector_entry_point="tagtrack.envs.vector:TagTrackVectorEnv",
            kwargs={"env_id": _id},
        )

# Workers that a fork server starts know the ids as their parent does: Gymnasium reads no entry points, and the names of ids that
# others hand to workers (make_vec_env of Stable-Baselines3) import nothing. Spawned ones need "tagtrack:" before the id.
if registry is not None:
    try:
        from multiprocessing.forkserver import _forkserver, set_forkserver_preload  # type: ignore[attr-defined]
    except ImportError:  # there is none on Windows
        pass
    else:
        _preloaded = list(getattr(_forkserver, "_preload_modules", ["__main__"]))
        if __name__ not in _preloaded:
            set_forkserver_preload([*_preloaded, __name__])

# Fleets, for pettingzoo.make("parallel", id, vehicles=3) and ("aec", id): id -> the task it is of.
_FLEETS = {
    "tagtrack/leopard_shark_v0": "TagTrack/LeopardShark-v0",
    "tagtrack/range_only_v0": "TagTrack/RangeOnly-v0",
    "tagtrack/area_only_v0": "TagTrack/AreaOnly-v0",
    "tagtrack/time_of_flight_v0": "TagTrack/TimeOfFlight-v0",
    "tagtrack/glider_pair_v0": "TagTrack/GliderPair-v0",
}

if hasattr(pettingzoo, "register"):  # from PettingZoo 1.27 on
    for _id, _env_id in _FLEETS.items():
        for _kind, _maker in (("parallel", "parallel_env"), ("aec", "env")):
            if pettingzoo.EnvSpec(id=_id).id not in getattr(pettingzoo, f"{_kind}_registry"):  # it writes _v0 as -v0
                pettingzoo.register(
                    _kind, _id, entry_point=f"tagtrack.envs.parallel:{_maker}", kwargs={"env_id": _env_id, "vehicles": 2}
                )
