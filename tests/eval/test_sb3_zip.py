"""Models of Stable-Baselines3 take part in a benchmark when they are trusted."""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import A2C, PPO, SAC, TD3

from tagtrack.eval.sb3_zip import load_zip
from tests.eval.conftest import SHORT

ALGORITHMS = {"ppo": PPO, "sac": SAC, "td3": TD3, "a2c": A2C}


@pytest.mark.parametrize("name", ALGORITHMS)
def test_a_model_takes_part_beside_baselines(tmp_path: Path, evaluate, name: str) -> None:
    env = gymnasium.make("tagtrack:TagTrack/LeopardShark-v0", particles=20)
    small = {"buffer_size": 100} if name in ("sac", "td3") else {}
    ALGORITHMS[name]("MlpPolicy", env, policy_kwargs={"net_arch": [8]}, **small).save(tmp_path / "model.zip")
    options = ("--policies", "circle", tmp_path / "model.zip", "--out", tmp_path / "out")
    status, _, error = evaluate("benchmark", *SHORT, *options)
    assert status == 2 and "runs the code that is in it; benchmark takes it with --trust" in error
    status, shown, error = evaluate("benchmark", *SHORT, *options, "--trust")
    assert status == 0, error
    assert "model.zip" in shown
    status, _, error = evaluate("benchmark", "--env", "LeopardSharkStandoff-v0", *SHORT, *options, "--trust")
    assert status == 2 and "name the task it was trained on" in error


def test_what_is_no_model_is_refused(tmp_path: Path, evaluate) -> None:
    (tmp_path / "text.zip").write_text("text")
    for file, message in (("text.zip", "is no model of Stable-Baselines3"), ("none.zip", "no model")):
        status, _, error = evaluate("benchmark", *SHORT, "--policies", tmp_path / file, "--trust")
        assert status == 2 and message in error


def test_a_recurrent_model_remembers_within_an_episode(tmp_path: Path, task) -> None:
    contrib = pytest.importorskip("sb3_contrib", reason="recurrent models need sb3-contrib: pip install sb3-contrib")
    env = gymnasium.make("tagtrack:TagTrack/LeopardShark-v0", particles=20)
    model = contrib.RecurrentPPO("MlpLstmPolicy", env, policy_kwargs={"lstm_hidden_size": 8, "net_arch": [8]})
    model.save(tmp_path / "model.zip")
    policy = load_zip(tmp_path / "model.zip", task.scenario)
    observation = np.ones((3, *env.observation_space.shape), np.float32)
    first, state = policy.predict(observation, None, np.ones(3, bool), deterministic=True)
    second, state = policy.predict(observation, state, np.zeros(3, bool), deterministic=True)
    anew, _ = policy.predict(observation, state, np.ones(3, bool), deterministic=True)
    assert np.array_equal(first, anew) and not np.array_equal(first, second)
