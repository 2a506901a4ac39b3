"""TagTrack: environments in which autonomous underwater vehicles track acoustically tagged animals.

Importing this package tells Gymnasium the ids and does nothing else. Entry points are strings, so the simulation, and
numba with it, loads only when an environment is made; ``gymnasium.make("tagtrack:TagTrack/LeopardShark-v0")`` needs no
other import.
"""

try:
    from gymnasium.envs.registration import register, registry
except ModuleNotFoundError as error:  # a vehicle needs the filter and a policy, no environments
    if error.name != "gymnasium":
        raise
    registry = None  # type: ignore[assignment]

__version__ = "0.1.0"

# Id -> class. Episodes end by themselves, after the scenario's episode_steps or max_episode_steps of gymnasium.make.
_TASKS = {
    "TagTrack/LeopardShark-v0": "tagtrack.envs.single:TagTrackEnv",
    "TagTrack/LeopardSharkStandoff-v0": "tagtrack.envs.single:TagTrackEnv",
    "TagTrack/TimeOfFlight-v0": "tagtrack.envs.time_of_flight:TimeOfFlightEnv",
    "TagTrack/RangeOnly-v0": "tagtrack.envs.range_only:RangeOnlyEnv",
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
