"""The Stable-Baselines3 environment: what it returns at an episode's end, staggered starts, and that SB3 learns in it."""

from typing import Any

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from tagtrack.envs.single import TagTrackEnv
from tagtrack.train.vec_env import TagTrackVecEnv

LIMIT = 12
SMALL: dict[str, Any] = {"particles": 60, "overrides": {"episode_steps": LIMIT, "water.noisy_share": 0.2}}
ACTIONS = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 4, 2)).astype(np.float32)


def make(num_envs: int = 4, **arguments: Any) -> TagTrackVecEnv:
    env = TagTrackVecEnv(num_envs=num_envs, **{**SMALL, **arguments})
    env.seed(5)
    return env


@pytest.mark.parametrize("threads", [1, 2])
def test_each_world_is_a_monitored_single_environment(threads: int) -> None:
    """Observations, rewards and ends of three episodes, and what is reported at their ends."""
    env = make(threads=threads)
    world = 2
    single = Monitor(TagTrackEnv(**SMALL))
    np.testing.assert_array_equal(env.reset()[world], single.reset(seed=5 + world)[0])
    errors = []
    for actions in ACTIONS[: 3 * LIMIT]:
        observation, reward, done, infos = env.step(actions)
        expected, expected_reward, _, truncated, info = single.step(actions[world])
        errors.append(info["localization_error"])
        assert reward.dtype == np.float32 and reward[world] == np.float32(expected_reward)
        assert done[world] == truncated
        if truncated:
            report = infos[world]
            np.testing.assert_array_equal(report["terminal_observation"], expected)
            assert report["TimeLimit.truncated"] is True
            assert report["episode"]["r"] == pytest.approx(info["episode"]["r"], abs=1e-6)
            assert report["episode"]["l"] == info["episode"]["l"] == LIMIT
            assert report["episode"]["localization_error"] == pytest.approx(np.mean(errors))
            expected = single.reset()[0]
            errors = []
        else:
            assert infos[world] == {}
        np.testing.assert_array_equal(observation[world], expected)
    env.close()


def test_staggered_worlds_end_one_after_another() -> None:
    env = make(stagger=True)
    env.reset()
    ends = np.stack([env.step(actions)[2] for actions in ACTIONS[: 2 * LIMIT]])
    assert [np.flatnonzero(column).tolist() for column in ends.T] == [[11, 23], [8, 20], [5, 17], [2, 14]]


def test_shortened_first_episode_reports_its_true_length() -> None:
    env = make(stagger=True)
    env.reset()
    reports = [info["episode"]["l"] for actions in ACTIONS[: LIMIT + 3] for info in env.step(actions)[3] if info]
    assert reports == [3, 6, 9, 12, 12]


def test_infos_of_a_step_belong_to_the_caller() -> None:
    env = make()
    env.reset()
    infos = env.step(ACTIONS[0])[3]
    infos[0]["mine"] = 1
    assert infos[1] == {} and env.step(ACTIONS[1])[3] == [{}, {}, {}, {}]


def test_returned_arrays_are_never_written_over() -> None:
    env = make()
    kept = [env.reset()]
    for actions in ACTIONS:
        kept += env.step(actions)[:3]
    copies = [array.copy() for array in kept]
    env.step(ACTIONS[0])
    env.reset()
    for array, copy in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_seed_begins_its_first_episode_and_reset_goes_on() -> None:
    env = make()
    first, second = env.reset(), env.reset()
    env.seed(5)
    np.testing.assert_array_equal(env.reset(), first)
    np.testing.assert_array_equal(env.reset(), second)
    assert not np.array_equal(first, second)


def test_first_reset_without_a_seed_draws_one() -> None:
    rows = [TagTrackVecEnv(num_envs=1, particles=10).reset() for _ in range(2)]
    assert not np.array_equal(*rows)


def test_lower_of_both_limits_truncates() -> None:
    env = make(max_episode_steps=4)
    env.reset()
    assert [bool(env.step(actions)[2].all()) for actions in ACTIONS[:4]] == [False, False, False, True]


def test_worlds_share_attributes_and_cannot_be_changed_one_by_one() -> None:
    env = make()
    assert env.get_attr("episode_limit", [0, 2]) == [LIMIT, LIMIT]
    assert env.env_is_wrapped(Monitor) == [True] * 4 and not any(env.env_is_wrapped(VecNormalize))
    with pytest.raises(NotImplementedError, match="'spec'"):
        env.set_attr("spec", None)
    with pytest.raises(NotImplementedError, match="'render'"):
        env.env_method("render")


def test_wrappers_of_stable_baselines_take_it() -> None:
    with pytest.warns(UserWarning, match="already wrapped"):  # it reports as a Monitor does
        env = VecNormalize(VecMonitor(make()))
    env.reset()
    for actions in ACTIONS[:LIMIT]:
        infos = env.step(actions)[3]
    assert all(info["episode"]["l"] == LIMIT and np.isfinite(info["terminal_observation"]).all() for info in infos)


def test_ppo_learns_and_is_evaluated_in_it() -> None:
    env = make(stagger=True)
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=2, seed=0, device="cpu")
    model.learn(128)
    assert {"r", "l", "t", "localization_error"} == model.ep_info_buffer[0].keys()
    rewards, lengths = evaluate_policy(model, make(), n_eval_episodes=4, return_episode_rewards=True)
    assert lengths == [LIMIT] * 4 and all(-LIMIT <= reward <= 0 for reward in rewards)
