"""Ids that somebody else registered for our environments are trained and compared by their names, from his own folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tagtrack.envs.task import build_task, full_id

REEF = """
import gymnasium
from tagtrack.envs.scenario import Scenario

def register(name, entry_point="tagtrack.envs.single:TagTrackEnv", **rest):
    gymnasium.register(id=name, entry_point=entry_point, **rest)

register("Mine/Reef-v0", kwargs={"scenario": Scenario(episode_steps=12, lost_error=50.0)})
register("Mine/Edge-v0", kwargs={"env_id": "TagTrack/RangeOnly-v0", "overrides": {"episode_steps": 12}})
register("Nameless-v0", kwargs={"env_id": "TagTrack/RangeOnly-v0", "overrides": {"episode_steps": 12}})
register("Mine/Short-v0", kwargs={"env_id": "TagTrack/RangeOnly-v0"}, max_episode_steps=5)
register("Mine/Circle-v0", kwargs={"env_id": "Mine/Circle-v0"})
register("Mine/Mud-v0", kwargs={"overrides": {"water.mud": 1.0}})
register("Mine/Lost-v0", entry_point="nowhere:Env")
register("Mine/Pole-v0", entry_point="gymnasium.envs.classic_control.cartpole:CartPoleEnv")
"""
FEW = ("--particles", "20")


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run a module of the package in a folder that holds ``reef.py``."""
    (tmp_path / "reef.py").write_text(REEF)
    environ = {**os.environ, "XDG_CONFIG_HOME": str(tmp_path / "config")}

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", *arguments]
        return subprocess.run(command, cwd=tmp_path, env=environ, capture_output=True, text=True, timeout=300)

    return run


def read_json(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["Mine/Reef-v0", "Nameless-v0"])
def test_registered_id_is_trained_and_compared_by_its_name(run: Callable, tmp_path: Path, name: str) -> None:
    env = ("--env", f"reef:{name}", *FEW)
    done = run("tagtrack.train", *env, "--steps", "64", "--validation-episodes", "2")
    assert done.returncode == 0, done.stderr
    folder = f"runs/{name.rpartition('/')[2]}-ppo-seed0"
    config = read_json(tmp_path / folder / "config.json")
    assert config["env"] == f"reef:{name}"  # from which the run can be made again
    assert config["scenario"]["episode_steps"] == 12
    assert read_json(tmp_path / folder / "policy.json")["env_id"] == name
    assert f"tagtrack eval benchmark --env reef:{name} " in done.stdout
    done = run("tagtrack.eval", "benchmark", *env, "--episodes", "2", "--policies", "pursuit", folder, "--out", "table")
    assert done.returncode == 0, done.stderr
    assert read_json(tmp_path / "table/benchmark.json")["env"] == name
    assert read_json(tmp_path / "table/config.json")["env"] == name
    assert f"episodes of {name}," in " ".join(done.stdout.split())


def test_registered_id_goes_on_where_it_was_left(run: Callable) -> None:
    train = ("tagtrack.train", "--env", "reef:Mine/Reef-v0", *FEW, "--steps", "64", "--validation-episodes", "2", "--out", "run")
    assert run(*train).returncode == 0
    done = run("tagtrack.train", "--resume", "run", "--steps", "128")
    assert done.returncode == 0, done.stderr


@pytest.fixture
def reef(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The ids, for this process and this test."""
    from gymnasium.envs.registration import registry

    (tmp_path / "reef.py").write_text(REEF)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "reef", raising=False)
    before = dict(registry)
    yield
    sys.modules.pop("reef", None)
    registry.clear()
    registry.update(before)


def test_task_is_as_it_was_registered_and_the_command_line_goes_on_from_there(reef: None) -> None:
    edge = build_task("reef:Mine/Edge-v0", particles=20)
    assert (edge.env_id, edge.scenario.time_step, edge.scenario.episode_steps) == ("Mine/Edge-v0", 10.0, 12)
    assert build_task("Mine/Reef-v0", overrides={"water.reach": 70.0}).scenario.lost_error == 50.0
    assert full_id("reef:Nameless-v0") == "Nameless-v0"


def test_registered_length_ends_episodes_in_train_and_eval_too(reef: None) -> None:
    assert build_task("reef:Mine/Short-v0").scenario.episode_steps == 5


def test_speed_times_the_task_as_it_was_registered(reef: None, evaluate: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a vector_entry_point of its own, and with the options that it was registered with."""
    from tagtrack.eval.speed import command as speed

    lengths = []
    step_env = speed.step_env

    def spy(env, action, seed):
        lengths.append(env.unwrapped.simulation.scenario.episode_steps)
        return step_env(env, action, seed)

    monkeypatch.setattr(speed, "step_env", spy)
    short = ("--num-worlds", "1", "--threads", "1", "--rounds", "1", "--seconds", "0.01")
    status, _, err = evaluate("speed", "--env", "reef:Mine/Edge-v0", *FEW, *short)
    assert (status, err, lengths) == (0, "", [12])


@pytest.mark.parametrize(
    ("env_id", "complaint"),
    [
        ("no_such_module:Mine/Reef-v0", "cannot import 'no_such_module' (No module named 'no_such_module')"),
        ("reef:Mine/Wreck-v0", "unknown environment 'reef:Mine/Wreck-v0'; known: TagTrack/LeopardShark-v0"),
        ("reef:Mine/Pole-v0", "Mine/Pole-v0 is no environment of TagTrack's"),
        ("CartPole-v1", "CartPole-v1 is no environment of TagTrack's"),
        ("reef:Mine/Lost-v0", "Mine/Lost-v0 was registered as nowhere:Env, which cannot load (No module named 'nowhere')"),
        ("reef:Mine/Circle-v0", "Mine/Circle-v0 was registered with itself as env_id"),
        ("reef:Mine/Mud-v0", "unknown parameter 'water.mud'"),
    ],
)
def test_mistake_in_an_id_is_one_line(reef: None, evaluate: Callable, capsys, env_id: str, complaint: str) -> None:
    from tagtrack.train.cli import main as train

    status, out, err = evaluate("benchmark", "--env", env_id)
    assert (status, out) == (2, "") and err.startswith("error: ") and err.count("\n") == 1 and complaint in err
    assert train(["--env", env_id]) == 2
    assert capsys.readouterr().err == err
