"""TagTrack: environments in which autonomous underwater vehicles track acoustically tagged animals.

Importing this package tells Gymnasium the ids and does nothing else. Entry points are strings, so the simulation, and
numba with it, loads only when an environment is made; ``gymnasium.make("tagtrack:TagTrack/LeopardShark-v0")`` needs no
other import.
"""

from gymnasium.envs.registration import register, registry

__version__ = "0.1.0"

for _id in ("TagTrack/LeopardShark-v0", "TagTrack/LeopardSharkStandoff-v0"):
    if _id not in registry:  # importing twice, or reloading, must not warn
        register(
            id=_id,
            entry_point="tagtrack.envs.single:TagTrackEnv",
            vector_entry_point="tagtrack.envs.vector:TagTrackVectorEnv",
            kwargs={"env_id": _id},
            max_episode_steps=300,  # steps of 2 s; make_vec hands it to the vector env, which truncates by itself
        )
