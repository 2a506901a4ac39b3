"""The Stable-Baselines3 environment: what it returns at an episode's end, staggered starts, and that SB3 learns in it."""

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.wrappers import FlattenObservation
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize, VecVideoRecorder

from tagtrack.envs.parallel import TagTrackParallelEnv
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


# Batteries for some 8 steps at rest, give or take half: within an episode of 12 some vehicles leave, some stay.
BATTERY = {"vehicle.battery": 0.2, "vehicle.battery_spread": 0.5}
FLEET: dict[str, Any] = {"vehicles": 3, "tags": 2, "modem": "none", "overrides": {**SMALL["overrides"], **BATTERY}}


def test_each_row_is_a_vehicle_of_a_world() -> None:
    """Row b * V + v against the parallel environment of world b, through its first episode."""
    env = make(num_envs=6, **FLEET)
    worlds = [TagTrackParallelEnv(**{**SMALL, **FLEET}) for _ in range(2)]
    observation = env.reset()
    for b, world in enumerate(worlds):
        expected = world.reset(seed=5 + b)[0]
        np.testing.assert_array_equal(observation[3 * b : 3 * b + 3], np.stack(list(expected.values())))
    left, going = 0, [True, True]
    for actions in np.random.default_rng(1).uniform(-1, 1, (LIMIT, 6, 2)).astype(np.float32):
        observation, reward, done, infos = env.step(actions)
        for b, world in enumerate(worlds):
            if not going[b]:
                continue
            present = {agent: actions[3 * b + int(agent[-1])] for agent in world.agents}
            left += 3 - len(present)
            expected, rewards, *_ = world.step(present)
            rows = slice(3 * b, 3 * b + 3)
            assert done[rows].all() == done[rows].any() == (not world.agents)
            going[b] = not done[rows].any()
            for v, agent in enumerate(world.possible_agents):
                row = 3 * b + v
                seen = infos[row]["terminal_observation"] if done[row] else observation[row]
                np.testing.assert_array_equal(seen, expected.get(agent, 0.0))
                assert reward[row] == np.float32(rewards.get(agent, 0.0))
    assert left > 0 and not any(going)


def test_report_of_a_row_is_about_the_steps_in_which_its_vehicle_took_part() -> None:
    env = make(num_envs=6, **FLEET)
    env.reset()
    took_part, errors, returns = np.zeros((2, 3), int), np.zeros((2, 3)), np.zeros((2, 3))
    reports: dict[int, dict[str, Any]] = {}
    while len(reports) < 6:
        active = env.simulation.worlds.navigation["active"].copy()
        _, reward, done, infos = env.step(np.zeros((6, 2), np.float32))
        going = np.array([3 * b not in reports for b in range(2)])
        assert not reward[~active.ravel()].any()
        took_part += active & going[:, np.newaxis]
        returns += reward.reshape(2, 3) * going[:, np.newaxis]
        if not done.any():
            errors += np.where(active & going[:, np.newaxis], env.simulation.outputs.outcomes["error"], 0.0)
        reports.update({row: infos[row] for row in np.flatnonzero(done).tolist() if row not in reports})
    lengths = [reports[row]["episode"]["l"] for row in range(6)]
    assert lengths == took_part.ravel().tolist() and len(set(lengths)) > 1
    for row in range(6):
        assert reports[row]["episode"]["r"] == pytest.approx(returns.ravel()[row], abs=1e-5)
        assert reports[row]["TimeLimit.truncated"] == bool(reports[row]["terminal_observation"].any())


def test_worlds_of_a_fleet_are_staggered_not_their_vehicles() -> None:
    env = make(num_envs=8, vehicles=2, stagger=True)
    env.reset()
    ends = np.stack([env.step(np.zeros((8, 2), np.float32))[2] for _ in range(LIMIT)])
    assert [np.flatnonzero(column).tolist() for column in ends.T] == [[11], [11], [8], [8], [5], [5], [2], [2]]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"vehicles": 3, "num_envs": 4}, "num_envs counts vehicles of whole worlds, 3 in each, got 4; 3 would do"),
        ({"vehicles": 3, "num_envs": 0}, "num_envs must be a whole number of at least 1, got 0"),
        ({"hold": 0}, "hold must be a whole number of at least 1, got 0"),
        ({"hold": 2.0}, "hold must be a whole number of at least 1, got 2.0"),
    ],
)
def test_bad_numbers_of_rows_and_steps_are_named(arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        TagTrackVecEnv(**arguments)


def test_rows_of_one_world_are_the_default() -> None:
    assert TagTrackVecEnv(vehicles=3, particles=10).num_envs == 3


@pytest.mark.parametrize("steer_by", ["heading", "line"])
def test_held_decision_keeps_its_course_or_its_angle_to_the_line(steer_by: str) -> None:
    """Against single steps of another environment, to which the course is given anew, and rewards are summed."""
    overrides = {"steer_by": steer_by, "episode_steps": 30}
    held, stepped = make(hold=3, overrides=overrides), make(overrides=overrides)
    held.reset()
    stepped.reset()
    navigation = stepped.simulation.worlds.navigation
    for actions in ACTIONS[:5]:
        course = navigation["heading"][:, 0] + np.arctan2(actions[:, 1], actions[:, 0])
        total = np.zeros(4)
        for _ in range(3):
            now = actions
            if steer_by == "heading":
                turned = course - navigation["heading"][:, 0]
                now = np.stack([np.cos(turned), np.sin(turned)], axis=1).astype(np.float32)
            seen, reward, *_ = stepped.step(now)
            total += reward
        observation, reward, *_ = held.step(actions)
        steered = held.simulation.worlds.vehicles["course"]
        np.testing.assert_allclose(np.cos(steered - stepped.simulation.worlds.vehicles["course"]), 1.0, atol=1e-9)
        if steer_by == "heading":
            np.testing.assert_allclose(np.cos(steered[:, 0] - course), 1.0, atol=1e-9)
        np.testing.assert_allclose(observation, seen, atol=1e-3)
        np.testing.assert_allclose(reward, total, atol=1e-3)


def test_held_straight_on_is_the_first_heading() -> None:
    env = make(hold=4, overrides={"steer_by": "heading", "episode_steps": 30})
    env.reset()
    first = env.simulation.worlds.navigation["heading"].copy()
    env.step(np.array([(0.0, 0.0), (-0.0, -0.0), (1.0, 0.0), (3.0, 0.0)], np.float32))
    np.testing.assert_allclose(np.cos(env.simulation.worlds.vehicles["course"] - first), 1.0, atol=1e-9)


def test_last_decision_lasts_no_longer_than_the_episode() -> None:
    """Episodes of 12 steps, staggered ones of 3, 6 and 9, in decisions of 5; the next one begins at the next decision."""
    env, single = make(hold=5, stagger=True), make()
    env.reset()
    single.reset()
    seconds = single.reset()  # the first observations of every world's second episode
    lengths: dict[int, list[int]] = {world: [] for world in range(4)}
    for k in range(6):
        observation, reward, done, infos = env.step(ACTIONS[k])
        assert (reward > -5.0 - 1e-6).all()
        for world in np.flatnonzero(done).tolist():
            lengths[world].append(infos[world]["episode"]["l"])
            if len(lengths[world]) == 1:
                np.testing.assert_array_equal(observation[world], seconds[world])
    assert lengths == {0: [12, 12], 1: [9, 12], 2: [6, 12], 3: [3, 12]}


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
    for array, copied in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(array, copied)


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
    assert env.env_method("render") == [None] * 4
    assert env.env_method("has_wrapper_attr", "action_masks", indices=[1, 3]) == [False, False]
    with pytest.raises(AttributeError, match="not asked to reset one by one"):
        env.env_method("reset", indices=0)


def test_step_before_reset_is_refused_and_lists_are_taken() -> None:
    env, other = make(), make()
    with pytest.raises(ResetNeeded, match="reset before step"):
        env.step(ACTIONS[0])
    env.reset()
    other.reset()
    np.testing.assert_array_equal(env.step(ACTIONS[0].tolist())[0], other.step(list(ACTIONS[0]))[0])
    with pytest.raises(ValueError, match="actions must have shape"):
        env.step(ACTIONS[0][:2].tolist())


def test_monitor_of_the_batch_writes_what_the_last_step_told(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="already wrapped"):
        env = VecMonitor(make(), str(tmp_path / "log"), info_keywords=("range", "localization_error"))
    single = Monitor(TagTrackEnv(**SMALL), info_keywords=("range",))
    env.reset()
    single.reset(seed=5)
    for actions in ACTIONS[:LIMIT]:
        infos, info = env.step(actions)[3], single.step(actions[0])[4]
    assert infos[0]["episode"]["range"] == info["episode"]["range"]
    env.close()
    assert "r,l,t,range,localization_error" in (tmp_path / "log.monitor.csv").read_text()


def test_make_vec_env_makes_a_batch() -> None:
    options = {**SMALL, "max_episode_steps": 4}
    env = make_vec_env("TagTrack/LeopardShark-v0", n_envs=3, seed=5, vec_env_cls=TagTrackVecEnv, env_kwargs=options)
    assert isinstance(env, TagTrackVecEnv) and env.num_envs == 3 and env.episode_limit == 4
    np.testing.assert_array_equal(env.reset(), make(3).reset())
    fleet = make_vec_env(TagTrackEnv, n_envs=2, vec_env_cls=TagTrackVecEnv, env_kwargs={"vehicles": 3, "particles": 10})
    assert fleet.num_envs == 6  # a row is a vehicle


def test_batch_takes_no_environments_that_do_more_than_it_does(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="FlattenObservation wraps single environments; wrap the batch"):
        make_vec_env(TagTrackEnv, vec_env_cls=TagTrackVecEnv, wrapper_class=FlattenObservation)
    with pytest.raises(ValueError, match="use VecMonitor"):
        make_vec_env(TagTrackEnv, vec_env_cls=TagTrackVecEnv, monitor_dir=str(tmp_path))
    with pytest.raises(ValueError, match="a batch is made of TagTrack's environments, got .*CartPole"):
        make_vec_env("CartPole-v1", vec_env_cls=TagTrackVecEnv)
    with pytest.raises(ValueError, match="env_id must be an id, a Task, or functions"):
        TagTrackVecEnv([])


def test_batch_of_functions_follows_worlds_from_the_first_picture_on() -> None:
    """``make_vec_env`` asks for pictures by itself, of hundreds of worlds, too: who looks at none pays for none."""
    pytest.importorskip("pygame")
    many = make_vec_env("TagTrack/LeopardShark-v0", 65, env_kwargs={"particles": 10}, vec_env_cls=TagTrackVecEnv)
    many.reset()
    assert many.render_mode is None
    env = make_vec_env("TagTrack/LeopardShark-v0", 2, env_kwargs={"particles": 10}, vec_env_cls=TagTrackVecEnv)
    own = TagTrackVecEnv("TagTrack/LeopardShark-v0", 2, particles=10, render_mode="rgb_array")
    for each in (env, own):
        each.seed(3)
        each.reset()
    for actions in ACTIONS[:3]:
        env.step(actions[:2])
        own.step(actions[:2])
    late = env.env_method("render", indices=0)[0]
    assert late.shape == own.env_method("render", indices=0)[0].shape and (late != own.env_method("render", indices=0)[0]).any()
    for each in (env, own):
        each.seed(3)
        each.reset()
    for actions in ACTIONS[:3]:
        env.step(actions[:2])
        own.step(actions[:2])
    np.testing.assert_array_equal(env.get_images(), own.get_images())


def test_pictures_are_laid_out_and_recorded(tmp_path: Path) -> None:
    pytest.importorskip("pygame")
    env = make(num_envs=2, render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="reset before render"):
        env.get_images()
    env.reset()
    one = env.env_method("render", indices=1)[0]
    assert env.render().shape[0] >= one.shape[0] and len(env.get_images()) == 2
    pytest.importorskip("moviepy")
    recorder = VecVideoRecorder(env, str(tmp_path), record_video_trigger=lambda step: step == 0, video_length=3)
    recorder.reset()
    for actions in ACTIONS[:5]:
        recorder.step(actions[:2])
    recorder.close()
    assert [file.suffix for file in tmp_path.iterdir()] == [".mp4"]


@pytest.mark.parametrize("shared", [{"threads": 2}, {"render_mode": "rgb_array"}], ids=["threads", "pictures"])
def test_copies_of_a_batch_go_on_alike(shared: dict[str, Any]) -> None:
    pytest.importorskip("pygame")
    env = make(**shared)
    env.reset()
    twins = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    expected = env.step(ACTIONS[0])
    for twin in twins:
        for mine, other in zip(twin.step(ACTIONS[0])[:3], expected[:3], strict=True):
            np.testing.assert_array_equal(mine, other)
        twin.close()


def test_wrappers_of_stable_baselines_take_it() -> None:
    with pytest.warns(UserWarning, match="already wrapped"):  # it reports as a Monitor does
        env = VecNormalize(VecMonitor(make()))
    env.reset()
    for actions in ACTIONS[:LIMIT]:
        infos = env.step(actions)[3]
    assert all(info["episode"]["l"] == LIMIT and np.isfinite(info["terminal_observation"]).all() for info in infos)


@pytest.mark.parametrize("arguments", [{"num_envs": 6, **FLEET}, {"num_envs": 2, "tags": 3, "hold": 3}], ids=["fleet", "hold"])
def test_ppo_learns_in_fleets_and_with_held_decisions(arguments: dict[str, Any]) -> None:
    env = make(stagger=True, **arguments)
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=16, n_epochs=2, seed=0, device="cpu")
    before = [parameter.detach().clone() for parameter in model.policy.parameters()]
    model.learn(2 * 16 * env.num_envs)
    assert all(parameter.isfinite().all() for parameter in model.policy.parameters())
    assert any((parameter != old).any() for parameter, old in zip(model.policy.parameters(), before, strict=True))
    assert len(model.ep_info_buffer) >= env.num_envs


def test_ppo_learns_and_is_evaluated_in_it() -> None:
    env = make(stagger=True)
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=2, seed=0, device="cpu")
    model.learn(128)
    assert {"r", "l", "t", "localization_error"} == model.ep_info_buffer[0].keys()
    rewards, lengths = evaluate_policy(model, make(), n_eval_episodes=4, return_episode_rewards=True)
    assert lengths == [LIMIT] * 4 and all(-LIMIT <= reward <= 0 for reward in rewards)
