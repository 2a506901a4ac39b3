"""The policies that come with the package run on their tasks, are small, and say where they come from."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.task import build_task
from tagtrack.eval.comparison import compare
from tagtrack.live import Tracker
from tagtrack.policies.box import BOX, boxed_policy
from tagtrack.policies.files import WEIGHTS_FILE, load_policy
from tests.tasks import LONE

FLEETS = [{"vehicles": 3}, {"vehicles": 2, "tags": 4}]
TASKS = [*((env_id, {}) for env_id in SCENARIOS), *(("TagTrack/LeopardShark-v0", fleet) for fleet in FLEETS)]


@pytest.mark.parametrize(("env_id", "fleet"), TASKS)
def test_there_is_one_for_each_task_and_it_steers(env_id: str, fleet: dict[str, int]) -> None:
    task = build_task(env_id, particles=100, overrides={"episode_steps": 40}, **fleet)  # type: ignore[typeddict-item]
    folder = boxed_policy(task.env_id, vehicles=task.scenario.vehicles, tags=task.scenario.targets)
    assert (folder / WEIGHTS_FILE).stat().st_size < 130_000
    told = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert told["command"].startswith("tagtrack train") and {"seed", "versions", "table"} <= set(told)
    names = feature_names(task.scenario)
    load_policy(folder, names, action_names=action_names(task.scenario), env_id=task.env_id)
    comparison = compare(task, ["stationary", "learned"], episodes=4)
    assert np.isfinite(comparison.records["learned"].error).all()


def test_it_steers_a_tracker() -> None:
    tracker = Tracker("LeopardShark-v0", particles=100, policy="learned")
    tracker.navigate(0.0, 0.0, 0.0, 90.0, 1.0)
    assert 0 <= tracker.steer(0.0).course < 360


def test_what_is_not_in_the_box_is_said() -> None:
    with pytest.raises(ValueError, match="no policy for RangeOnly-tags comes with the package, only .*LeopardShark"):
        boxed_policy("TagTrack/RangeOnly-v0", tags=3)
    assert {path.name for path in BOX.iterdir() if path.is_dir()} >= {env_id[9:-3] for env_id in LONE}
