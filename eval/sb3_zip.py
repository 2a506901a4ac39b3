"""A model that Stable-Baselines3 has saved, as a contestant. Loading one runs whatever code is in it."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.scenario import Scenario
from tagtrack.policies.protocol import Policy


def is_zip(spec: str) -> bool:
    """Whether a spec names a file that Stable-Baselines3 may have saved."""
    return spec.endswith(".zip")


def load_zip(path: Path, scenario: Scenario) -> Policy:
    """The model in a file, of whichever algorithm has saved it.

    Raises:
        FileNotFoundError: where there is none. ValueError: if it is no model, or of another observation or action.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no model {path}; name the .zip that model.save has written")
    algorithm = _algorithm_of(path)
    try:
        model = algorithm.load(path, device="cpu")
    except Exception as error:  # whatever a stranger's pickle raises
        raise ValueError(f"{path} cannot be loaded as {algorithm.__name__}: {error}") from None
    observation, action = model.observation_space.shape, model.action_space.shape
    if observation != (len(feature_names(scenario)),) or action != (len(action_names(scenario)),):
        raise ValueError(
            f"{path} was trained on observations {observation} and actions {action}, this task has "
            f"{(len(feature_names(scenario)),)} and {(len(action_names(scenario)),)}; name the task it was trained on"
        )
    print(f"note: {path} does not say what it was trained on; that the numbers of features and actions fit is all that is known")
    return _Model(model)


def _algorithm_of(path: Path) -> Any:
    """The class whose attributes the file holds."""
    import stable_baselines3 as sb3

    try:
        with zipfile.ZipFile(path) as archive:
            data = json.loads(archive.read("data"))
            names = archive.namelist()
    except (zipfile.BadZipFile, KeyError, ValueError, OSError) as error:
        raise ValueError(f"{path} is no model of Stable-Baselines3 ({error})") from None
    if not isinstance(data, dict):
        raise ValueError(f"{path} is no model of Stable-Baselines3 (its data is {type(data).__name__})")
    if "sb3_contrib" in _home_of(data, "policy_class"):
        return _recurrent(path)
    if "clip_range" in data:
        return sb3.PPO
    if any("ent_coef" in name for name in names) or "ent_coef_optimizer" in data or "target_entropy" in data:
        return sb3.SAC
    if "target_policy_noise" in data:
        return sb3.TD3
    if "gae_lambda" in data:
        return sb3.A2C
    known = "PPO, SAC, TD3, A2C and, of sb3-contrib, RecurrentPPO are"
    raise ValueError(f"{path} is of an algorithm that is not known here: {known}; give it as MODULE:OBJECT")


def _home_of(data: dict[str, Any], name: str) -> str:
    """The module of a class that the data tell of."""
    told = data.get(name)
    return str(told.get("__module__", "")) if isinstance(told, dict) else ""


def _recurrent(path: Path) -> Any:
    try:
        from sb3_contrib import RecurrentPPO
    except ImportError:
        raise ImportError(f'{path} is of sb3-contrib: pip install "tagtrack[contrib]"') from None
    return RecurrentPPO


class _Model:
    """A model as a policy for a batch."""

    def __init__(self, model: Any) -> None:
        self._model = model

    def predict(
        self, observation: np.ndarray, state: Any = None, episode_start: np.ndarray | None = None, deterministic: bool = False
    ) -> tuple[np.ndarray, Any]:
        action, state = self._model.predict(observation, state, episode_start, deterministic)
        return np.clip(action, -1.0, 1.0), state
