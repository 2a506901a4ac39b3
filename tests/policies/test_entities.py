"""The policy for fleets: numpy acts as torch does, order and number of entities do not matter, courses are held."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tagtrack.envs.layout import action_names, blocks, feature_names
from tagtrack.envs.scenario import Scenario
from tagtrack.policies.entities import EntityPolicy, entity_weight_shapes, find_entities
from tagtrack.policies.files import load_policy, save_policy

HEADING = ("heading_cos", "heading_sin")


def policy_for(scenario: Scenario, trained_on: Scenario | None = None, hold: int = 1, seed: int = 0) -> EntityPolicy:
    """One of random weights, of the sizes of the fleet that it was trained on."""
    layout = find_entities(feature_names(trained_on or scenario))
    shapes = entity_weight_shapes(
        own=len(layout.own_names), tag=len(layout.tag_names), mate=len(layout.mate_names), width=8,
        extras=len(action_names(scenario)) - 2,
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    return EntityPolicy(
        env_id="a test", observation_features=feature_names(scenario), action_names=action_names(scenario),
        own_names=layout.own_names, tag_names=layout.tag_names, mate_names=layout.mate_names, width=8, hold=hold,
        weights={name: rng.normal(0, 0.2, shape).astype(np.float32) for name, shape in shapes.items()},
    )  # fmt: skip


def rows_of(scenario: Scenario, count: int = 5, seed: int = 1) -> np.ndarray:
    rows = np.random.default_rng(seed).uniform(-1, 1, (count, len(feature_names(scenario)))).astype(np.float32)
    for block in blocks(scenario):
        if block.entity.startswith("mate"):
            rows[:, block.first] = 1.0  # known
    return rows


def swapped(rows: np.ndarray, scenario: Scenario, one: str, other: str) -> np.ndarray:
    place = {block.entity: block.places for block in blocks(scenario)}
    result = rows.copy()
    result[:, place[one]], result[:, place[other]] = rows[:, place[other]], rows[:, place[one]]
    return result


FLEET = Scenario(vehicles=4, targets=3)


@pytest.mark.parametrize(("one", "other"), [("tag_0", "tag_2"), ("mate_0", "mate_2")])
def test_order_of_tags_and_teammates_does_not_matter(one: str, other: str) -> None:
    policy, rows = policy_for(FLEET), rows_of(FLEET)
    action, _ = policy.predict(rows, deterministic=True)
    np.testing.assert_allclose(policy.predict(swapped(rows, FLEET, one, other), deterministic=True)[0], action, atol=1e-6)


@pytest.mark.parametrize(("vehicles", "tags"), [(1, 1), (1, 4), (2, 1), (10, 3), (20, 20)])
def test_one_policy_steers_fleets_of_any_size(vehicles: int, tags: int) -> None:
    other = replace(FLEET, vehicles=vehicles, targets=tags)
    action, _ = policy_for(other, FLEET).predict(rows_of(other), deterministic=True)
    assert action.shape == (5, 2) and np.isfinite(action).all()


def test_unknown_teammates_are_as_good_as_none() -> None:
    fleet, alone = Scenario(vehicles=3, targets=2), Scenario(vehicles=2, targets=2)
    rows = rows_of(fleet)
    place = {block.entity: block.places for block in blocks(fleet)}
    rows[:, place["mate_1"]] = 0.0
    fewer = np.concatenate([rows[:, : place["mate_1"].start], rows[:, place["mate_1"].stop :]], axis=1)
    first, second = (policy_for(each, fleet).predict(r, deterministic=True)[0] for each, r in ((fleet, rows), (alone, fewer)))
    np.testing.assert_allclose(first, second, atol=1e-6)


def test_course_is_held_in_the_frame_of_the_compass_until_the_next_decision() -> None:
    policy, names = policy_for(FLEET, hold=3), list(feature_names(FLEET))
    state, courses = None, []
    rng = np.random.default_rng(0)
    for step in range(7):
        rows = rows_of(FLEET, seed=step)
        heading = rng.uniform(-math.pi, math.pi, 5)
        rows[:, names.index("heading_cos")], rows[:, names.index("heading_sin")] = np.cos(heading), np.sin(heading)
        action, state = policy.predict(rows, state, np.full(5, step == 0), deterministic=True)
        courses.append(np.exp(1j * (np.arctan2(action[:, 1], action[:, 0]) + heading)))
    for first, second, same in ((0, 1, True), (1, 2, True), (2, 3, False), (3, 5, True), (5, 6, False)):
        assert np.allclose(courses[first], courses[second], atol=1e-5) is same


def test_a_world_that_begins_anew_decides_anew() -> None:
    policy, rows = policy_for(FLEET, hold=10), rows_of(FLEET)
    _, state = policy.predict(rows, deterministic=True)
    fresh, _ = policy.predict(rows_of(FLEET, seed=9), state, np.array([True, False, False, False, False]), deterministic=True)
    alone, _ = policy.predict(rows_of(FLEET, seed=9)[:1], deterministic=True)
    np.testing.assert_allclose(fresh[0], alone[0], atol=1e-6)


def test_numpy_acts_as_the_network_that_was_trained() -> None:
    pytest.importorskip("torch")
    import gymnasium
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv

    from tagtrack.envs.spaces import action_space, observation_space
    from tagtrack.train.entity_network import EntityActorCritic, export_entities

    spaces = observation_space(FLEET), action_space(FLEET)

    class Still(gymnasium.Env):
        observation_space, action_space = spaces

        def reset(self, **_: object) -> tuple[np.ndarray, dict]:
            return np.zeros(self.observation_space.shape, np.float32), {}

    options = {"names": feature_names(FLEET), "width": 8, "ahead": 0.5}
    model = PPO(EntityActorCritic, DummyVecEnv([Still]), policy_kwargs=options, n_steps=8, batch_size=8)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.add_(0.2 * torch.randn_like(parameter))
    policy = export_entities(model, env_id="a test", action_names=("ahead", "port"), hold=1)
    rows = rows_of(FLEET, 64)
    expected, _ = model.predict(rows, deterministic=True)
    action, _ = policy.predict(rows, deterministic=True)
    turned = np.arctan2(action[:, 1], action[:, 0]) - np.arctan2(expected[:, 1], expected[:, 0])
    np.testing.assert_allclose(np.cos(turned), 1.0, atol=1e-6)


def test_untrained_network_steers_for_the_tags() -> None:
    pytest.importorskip("torch")
    import torch

    from tagtrack.train.entity_network import EntityActor

    actor = EntityActor(feature_names(FLEET), 0, 8, 0.5)
    rows = rows_of(FLEET)
    names = list(feature_names(FLEET))
    for t in range(3):
        rows[:, names.index(f"tag_{t}.bearing_cos")], rows[:, names.index(f"tag_{t}.bearing_sin")] = 0.0, 1.0  # all to port
    with torch.no_grad():
        mean, _ = actor(torch.as_tensor(rows))
    np.testing.assert_allclose(mean.numpy(), [[0.0, 0.5]] * 5, atol=0.1)


def test_files_keep_it_and_another_size_of_fleet_reads_it(tmp_path: Path) -> None:
    policy = policy_for(FLEET, hold=4)
    save_policy(tmp_path, policy)
    again = load_policy(tmp_path, feature_names(FLEET), action_names=action_names(FLEET))
    rows = rows_of(FLEET)
    np.testing.assert_array_equal(again.predict(rows, deterministic=True)[0], policy.predict(rows, deterministic=True)[0])
    other = Scenario(vehicles=7, targets=2)
    loaded = load_policy(tmp_path, feature_names(other), action_names=action_names(other))
    assert isinstance(loaded, EntityPolicy) and loaded.hold == 4
    assert loaded.predict(rows_of(other), deterministic=True)[0].shape == (5, 2)


def test_policy_for_another_sensor_is_refused_by_the_feature_that_differs(tmp_path: Path) -> None:
    from tagtrack.envs.scenario import SCENARIOS

    save_policy(tmp_path, policy_for(FLEET))
    other = replace(SCENARIOS["TagTrack/RangeOnly-v0"], vehicles=2)
    with pytest.raises(ValueError, match=r"cannot steer this fleet: .* a tag lacks 'last_units': use a policy trained on"):
        load_policy(tmp_path, feature_names(other), action_names=action_names(other))


def test_nan_in_an_observation_is_named() -> None:
    rows = rows_of(FLEET)
    rows[2, 4] = np.nan
    with pytest.raises(ValueError, match=r"feature 4 \('tag_0.log_spread_along'\) of row 2 is nan: it must be finite"):
        policy_for(FLEET).predict(rows)


@pytest.mark.parametrize("courses", ["line", "chosen"])
def test_courses_that_it_cannot_give_are_refused(courses: str) -> None:
    with pytest.raises(ValueError, match=rf"relative to the heading, or with one tag to the line, got '{courses}'; drop"):
        replace(policy_for(FLEET), courses=courses)


def test_with_one_tag_a_course_is_the_same_to_the_line_and_by_the_heading() -> None:
    one = replace(FLEET, targets=1)
    rows, names = rows_of(one), list(feature_names(one))
    bearing = np.linspace(-3.0, 3.0, len(rows))
    rows[:, names.index("bearing_cos")], rows[:, names.index("bearing_sin")] = np.cos(bearing), np.sin(bearing)
    by_line, _ = replace(policy_for(one), courses="line").predict(rows, deterministic=True)
    by_heading, _ = replace(policy_for(one), courses="heading").predict(rows, deterministic=True)
    turned = np.arctan2(by_heading[:, 1], by_heading[:, 0]) - np.arctan2(by_line[:, 1], by_line[:, 0])
    np.testing.assert_allclose(np.cos(turned - bearing), 1.0, atol=1e-5)
