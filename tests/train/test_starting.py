"""A fleet's policy that begins as another run's, a curriculum over sizes, or as a baseline."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.task import build_task
from tagtrack.policies.files import load_policy
from tagtrack.train.checkpoint import load_checkpoint
from tagtrack.train.cli import main
from tagtrack.train.cloning import clone_baseline
from tagtrack.train.config import TrainConfig
from tagtrack.train.learning import build_model
from tagtrack.train.session import rollouts_to_watch
from tagtrack.train.settings import PPOSettings, find_settings
from tagtrack.train.vec_env import TagTrackVecEnv
from tests.train.conftest import SMALL

SHORT = [*SMALL, "--steps", "200", "--hyper", "rollout=64"]


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory, own_key: Path) -> Path:
    """A run of two vehicles and two tags."""
    folder = tmp_path_factory.mktemp("start") / "small"
    assert main(["--vehicles", "2", "--tags", "2", *SHORT, "width=8", "--out", str(folder)]) == 0
    return folder


def actions_of(run: Path) -> np.ndarray:
    """What a run's policy does with three vehicles and four tags."""
    scenario = build_task("LeopardShark-v0", vehicles=3, tags=4).scenario
    names = feature_names(scenario)
    rows = np.random.default_rng(0).uniform(-1, 1, (20, len(names))).astype(np.float32)
    return load_policy(run, names, action_names=action_names(scenario)).predict(rows, deterministic=True)[0]


def test_a_larger_fleet_begins_as_the_smaller_one_ended_and_learns_when_its_critic_has(train, small, monkeypatch):
    """Four updates are made: all of them of the critic alone, or none."""
    for name, watched in (("watched", 4), ("learning", 0)):
        monkeypatch.setattr("tagtrack.train.session.WATCHED", watched)
        options = ["--vehicles", "3", "--tags", "4", *SHORT, "width=8", "--start", small, "--out", name]
        status, _, error = train(*options)
        assert status == 0, error
    assert json.loads(Path("watched/config.json").read_text())["start"] == str(small)
    np.testing.assert_allclose(actions_of(Path("watched")), actions_of(small), atol=1e-6)
    last = [PPO.load(load_checkpoint(Path(name)).model, device="cpu").policy for name in ("watched", "learning")]
    assert not torch.equal(*(policy.mlp_extractor.actor.layers["point_1"].weight for policy in last))


def test_a_baseline_is_imitated(monkeypatch):
    """Pursuit of the nearest tag, after short episodes: courses lie some 40 degrees apart; an untrained network knows no tag."""
    monkeypatch.setattr("tagtrack.train.cloning.WORLDS", 16)
    task = build_task("LeopardShark-v0", vehicles=2, tags=2, particles=32, overrides={"episode_steps": 60})
    env = TagTrackVecEnv(task, 8, hold=2)
    settings = replace(find_settings(TrainConfig(vehicles=2, tags=2), task.scenario), ahead=0.0, rollout=64, batch_size=64)
    model = build_model(settings, env, 0, "cpu")
    assert clone_baseline(model, "pursuit", task, hold=2, seed=0) < 1 - math.cos(math.radians(40))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["width=8"], "only PPO of fleets begins as another"),
        (["width=16", "--vehicles", "2"], "its layers are 8 wide; add --hyper width=8"),
        (["width=8", "--vehicles", "2", "--env", "RangeOnly-v0"], "use a policy trained on this task"),
        (["width=8", "--tags", "2"], "was trained with tags that are described otherwise"),
    ],
)
def test_policies_that_do_not_fit_are_refused(train, small, options, message):
    status, _, error = train(*SHORT, *options, "--start", small, "--out", "next")
    assert status == 2 and message in error


def test_nothing_to_begin_with_is_said(train):
    status, _, error = train("--vehicles", "2", *SHORT, "--start", "absent", "--out", "next")
    assert status == 2 and "--start absent: is neither a baseline (three_step" in error


def test_a_run_that_was_stopped_early_goes_on_watching():
    config, settings = TrainConfig(vehicles=2, start="circle"), PPOSettings(rollout=64)
    assert [rollouts_to_watch(config, settings, done) for done in (0, 64, 200, 256, 10_000)] == [4, 3, 1, 0, 0]
    assert rollouts_to_watch(TrainConfig(vehicles=2), settings, 0) == 0
