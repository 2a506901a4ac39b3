"""TagTrack: environments in which autonomous underwater vehicles track acoustically tagged animals.

Importing this package tells Gymnasium the ids and does nothing else. Entry points are strings, so the simulation, and
numba with it, loads only when an environment is made; ``gymnasium.make("tagtrack:TagTrack/LeopardShark-v0")`` needs no
other import.
"""

from gymnasium.envs.registration import register, registry

__version__ = "0.1.0"

# Id -> class, and the steps of an episode: make_vec hands these to the vector env, which truncates by itself.
_TASKS = {
    "TagTrack/LeopardShark-v0": ("tagtrack.envs.single:TagTrackEnv", 300),
    "TagTrack/LeopardSharkStandoff-v0": ("tagtrack.envs.single:TagTrackEnv", 300),
    "TagTrack/TimeOfFlight-v0": ("tagtrack.envs.time_of_flight:TimeOfFlightEnv", 300),
    "TagTrack/RangeOnly-v0": ("tagtrack.envs.range_only:RangeOnlyEnv", 360),
    "TagTrack/AreaOnly-v0": ("tagtrack.envs.area_only:AreaOnlyEnv", 720),
    "TagTrack/AreaOnlyUnknownRange-v0": ("tagtrack.envs.area_only:AreaOnlyEnv", 360),
}

for _id, (_entry_point, _steps) in _TASKS.items():
    if _id not in registry:  # importing twice, or reloading, must not warn
        register(
            id=_id,
            entry_point=_entry_point,
            vector_entry_point="tagtrack.envs.vector:TagTrackVectorEnv",
            kwargs={"env_id": _id},
            max_episode_steps=_steps,
        )
