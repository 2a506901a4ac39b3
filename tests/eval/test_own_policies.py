"""Policies of a user's own file, named MODULE:OBJECT, in a comparison from the folder where the file lies."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.eval.conftest import SHORT

OWN = """
from dataclasses import dataclass
import numpy as np
from tagtrack.baselines.heuristic import Heuristic, InformedHeuristic
from tagtrack.baselines.registry import make_baseline

@dataclass(frozen=True, kw_only=True, eq=False)
class Chaser(Heuristic):
    def choose(self, sighting, memory):
        return np.zeros_like(sighting.bearing), np.ones_like(sighting.bearing), memory

@dataclass(frozen=True, kw_only=True, eq=False)
class Knower(InformedHeuristic):
    def choose(self, sighting, memory):
        away = self.simulation.fish_position[:, 0] - self.simulation.vehicle_position[:, 0]
        return np.arctan2(away[:, 1], away[:, 0]) - sighting.line, np.ones_like(sighting.line), memory

class Straight:
    def __init__(self, simulation=None):
        self.simulation = simulation

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return np.tile(np.float32([1.0, 0.0]), (len(observation), 1)), state

def ring(simulation):
    return make_baseline("circle:30", simulation)

ready = Straight()
number = 3

class Unfinished(Heuristic):
    pass

def nothing(simulation):
    return None

def greedy(simulation, appetite):
    return None
"""
KINDS = ("Chaser", "Knower", "Straight", "ring", "ready")


def test_every_kind_of_own_policy_is_compared_under_its_name(tmp_path: Path) -> None:
    (tmp_path / "own_policies.py").write_text(OWN)
    specs = [f"own_policies:{name}" for name in KINDS]
    command = [sys.executable, "-m", "tagtrack.eval", "benchmark", *SHORT, "--policies", "pursuit", "circle:30", *specs]
    done = subprocess.run([*command, "--out", "out"], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    figures = json.loads((tmp_path / "out/benchmark.json").read_text())["policies"]
    assert list(figures) == ["pursuit", "circle:30", *KINDS]
    # Straight on to the estimate is pursuit, however it is written, and a circle made by a function is that circle.
    assert figures["Chaser"] == figures["Straight"] == figures["ready"] == figures["pursuit"]
    assert figures["ring"] == figures["circle:30"]
    assert figures["Knower"] != figures["pursuit"]
    assert json.loads((tmp_path / "out/config.json").read_text())["policies"]["Chaser"] == "own_policies:Chaser"
    assert "Knower" in (tmp_path / "out/table.md").read_text()


@pytest.mark.parametrize(
    ("specs", "complaint"),
    [
        (["nowhere_at_all:Chaser"], "cannot import 'nowhere_at_all'"),
        (["own_policies:Chase"], "own_policies has no 'Chase'"),
        (["own_policies:number"], "own_policies:number is no policy: it must be a class of heuristics, a function"),
        (["own_policies:nothing"], "own_policies:nothing makes a NoneType, which has no predict"),
        (["own_policies:Unfinished"], "own_policies:Unfinished cannot be made for a simulation: Can't instantiate abstract"),
        (["own_policies:greedy"], "own_policies:greedy cannot be made for a simulation: greedy() missing 1 required"),
        (["own_policies:ring", "own_policies:ring"], "two policies go by the name 'ring'"),
    ],
)
def test_mistake_in_an_own_policy_is_one_line(
    evaluate: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, specs: list[str], complaint: str
) -> None:
    (tmp_path / "own_policies.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_policies", raising=False)
    status, out, err = evaluate("benchmark", *SHORT, "--policies", *specs)
    assert (status, out) == (2, "") and err.startswith("error: ") and err.count("\n") == 1 and complaint in err
    assert not (tmp_path / "runs").exists()


def test_help_says_how_an_own_policy_is_named(evaluate: Callable) -> None:
    status, out, _ = evaluate("benchmark", "--help")
    assert status == 0 and "my_module:MyController" in out
