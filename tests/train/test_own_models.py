"""Models of a user's own, named MODULE:CLASS, are trained on, and the run's record says which they were."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.train.conftest import SMALL

SENSOR = """
from dataclasses import dataclass
from tagtrack.envs.sensors import StereoHydrophone

@dataclass(frozen=True, kw_only=True)
class KnownSide(StereoHydrophone):
    pass
"""
REWARD = """
from dataclasses import dataclass
from typing import ClassVar
from tagtrack.envs.kernels.calling import native
from tagtrack.envs.rewards.term import JUDGE, Term

@native(JUDGE)
def judge(outcome, parameters):
    return -parameters[0] * outcome.range

@dataclass(frozen=True, kw_only=True)
class Hug(Term):
    weight: float = 0.01
    name: ClassVar[str] = "hug"
    judge = judge
"""


@pytest.fixture
def own_modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "own_sensor.py").write_text(SENSOR)
    (tmp_path / "own_reward.py").write_text(REWARD)
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("own_sensor", "own_reward"):
        sys.modules.pop(name, None)
    yield
    for name in ("own_sensor", "own_reward"):
        sys.modules.pop(name, None)


def test_sensor_and_reward_reach_the_scenario_and_the_record(own_modules: None, tmp_path: Path, train: Callable) -> None:
    sensor = ("receiver=own_sensor:KnownSide", "belief.receiver=own_sensor:KnownSide")
    reward = ("reward.own=own_reward:Hug", "reward.own.hug.weight=0.5")
    status, printed, error = train("--steps", "100", *SMALL, "--set", *sensor, "--set", *reward, "--out", "run")
    assert (status, error) == (0, "")
    assert "receiver=own_sensor:KnownSide" in printed  # in the line on how to compare it
    config = json.loads((tmp_path / "run/config.json").read_text())
    scenario = config["scenario"]
    assert scenario["receiver"]["kind"] == scenario["belief"]["receiver"]["kind"] == "KnownSide"
    assert scenario["reward"]["own"]["hug"] == {"weight": 0.5, "kind": "Hug", "module": "own_reward"}
    assert {*sensor, *reward} <= set(config["set"])  # with their modules: from this the run can be made again
    assert train("--config", "run/config.json", "--out", "again")[0] == 0
    again, run = ((tmp_path / name / "policy.safetensors").read_bytes() for name in ("again", "run"))
    assert again == run


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("receiver=own_sonar:KnownSide", "cannot import 'own_sonar'"),
        ("receiver=own_sensor:Blind", "own_sensor has no 'Blind'"),
        ("receiver=own_reward:Hug", "receiver: own_reward:Hug must be a class derived from tagtrack.envs.sensors.sensor.Sensor"),
        ("reward.own=own_sensor:KnownSide", "own_sensor:KnownSide must be a class derived from tagtrack.envs.rewards.term.Term"),
        ("reward.own.hug.weight=1", "unknown parameter 'reward.own.hug.weight'"),
    ],
)
def test_mistake_in_a_model_is_one_line(own_modules: None, train: Callable, text: str, complaint: str) -> None:
    status, _, error = train("--steps", "100", *SMALL, "--set", text)
    assert status == 2 and error.startswith("error: ") and error.count("\n") == 1 and complaint in error
