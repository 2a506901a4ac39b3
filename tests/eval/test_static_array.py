"""Moored receivers as a contestant: the same fish, errors at the bound, and a row among those of policies."""

import dataclasses
import json

import numpy as np
import pytest

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.task import build_task
from tagtrack.eval import compare
from tagtrack.eval.episodes import Episodes
from tagtrack.eval.field.static_array.bound import cramer_rao_bound, root_trace
from tagtrack.eval.field.static_array.model import ArraySetting, Positions
from tagtrack.eval.rollout import roll_out, trace, watch_fish
from tagtrack.eval.static_array import StaticArray, hold, read_static_array
from tests.eval.conftest import SHORT
from tests.tasks import LONE

RESTING = {"fish": "brownian", "fish.max_speed": 1e-6, "start.nearest": 0, "start.farthest": 0}


@pytest.mark.parametrize("env", LONE)
def test_the_array_meets_the_fish_that_policies_meet(env):
    """Fish and pings depend on the episode alone: neither on what a vehicle does nor on the particles of its belief."""
    task = build_task(env, particles=30, overrides={"episode_steps": 25})
    steered = trace(task, lambda simulation: make_baseline("circle:30", simulation), episodes=3, seed=11)
    np.testing.assert_array_equal(watch_fish(task, Episodes(count=3, seed=11, batch=2)).fish, steered.fish)


@pytest.mark.parametrize("period", [3.0, 7.0])
def test_pings_come_at_the_tags_period(task, period):
    task = build_task("LeopardShark-v0", overrides={"episode_steps": 60, "tag.period": period})
    pinged = watch_fish(task, Episodes(count=20, seed=0)).pinged
    assert abs(pinged.mean() - 2.0 / period) < 1 / 60  # steps of 2 s: one ping more or less in an episode
    waits = [np.diff(np.flatnonzero(row)) for row in pinged]
    assert set(np.concatenate(waits)) <= {int(period // 2), int(period // 2) + 1}


def test_error_in_the_middle_of_the_array_is_the_cramer_rao_bound():
    """There the bound is sigma c / sqrt 2 along each axis, 1.5 m together. 6,000 pings tell it to 0.7 % (one sigma)."""
    task = build_task("LeopardShark-v0", overrides={"episode_steps": 60, **RESTING})
    array = StaticArray()
    bound = root_trace(cramer_rao_bound(np.zeros(2), array.receivers, ArraySetting()))
    assert bound == pytest.approx(1.5)
    traced = array.trace(task, Episodes(count=100, seed=0))
    assert np.sqrt(np.mean(traced.record.error**2)) == pytest.approx(bound, rel=0.03)
    np.testing.assert_allclose(traced.covariance.mean(axis=(0, 1)), 1.125 * np.eye(2), atol=0.01)
    errors = (traced.estimate - traced.fish).reshape(-1, 2)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=4 * 1.06 / np.sqrt(len(errors)))


def test_error_of_a_swimming_fish_follows_the_bound_where_it_is():
    task = build_task("AreaOnly-v0", overrides={"episode_steps": 120})
    array = StaticArray(baseline=600.0)
    truth = watch_fish(task, Episodes(count=40, seed=5))
    traced = array.trace(task, Episodes(count=40, seed=5))
    bound = root_trace(cramer_rao_bound(truth.fish, array.receivers, ArraySetting()))
    inside = truth.pinged & (np.abs(truth.fish).max(axis=2) < 300.0)
    assert inside.sum() > 1000  # mean squares of so many are known to 4 % (one sigma)
    assert np.mean((traced.record.error[inside] / bound[inside]) ** 2) == pytest.approx(1.0, abs=0.15)


def test_a_position_is_held_until_the_next_ping_that_can_be_located():
    found = Positions(
        position=np.array([[1.0, 2.0], [np.nan, np.nan], [5.0, 6.0]]), covariance=np.arange(12.0).reshape(3, 2, 2)
    )
    pinged = np.array([False, True, False, True, False, True, False])
    position, covariance = hold(found, pinged)
    np.testing.assert_array_equal(position, [[0, 0], [1, 2], [1, 2], [1, 2], [1, 2], [5, 6], [5, 6]])
    assert np.isnan(covariance[0]).all()
    np.testing.assert_array_equal(covariance[1:], found.covariance[[0, 0, 0, 0, 2, 2]])


def test_numbers_do_not_depend_on_the_batch_and_a_single_episode_is_the_same(task):
    whole = StaticArray().trace(task, Episodes(count=5, seed=3))
    parts = StaticArray().trace(task, Episodes(count=5, seed=3, batch=2, threads=2))
    np.testing.assert_array_equal(parts.estimate, whole.estimate)
    np.testing.assert_array_equal(StaticArray().trace(task, Episodes(count=1, seed=7)).estimate[0], whole.estimate[4])
    np.testing.assert_array_equal(roll_out(task, StaticArray(), episodes=5, seed=3).error, whole.record.error)


def test_a_task_without_a_ping_leaves_the_fish_in_the_middle():
    task = build_task("LeopardShark-v0", overrides={"episode_steps": 3, "tag.period": 1e6})
    traced = StaticArray().trace(task, Episodes(count=2, seed=0))
    np.testing.assert_array_equal(traced.estimate, 0.0)


def test_the_array_stands_beside_policies_without_a_vehicle(task):
    comparison = compare(task, ["circle", "static_array", "static_array:50"], episodes=4)
    assert comparison.records["static_array"].range is None
    assert np.isnan(comparison.summaries["static_array"]["mean_range_m"].value)
    mean = {name: figures["mean_error_m"].value for name, figures in comparison.summaries.items()}
    assert comparison.ratios["circle/static_array"].value == pytest.approx(mean["circle"] / mean["static_array"])
    assert mean["static_array"] != mean["static_array:50"]
    given = compare(task, {"mine": StaticArray(setting=dataclasses.replace(ArraySetting(), sigma=1e-6))}, episodes=4)
    later = given.records["mine"].error[:, 2:]  # the tag pings every 2 s, as the steps are long
    assert later.max() < 0.01 < comparison.records["static_array"].error.mean()


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("static_array:far", "static_array:far: baseline must be a number of metres, got 'far'"),
        ("static_array:", "static_array:: baseline must be a number of metres, got ''"),
        ("static_array:-5", "static_array:-5: baseline must be positive, got -5.0 m"),
        ("static_array:nan", "static_array:nan: baseline must be positive, got nan m"),
    ],
)
def test_a_baseline_that_is_none_is_refused(spec, says):
    with pytest.raises(ValueError, match=says):
        read_static_array(spec)


def test_command_prints_the_array_among_policies(evaluate, tmp_path):
    command = ("benchmark", *SHORT, "--policies", "circle", "static_array", "--out", tmp_path / "out")
    status, out, err = evaluate(*command)
    assert (status, err) == (0, "")
    row = next(line for line in (tmp_path / "out/table.md").read_text().splitlines() if line.startswith("| static_array |"))
    header = (tmp_path / "out/table.md").read_text().splitlines()[0]
    cells = dict(zip(header.split(" | "), row.split(" | "), strict=True))
    assert cells["mean range [m]"] == "-"
    assert "static_array is no policy: four moored receivers" in " ".join(out.split())
    result = json.loads((tmp_path / "out/benchmark.json").read_text())["policies"]["static_array"]
    assert result["mean_range_m"] == {"value": None, "low": None, "high": None}
    assert 0 < result["median_error_m"]["value"] < 5
    assert (tmp_path / "out/track_median.png").exists()
