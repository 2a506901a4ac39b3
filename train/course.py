"""What the course of a run hangs on beside its network: the worlds, what they showed last, and where random numbers stand.

With it a run that goes on is, bit for bit, the run that was never cut off. Plain arrays (npz), no pickles.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from tagtrack.train.vec_env import TagTrackVecEnv

OBSERVED = ("_last_obs", "_last_episode_starts")  # of a model of Stable-Baselines3
SUMS = ("_head_start", "_return", "_error", "_length")  # of our vector environment


def describe_course(model: BaseAlgorithm) -> dict[str, np.ndarray]:
    """The state of worlds and random numbers at the beginning of a rollout, by name."""
    env = _environment(model)
    legacy: Any = np.random.get_state(legacy=False)
    numpy_state = {**legacy, "state": {**legacy["state"], "key": legacy["state"]["key"].tolist()}}
    drawn = {"numpy": numpy_state, "actions": model.action_space.np_random.bit_generator.state}
    found = _worlds(env)
    found |= {name: np.asarray(getattr(model, name)) for name in OBSERVED}
    found |= {"drawn": np.array(json.dumps(drawn)), "torch": torch.get_rng_state().numpy()}
    if model.device.type == "cuda":
        found["cuda"] = torch.cuda.get_rng_state(model.device).cpu().numpy()
    return found


def restore_course(path: Path, model: BaseAlgorithm) -> bool:
    """Go on exactly where ``describe_course`` was called; False, and nothing done, where worlds are other ones by now.

    Raises:
        ValueError: if the file is damaged.
    """
    if not path.is_file():  # of a run of an earlier version
        return False
    try:
        with np.load(path, allow_pickle=False) as file:
            saved = {name: file[name] for name in file.files}
        drawn = json.loads(str(saved["drawn"]))
        env = _environment(model)
        fits = all(name in saved and _is_alike(saved[name], array) for name, array in _worlds(env).items())
        if not fits or ("cuda" in saved) != (model.device.type == "cuda"):
            return False
        key = np.array(drawn["numpy"]["state"]["key"], np.uint32)
        np.random.set_state({**drawn["numpy"], "state": {**drawn["numpy"]["state"], "key": key}})
        model.action_space.np_random.bit_generator.state = drawn["actions"]
        torch.set_rng_state(torch.from_numpy(saved["torch"]))
        if "cuda" in saved:
            torch.cuda.set_rng_state(torch.from_numpy(saved["cuda"]), model.device)
    except (ValueError, KeyError, TypeError, RuntimeError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path} cannot be read ({type(error).__name__}: {error}); remove it to go on in new episodes") from None
    env.go_on_from(tuple(saved[f"world_{k}"] for k in range(len(_worlds(env)) - len(SUMS))))
    for name in SUMS:
        getattr(env, name)[...] = saved[name]
    for name in OBSERVED:
        setattr(model, name, saved[name])
    return True


def _worlds(env: TagTrackVecEnv) -> dict[str, np.ndarray]:
    """The state of the environment, by name."""
    worlds = {f"world_{k}": array for k, array in enumerate(env.simulation.save_state())}
    return worlds | {name: getattr(env, name) for name in SUMS}


def _environment(model: BaseAlgorithm) -> TagTrackVecEnv:
    assert isinstance(model.env, TagTrackVecEnv)
    return model.env


def _is_alike(first: np.ndarray, second: np.ndarray) -> bool:
    return first.dtype == second.dtype and first.shape == second.shape
