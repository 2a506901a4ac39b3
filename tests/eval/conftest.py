"""Short tasks for the commands and roll-outs, a saved policy that fits them, and `tagtrack eval` within this process."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.scenario import find_scenario
from tagtrack.envs.task import Task, build_task
from tagtrack.eval.cli import main
from tagtrack.policies.files import save_policy
from tagtrack.policies.network import NetworkPolicy, weight_shapes

STEPS, PARTICLES = 40, 60
LONGITUDE, LATITUDE = -80.9, 25.1  # of the origin of places in metres
SHORT = ("--set", f"episode_steps={STEPS}", "--particles", str(PARTICLES), "--episodes", "6")


@pytest.fixture(autouse=True)
def short_films(monkeypatch) -> None:
    """Reports with films of two pictures: painting takes longer than the episodes of these tests."""
    monkeypatch.setattr("tagtrack.eval.benchmark_pictures.FRAMES", 2)


@pytest.fixture
def task() -> Task:
    return build_task("LeopardShark-v0", particles=PARTICLES, overrides={"episode_steps": STEPS})


@pytest.fixture
def evaluate(capsys) -> Callable[..., tuple[int, str, str]]:
    """Run a command line; returns exit status, standard output and standard error (without the word about compiling)."""

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        status = main([str(argument) for argument in arguments])
        shown = capsys.readouterr()
        errors = [line for line in shown.err.splitlines(keepends=True) if not line.startswith("TagTrack compiles")]
        return status, shown.out, "".join(errors)

    return run


@pytest.fixture
def save_run() -> Callable[..., Path]:
    """Save a random linear policy as a training run would."""

    def save(folder: Path, *, features: tuple[str, ...] | None = None, speed_control: bool = False) -> Path:
        scenario = find_scenario("LeopardSharkStandoff-v0" if speed_control else "LeopardShark-v0")
        features = feature_names(scenario) if features is None else features
        actions = action_names(scenario)
        shapes = weight_shapes(features=len(features), hidden=(), actions=len(actions), squash="clip")
        generator = np.random.default_rng(1)
        policy = NetworkPolicy(
            algorithm="ppo",
            env_id="TagTrack/LeopardShark-v0",
            observation_features=features,
            action_names=actions,
            hidden=(),
            activation="tanh",
            weights={name: generator.normal(0, 0.3, shape).astype(np.float32) for name, shape in shapes.items()},
        )
        save_policy(folder, policy)
        return folder

    return save


@pytest.fixture
def as_degrees() -> Callable[[np.ndarray], np.ndarray]:
    """Longitude and latitude (K, 2) of places (K, 2) [m] by the radii of the ellipsoid; a millimetre off at 150 m."""
    pytest.importorskip("pymap3d", reason='longitude and latitude need pymap3d: pip install "tagtrack[geo]"')
    axis, square = 6378137.0, 1 / 298.257223563 * (2 - 1 / 298.257223563)  # WGS84; squared eccentricity
    bend = 1 - square * math.sin(math.radians(LATITUDE)) ** 2
    east, north = axis / math.sqrt(bend) * math.cos(math.radians(LATITUDE)), axis * (1 - square) / bend**1.5

    def convert(position: np.ndarray) -> np.ndarray:
        return np.array([LONGITUDE, LATITUDE]) + np.degrees(np.asarray(position) / np.array([east, north]))

    return convert
