"""Every baseline fits the seam of Stable-Baselines3: shapes, memory, batches."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

import tagtrack  # noqa: F401  registers the environments
from tagtrack.baselines.registry import BASELINES, make_baseline
from tagtrack.envs.simulation import Simulation

Make = Callable[..., Simulation]
Sight = Callable[..., np.ndarray]
every_baseline = pytest.mark.parametrize("name", BASELINES)


def roll_out(simulation: Simulation, name: str, seed: int, steps: int = 40) -> np.ndarray:
    """(K, B, A) actions."""
    policy = make_baseline(name, simulation)
    simulation.reset(seed=seed)
    actions, state = [], None
    for _ in range(steps):
        action, state = policy.predict(simulation.observation[:, 0], state)
        simulation.step(action[:, None])
        actions.append(action)
    return np.array(actions)


@every_baseline
@pytest.mark.parametrize("env_id", ["LeopardShark-v0", "LeopardSharkStandoff-v0"])
def test_row_of_a_batch_acts_as_a_batch_of_one(make_simulation: Make, name: str, env_id: str) -> None:
    together = roll_out(make_simulation(env_id, worlds=3), name, seed=11)
    assert together.dtype == np.float32
    assert together.shape == (40, 3, 2 if env_id == "LeopardShark-v0" else 3)
    assert (np.abs(together) <= 1.0).all()
    for row in range(3):
        alone = roll_out(make_simulation(env_id), name, seed=11 + row)
        np.testing.assert_array_equal(alone[:, 0], together[:, row])


@every_baseline
def test_one_observation_gives_one_action(make_simulation: Make, sight: Sight, name: str) -> None:
    simulation = make_simulation()
    simulation.reset(seed=0)
    policy = make_baseline(name, simulation)
    flat, state = policy.predict(sight()[0], None, np.ones(1, bool), deterministic=True)
    batch, _ = policy.predict(sight())
    assert flat.shape == (2,)
    np.testing.assert_array_equal(flat, batch[0])
    policy.predict(sight()[0], state, np.zeros(1, bool))


@every_baseline
def test_episode_start_clears_the_memory_of_its_row_alone(make_simulation: Make, name: str) -> None:
    simulation = make_simulation(worlds=2)
    policy = make_baseline(name, simulation)
    observation, state = simulation.reset(seed=3)[:, 0], None
    for _ in range(30):
        action, state = policy.predict(observation, state)
        simulation.step(action[:, None])
    goes_on, _ = policy.predict(observation, state, np.zeros(2, bool))
    mixed, _ = policy.predict(observation, state, np.array([True, False]))
    begins, _ = policy.predict(observation, None)
    np.testing.assert_array_equal(mixed, [begins[0], goes_on[1]])


def test_memory_goes_in_and_comes_out_unchanged(make_simulation: Make) -> None:
    """A state may be kept and used again: predict never writes into it."""
    for name in BASELINES:
        simulation = make_simulation(worlds=2)
        policy = make_baseline(name, simulation)
        observation = simulation.reset(seed=3)[:, 0]
        _, state = policy.predict(observation)
        before = None if state is None else [part.copy() for part in state]
        simulation.step(np.ones((2, 1, 2), np.float32))
        for _ in range(12):
            policy.predict(simulation.observation[:, 0], state)
        for part, kept in zip(state or (), before or (), strict=True):
            np.testing.assert_array_equal(part, kept)


@every_baseline
def test_stable_baselines3_evaluates_it(name: str) -> None:
    evaluation = pytest.importorskip("stable_baselines3.common.evaluation")
    monitor = pytest.importorskip("stable_baselines3.common.monitor")
    env = monitor.Monitor(gymnasium.make("TagTrack/LeopardShark-v0", particles=64, max_episode_steps=20))
    policy: Any = make_baseline(name, env.unwrapped.simulation)
    rewards, lengths = evaluation.evaluate_policy(policy, env, n_eval_episodes=2, return_episode_rewards=True)
    assert lengths == [20, 20]
    assert np.isfinite(rewards).all()


def test_random_courses_cover_the_circle_and_differ_by_seed_and_episode(make_simulation: Make, sight: Sight) -> None:
    simulation = make_simulation("LeopardSharkStandoff-v0")
    observation = sight(heading=np.linspace(-179, 179, 4000), bearing=-np.linspace(-179, 179, 4000))  # the line is 0
    action, state = make_baseline("random", simulation).predict(observation)
    course, speed = np.arctan2(action[:, 1], action[:, 0]), action[:, 2]
    # Counts of 500 in each of 8 sectors, standard error 21; means of uniforms, standard error 0.009.
    assert np.abs(np.histogram(course, bins=8, range=(-np.pi, np.pi))[0] - 500).max() < 90
    assert abs(speed.mean()) < 0.04
    assert abs(np.corrcoef(course, speed)[0, 1]) < 0.07
    other, _ = make_baseline("random:1", simulation).predict(observation)
    assert (other != action).any(axis=1).all()
    held, _ = make_baseline("random", simulation).predict(observation, state)
    np.testing.assert_array_equal(held, action)


def test_wrong_layouts_are_refused(make_simulation: Make, sight: Sight) -> None:
    simulation = make_simulation(worlds=2)
    simulation.reset(seed=0)
    policy = make_baseline("three_step", simulation)
    _, state = policy.predict(sight())
    with pytest.raises(ValueError, match=r"observations must have shape \(B, 21\), got \(1, 5\)"):
        policy.predict(np.zeros((1, 5), np.float32))
    with pytest.raises(ValueError, match="the state is of 1 rows, the observation of 2"):
        policy.predict(sight(bearing=[0.0, 1.0]), state)
    with pytest.raises(ValueError, match="observations must be of all 2 worlds, got 1"):
        make_baseline("information", simulation).predict(sight())


def test_course_is_the_same_whatever_actions_are_relative_to(make_simulation: Make, course_of: Callable[..., np.ndarray]) -> None:
    """By the line to the first tag's estimate or by the own heading."""
    for frame in ("line", "heading", "auto"):
        simulation = make_simulation(targets=2, steer_by=frame)
        observation = simulation.reset(seed=4)[:, 0]
        action, _ = make_baseline("stationary", simulation).predict(observation)
        navigation = simulation.worlds.navigation[0, 0]
        heading = float(navigation["heading"])
        away = simulation.mean[0, 0, 0] - np.array([navigation["x"], navigation["y"]])
        reference = np.arctan2(away[1], away[0]) if frame == "line" else heading
        turn = np.degrees(reference - heading) + course_of(action)[0]
        assert turn % 360 == pytest.approx(135, abs=1e-2)
