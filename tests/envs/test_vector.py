"""The vector environment against Gymnasium's own SyncVectorEnv of single environments, in all three autoreset modes."""

import copy
import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import tagtrack  # noqa: F401  registers the ids
from tagtrack.envs.single import TagTrackEnv
from tagtrack.envs.vector import TagTrackVectorEnv

WORLDS = 3
LIMIT = 7
SMALL: dict[str, Any] = {"particles": 60, "overrides": {"episode_steps": LIMIT, "water.noisy_share": 0.2}}
ACTIONS = np.random.default_rng(0).uniform(-1.0, 1.0, (40, WORLDS, 2)).astype(np.float32)


def make(mode: AutoresetMode = AutoresetMode.NEXT_STEP, **arguments: Any) -> TagTrackVectorEnv:
    return TagTrackVectorEnv(num_envs=WORLDS, autoreset_mode=mode, **{**SMALL, **arguments})


def make_reference(mode: AutoresetMode, **arguments: Any) -> SyncVectorEnv:
    return SyncVectorEnv([lambda: TagTrackEnv(**{**SMALL, **arguments})] * WORLDS, autoreset_mode=mode)


def assert_same_info(ours: dict[str, Any], reference: dict[str, Any]) -> None:
    """Same keys and masks, and the same values wherever the mask is True."""
    assert ours.keys() == reference.keys()
    for key in (key for key in ours if not key.startswith("_")):
        mask = reference[f"_{key}"]
        np.testing.assert_array_equal(ours[f"_{key}"], mask)
        if isinstance(ours[key], dict):
            assert_same_info(ours[key], reference[key])
            continue
        assert ours[key].dtype == reference[key].dtype, key
        for world in np.flatnonzero(mask):
            np.testing.assert_array_equal(ours[key][world], reference[key][world])


def assert_same_step(ours: tuple[Any, ...], reference: tuple[Any, ...]) -> None:
    for mine, other in zip(ours[:-1], reference[:-1], strict=True):
        assert mine.dtype == other.dtype
        np.testing.assert_array_equal(mine, other)
    assert_same_info(ours[-1], reference[-1])


# Beside the plain one: several tags, fleets, and vehicles whose batteries end within the episode (0.05 Wh last 4 steps at 20 W).
BATTERY = {**SMALL["overrides"], "vehicle.battery": 0.05, "vehicle.battery_spread": 0.8}
TEAMS: dict[str, dict[str, Any]] = {
    "plain": {},
    "three tags": {"tags": 3},
    "battery": {"overrides": BATTERY},
    "fleet": {"vehicles": 2, "tags": 2, "overrides": BATTERY},
    "talking fleet": {"vehicles": 3, "modem": "tdma"},
}


def draw_actions(env: TagTrackVectorEnv) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1.0, 1.0, (40, *env.action_space.shape)).astype(np.float32)


@pytest.mark.parametrize("team", TEAMS)
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_each_autoreset_mode_does_what_gymnasiums_vector_of_single_environments_does(mode: AutoresetMode, team: str) -> None:
    ours, reference = make(mode, **TEAMS[team]), make_reference(mode, **TEAMS[team])
    assert ours.observation_space == reference.observation_space and ours.action_space == reference.action_space
    assert_same_step(ours.reset(seed=11), reference.reset(seed=11))
    for actions in draw_actions(ours):
        assert_same_step(ours.step(actions), reference.step(actions))


@pytest.mark.parametrize("team", TEAMS)
def test_disabled_mode_resets_the_masked_worlds_as_gymnasium_does(team: str) -> None:
    ours, reference = make(AutoresetMode.DISABLED, **TEAMS[team]), make_reference(AutoresetMode.DISABLED, **TEAMS[team])
    assert_same_step(ours.reset(seed=11), reference.reset(seed=11))
    for actions in draw_actions(ours):
        step = ours.step(actions)
        assert_same_step(step, reference.step(actions))
        ended = step[2] | step[3]
        if ended.any():
            mask = ended | np.array([True, False, False])
            assert_same_step(ours.reset(options={"reset_mask": mask}), reference.reset(options={"reset_mask": mask}))


def test_world_terminates_when_all_its_vehicles_have_left() -> None:
    env = make(AutoresetMode.DISABLED, vehicles=2, overrides=BATTERY)
    env.reset(seed=3)
    ended = {}
    for step in range(LIMIT):
        _, reward, terminated, _, info = env.step(np.zeros((WORLDS, 2, 2), np.float32))
        np.testing.assert_array_equal(terminated, ~info["active"].any(axis=1))
        assert (reward < 0.0).all()  # of those that took part in this step
        ended.update(dict.fromkeys(np.flatnonzero(terminated).tolist(), step))
        if terminated.any():
            env.reset(options={"reset_mask": terminated})
    assert len(ended) == WORLDS


def test_reward_of_a_team_is_the_mean_over_those_that_take_part() -> None:
    env = make(vehicles=3, modem="none", overrides={**BATTERY, "vehicle.battery": 0.06, "episode_steps": 40})
    _, info = env.reset(seed=0)
    seen, terminated = set(), np.zeros(WORLDS, bool)
    while not terminated.any():
        part = info["active"]  # before the step
        _, reward, terminated, _, info = env.step(np.zeros((WORLDS, 3, 2), np.float32))
        terms = sum(term for name, term in info.items() if name.startswith("reward_"))
        assert terms.shape == (WORLDS, 3) and (terms[~part] == 0.0).all()
        np.testing.assert_allclose(reward, [row[present].mean() for row, present in zip(terms, part, strict=True)])
        seen |= set(part.sum(axis=1).tolist())
    assert len(seen) > 1


def test_reset_mask_is_read_and_left_in_the_options() -> None:
    env = make(AutoresetMode.DISABLED)
    env.reset(seed=0)
    mask = np.array([False, True, False])
    options = {"reset_mask": mask}
    env.reset(options=options)
    assert options["reset_mask"] is mask and mask.tolist() == [False, True, False]


def test_masked_reset_with_a_seed_gives_each_world_its_own() -> None:
    env = make(AutoresetMode.DISABLED)
    first = env.reset(seed=5)[0]
    env.step(ACTIONS[0])
    again = env.reset(seed=5, options={"reset_mask": np.array([False, True, True])})[0]
    np.testing.assert_array_equal(again[1:], first[1:])
    assert not np.array_equal(again[0], first[0])


def test_disabled_mode_refuses_to_step_an_ended_world() -> None:
    env = make(AutoresetMode.DISABLED)
    env.reset(seed=0)
    for actions in ACTIONS[:LIMIT]:
        env.step(actions)
    with pytest.raises(gym.error.ResetNeeded, match=r"worlds \[0, 1, 2\] have ended"):
        env.step(ACTIONS[0])


def test_final_observation_is_the_one_before_the_reset() -> None:
    same, next_step = make(AutoresetMode.SAME_STEP), make(AutoresetMode.NEXT_STEP)
    same.reset(seed=0)
    next_step.reset(seed=0)
    for actions in ACTIONS[:LIMIT]:
        observation, _, _, truncated, info = same.step(actions)
        last = next_step.step(actions)[0]
    assert truncated.all()
    np.testing.assert_array_equal(np.stack(list(info["final_obs"])), last)
    np.testing.assert_array_equal(observation, next_step.step(ACTIONS[0])[0])


def test_seeds_may_be_given_one_by_one() -> None:
    env = make()
    np.testing.assert_array_equal(env.reset(seed=[4, 5, 6])[0], env.reset(seed=4)[0])
    with pytest.raises(ValueError, match="one seed for each of 3 worlds, got 2"):
        env.reset(seed=[1, 2])


def test_first_reset_without_a_seed_draws_one() -> None:
    assert not np.array_equal(make().reset()[0], make().reset()[0])


@pytest.mark.parametrize("limit", [3, LIMIT + 2])
def test_limit_that_is_asked_for_takes_the_place_of_the_scenarios(limit: int) -> None:
    env = make(max_episode_steps=limit)
    env.reset(seed=0)
    assert [bool(env.step(actions)[3].all()) for actions in ACTIONS[:limit]] == [False] * (limit - 1) + [True]
    assert make().episode_limit == LIMIT


def test_make_vec_gives_the_native_environment_with_the_registered_limit() -> None:
    env = gym.make_vec("TagTrack/LeopardShark-v0", num_envs=4, vectorization_mode="vector_entry_point", particles=50, threads=2)
    assert isinstance(env, TagTrackVectorEnv) and env.num_envs == 4
    assert env.episode_limit == 300 and env.spec is not None and env.spec.id == "TagTrack/LeopardShark-v0"
    assert env.simulation.threads == 2 and env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    env.close()


@pytest.mark.parametrize(
    "mask", [[True, False, False], np.zeros(3, bool), np.ones(2, bool), np.ones(3)], ids=["list", "none", "short", "float"]
)
def test_bad_reset_mask_is_refused(mask: Any) -> None:
    env = make(AutoresetMode.DISABLED)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="reset_mask must be a bool array of shape"):
        env.reset(options={"reset_mask": mask})


def test_first_reset_must_be_of_all_worlds() -> None:
    with pytest.raises(gym.error.ResetNeeded, match="all worlds"):
        make(AutoresetMode.DISABLED).reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(gym.error.ResetNeeded, match="reset before step"):
        make().step(ACTIONS[0])


def test_seeds_of_some_worlds_leave_the_others_to_go_on() -> None:
    env, other = make(), make()
    env.reset(seed=4)
    expected = env.reset(seed=None)[0]  # the second episodes of seeds 4, 5 and 6
    other.reset(seed=4)
    mixed = other.reset(seed=[9, None, 4])[0]
    np.testing.assert_array_equal(mixed[1], expected[1])
    np.testing.assert_array_equal(mixed[[0, 2]], [make().reset(seed=9)[0][0], make().reset(seed=4)[0][0]])
    np.testing.assert_array_equal(make().reset(seed=[9, None, 4])[0][2], mixed[2])  # None of a first reset is drawn


def test_worlds_are_asked_by_name_as_gymnasiums_vectors_are() -> None:
    pytest.importorskip("pygame")
    env, reference = make(render_mode="rgb_array"), make_reference(AutoresetMode.NEXT_STEP, render_mode="rgb_array")
    for name in ("observation_space", "action_space", "render_mode"):
        assert env.get_attr(name) == env.call(name) == reference.call(name)
    with pytest.raises(gym.error.ResetNeeded, match="reset before render"):
        env.call("render")
    env.reset(seed=0)
    reference.reset(seed=0)
    for actions in ACTIONS[: LIMIT + 3]:
        env.step(actions)
        reference.step(actions)
    for drawn, expected in zip(env.call("render"), reference.call("render"), strict=True):
        np.testing.assert_array_equal(drawn, expected)
    with pytest.raises(AttributeError, match="not asked to step one by one"):
        env.call("step", ACTIONS[0])
    with pytest.raises(AttributeError, match="no attribute 'depth'"):
        env.get_attr("depth")


def test_vector_is_recorded_as_a_grid(tmp_path: Path) -> None:
    pytest.importorskip("moviepy")
    if not hasattr(gym.wrappers.vector, "RecordVideo"):
        pytest.skip("this Gymnasium records no vectors")
    env = gym.make_vec("TagTrack/LeopardShark-v0", num_envs=4, particles=20, render_mode="rgb_array")
    env = gym.wrappers.vector.RecordVideo(env, str(tmp_path), video_length=3, step_trigger=lambda step: step == 0)
    env.reset(seed=0)
    for _ in range(5):
        env.step(env.action_space.sample())
    env.close()
    assert [file.suffix for file in tmp_path.iterdir()] == [".mp4"]


def test_more_pictures_than_anybody_looks_at_are_refused() -> None:
    pytest.importorskip("pygame")
    with pytest.raises(ValueError, match="pictures are of at most 64 worlds, got 65; make fewer to render"):
        TagTrackVectorEnv(num_envs=65, particles=2, render_mode="rgb_array")
    with pytest.raises(ValueError, match="render_mode must be None or 'rgb_array', got 'human'"):
        make(render_mode="human")


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_constructor_that_fails_has_nothing_to_close() -> None:
    """Gymnasium before 1.2 closes a vector when it is collected, also one that was never made."""
    for wrong in ({"render_mode": "ansi"}, {"particles": 0}):
        env = TagTrackVectorEnv.__new__(TagTrackVectorEnv)
        with pytest.raises(ValueError):
            env.__init__(**wrong)  # type: ignore[misc]
        env.close()


@pytest.mark.parametrize("shared", [{"threads": 2}, {"render_mode": "rgb_array"}], ids=["threads", "pictures"])
def test_copies_and_pickles_of_a_vector_go_on_alike(shared: dict[str, Any]) -> None:
    pytest.importorskip("pygame")
    env = make(**shared)
    env.reset(seed=2)
    env.step(ACTIONS[0])
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    expected = env.step(ACTIONS[1])
    for each in copies:
        assert_same_step(each.step(ACTIONS[1]), expected)
        each.close()
