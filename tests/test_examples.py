"""The examples run from a folder of their own, without touching the package: a sensor, a motion, a reward and a heuristic."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., str]


@pytest.fixture
def run(tmp_path: Path, repository: Path) -> Run:
    """Run a module of the package as a user does, in a folder that holds the examples and nothing else."""
    for example in (repository / "examples").glob("own_*.py"):
        shutil.copy(example, tmp_path)

    def run(*arguments: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=600
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


SENSOR = ("receiver=own_sensor:SidedBearing", "belief.receiver=own_sensor:SidedBearing")


def test_own_sensor_is_trained_and_compared(run: Run, tmp_path: Path) -> None:
    short = ("--steps", "2000", "--validation-episodes", "4", "--particles", "100")
    run("tagtrack.train", "--set", *SENSOR, *short, "--out", "run")
    described = json.loads((tmp_path / "run" / "config.json").read_text())["scenario"]
    assert described["receiver"]["kind"] == described["belief"]["receiver"]["kind"] == "SidedBearing"
    run(
        "tagtrack.eval", "benchmark", "--set", *SENSOR, "--policies", "circle", "run", "--episodes", "8", "--particles", "200",
        "--out", "table",
    )  # fmt: skip
    figures = json.loads((tmp_path / "table" / "benchmark.json").read_text())["policies"]
    # A bearing with a side: after the first minute the fish is found to a few metres.
    assert all(figures[name]["median_error_m"]["value"] < 12.0 for name in ("circle", "run"))


def test_own_motion_and_reward_and_heuristic_in_one_comparison(run: Run, tmp_path: Path) -> None:
    darts = ("fish=own_motion:DartAndRest", "belief.motion=own_motion:DartAndRest")
    reward = ("reward.own=own_reward:KeepDistance", "reward.own.keep_distance.weight=0.3")
    run(
        "tagtrack.eval", "benchmark", "--set", *darts, *reward, "--policies", "circle", "own_heuristic:Zigzag",
        "--episodes", "8", "--particles", "200", "--out", "table",
    )  # fmt: skip
    figures = json.loads((tmp_path / "table" / "benchmark.json").read_text())["policies"]
    assert set(figures) == {"circle", "Zigzag"} and figures["Zigzag"]["median_error_m"]["value"] < 20.0


def test_own_models_in_gymnasium_and_the_reward_is_in_the_info(run_python: Callable[..., str], repository: Path) -> None:
    code = """
import gymnasium as gym, numpy as np, sys
sys.path.insert(0, "examples")
from own_reward import KeepDistance
env = gym.make("tagtrack:TagTrack/LeopardShark-v0", particles=100, overrides={
    "receiver": "own_sensor:SidedBearing", "belief.receiver": "own_sensor:SidedBearing", "fish": "own_motion:DartAndRest",
    "reward.own": (KeepDistance(weight=0.5, distance=40.0),)})
env.reset(seed=0)
for _ in range(20):
    observation, reward, _, _, info = env.step(env.action_space.sample())
    terms = {name[len("reward_"):]: value for name, value in info.items() if name.startswith("reward_")}
    assert abs(terms["keep_distance"] + 0.5 * min(abs(info["range"] - 40.0) / 40.0, 1.0)) < 1e-12
    assert abs(sum(terms.values()) - reward) < 1e-12 and observation in env.observation_space
print(list(terms))
"""
    assert run_python(code).strip() == "['localization', 'standoff', 'keep_distance']"
def run_script(repository: Path, folder: Path, name: str, *arguments: str) -> str:
    """Run an example of a fleet as a user does, in an empty folder."""
    script = shutil.copy(repository / "examples" / name, folder)
    done = subprocess.run(
        [sys.executable, str(script), *arguments], cwd=folder, capture_output=True, text=True, timeout=600
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_fleet_by_hand_tells_of_each_minute(repository: Path, tmp_path: Path) -> None:
    lines = run_script(repository, tmp_path, "fleet_by_hand.py").splitlines()
    assert [line.partition(":")[0] for line in lines] == [f"minute {k}" for k in range(1, 6)]
    assert "messages came to auv_0" in lines[-1]


def test_fleet_learns_with_stable_baselines3(repository: Path, tmp_path: Path) -> None:
    told = run_script(repository, tmp_path, "fleet_sb3.py", "6000")
    assert "over 96 vehicles' episodes" in told


def test_fleet_runs_in_torchrl(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip("torchrl", reason="torchrl is not installed; it is no dependency")
    assert "(60, 3," in run_script(repository, tmp_path, "fleet_torchrl.py")
