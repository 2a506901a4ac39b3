"""The checkers of Gymnasium and Stable-Baselines3, for every id and render mode, and every way to make a vector of worlds."""

import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import tagtrack  # noqa: F401  registers the ids
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.vector import TagTrackVectorEnv
from tests.tasks import LONE

IDS = list(SCENARIOS)


@pytest.fixture(autouse=True)
def warnings_are_errors(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        yield


def test_every_scenario_is_registered_under_its_id() -> None:
    assert {name for name in gym.registry if name.startswith("TagTrack/")} == set(SCENARIOS)
    for env_id in IDS:
        assert gym.spec(env_id).kwargs == {"env_id": env_id}
        assert gym.spec(env_id).max_episode_steps is None  # the environment ends its episodes itself
        assert gym.make(env_id).unwrapped.simulation.scenario == SCENARIOS[env_id]


@pytest.mark.parametrize("render_mode", [None, "rgb_array", "human"])
@pytest.mark.parametrize("env_id", IDS)
def test_gymnasium_checker_finds_nothing(env_id: str, render_mode: str | None) -> None:
    env = gym.make(env_id, particles=50, render_mode=render_mode)
    check_env(env.unwrapped, skip_render_check=render_mode is None)


@pytest.mark.parametrize("team", [{"tags": 3}, {"vehicles": 2, "tags": 2}, {"vehicles": 2, "modem": "tdma"}], ids=str)
@pytest.mark.parametrize("env_id", IDS)
def test_gymnasium_checker_finds_nothing_in_a_team(env_id: str, team: dict[str, Any]) -> None:
    battery = {"vehicle.battery": 0.5, "vehicle.battery_spread": 0.5}
    check_env(gym.make(env_id, particles=20, overrides=battery, **team).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("env_id", LONE)
def test_stable_baselines_checker_finds_nothing(env_id: str) -> None:
    check_env_sb3(gym.make(env_id, particles=50).unwrapped)


@pytest.mark.parametrize("mode", ["sync", "vector_entry_point"])
@pytest.mark.parametrize("env_id", IDS)
def test_make_vec_steps_in_every_mode(env_id: str, mode: str) -> None:
    assert_steps(gym.make_vec(env_id, num_envs=2, vectorization_mode=mode, particles=50))


def test_make_vec_takes_the_native_environment_by_default() -> None:
    assert isinstance(gym.make_vec(IDS[0], num_envs=2, particles=50), TagTrackVectorEnv)


@pytest.mark.parametrize("mode", ["sync", "vector_entry_point"])
def test_make_vec_of_a_fleet_steps_in_every_mode(mode: str) -> None:
    assert_steps(gym.make_vec(IDS[0], num_envs=2, vectorization_mode=mode, particles=50, vehicles=3, tags=2), vehicles=3, tags=2)


def test_async_vector_runs_in_processes_of_their_own() -> None:
    env = gym.make_vec(IDS[0], num_envs=2, vectorization_mode="async", vector_kwargs={"context": "spawn"}, particles=50)
    assert_steps(env)


def assert_steps(env: gym.vector.VectorEnv, **options: Any) -> None:
    """Worlds 0 and 1 of any vector are those of seeds 3 and 4."""
    try:
        observation, _ = env.reset(seed=3)
        expected = gym.make(env.spec.id if env.spec else IDS[0], particles=50, **options).reset(seed=4)[0]
        np.testing.assert_array_equal(observation[1], expected)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert observation in env.observation_space and reward.shape == (2,)
        assert not terminated.any() and not truncated.any()
        assert info["localization_error"].shape[0] == 2 and info["_localization_error"].all()
    finally:
        env.close()
