"""A fleet's policy that begins as another run's: a curriculum over sizes."""

import json
from pathlib import Path

import numpy as np
import pytest

from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.task import build_task
from tagtrack.policies.files import load_policy
from tagtrack.train.cli import main
from tests.train.conftest import SMALL

SHORT = [*SMALL, "--steps", "200", "--hyper", "rollout=64"]


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory, own_key: Path) -> Path:
    """A run of two vehicles and two tags."""
    folder = tmp_path_factory.mktemp("start") / "small"
    assert main(["--vehicles", "2", "--tags", "2", *SHORT, "width=8", "--out", str(folder)]) == 0
    return folder


def test_a_larger_fleet_begins_as_the_smaller_one_ended(train, small):
    still = ["width=8", "learning_rate=1e-12"]
    status, _, error = train("--vehicles", "3", "--tags", "4", *SHORT, *still, "--start", small, "--out", "large")
    assert status == 0, error
    assert json.loads(Path("large/config.json").read_text())["start"] == str(small)
    scenario = build_task("LeopardShark-v0", vehicles=3, tags=4).scenario
    names = feature_names(scenario)
    rows = np.random.default_rng(0).uniform(-1, 1, (20, len(names))).astype(np.float32)
    actions = [
        load_policy(run, names, action_names=action_names(scenario)).predict(rows, deterministic=True)[0]
        for run in (small, Path("large"))
    ]
    np.testing.assert_allclose(*actions, atol=1e-4)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["width=8"], "only fleets begin as another"),
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
    assert status == 2 and "absent" in error
