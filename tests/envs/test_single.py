"""The Gymnasium environment: what it returns, how episodes follow one another, and that its docstring tells the truth."""

import copy
import inspect
import re
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import tagtrack  # noqa: F401  registers the ids
from tagtrack.envs.area_only import AreaOnlyEnv
from tagtrack.envs.layout import action_names, features
from tagtrack.envs.motions import Replay
from tagtrack.envs.range_only import RangeOnlyEnv
from tagtrack.envs.rewards import Reward
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.single import TagTrackEnv
from tagtrack.envs.task import TaskOptions
from tagtrack.envs.telling import lone_reward, tell
from tagtrack.envs.time_of_flight import TimeOfFlightEnv
from tests.tasks import LONE

AHEAD = np.array([1.0, 0.0], np.float32)


def make(**arguments) -> TagTrackEnv:
    return TagTrackEnv(**{"particles": 100, **arguments})


def terms_of(info: dict[str, Any]) -> dict[str, Any]:
    """The terms of the reward by their names."""
    return {name.removeprefix("reward_"): value for name, value in info.items() if name.startswith("reward_")}


def table_under(heading: str, documented: type[TagTrackEnv] = TagTrackEnv) -> list[list[str]]:
    """Rows of the docstring's table under a heading, without its two head lines."""
    section = inspect.cleandoc(documented.__doc__).split(f"## {heading}\n")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("|")]
    return rows[2:]


@pytest.mark.parametrize("env_id", LONE)
def test_observation_table_of_the_docstring_agrees_with_the_features(env_id: str) -> None:
    env = gym.make(env_id, particles=10).unwrapped
    layout = features(env.simulation.scenario)
    expected = [[str(k), each.name, each.meaning, f"{each.low:g} to {each.high:g}"] for k, each in enumerate(layout)]
    assert table_under("Observation", type(env)) == expected
    assert f"``{env_id}``" in type(env).__doc__


def test_action_table_of_the_docstring_agrees_with_the_action_names() -> None:
    assert tuple(row[1] for row in table_under("Action")) == action_names(Scenario(speed_control=True))


def test_docstring_names_every_argument_and_the_default_lengths() -> None:
    text = TagTrackEnv.__doc__
    arguments = {*inspect.signature(TagTrackEnv).parameters} - {"options"} | {*TaskOptions.__annotations__}
    assert all(f"{name}:" in text for name in arguments)
    assert f"``episode_steps`` ({Scenario().episode_steps})" in text
    assert f"{Reward().error_cap:g} m" in text
    assert re.search(r"\* v0:", text)


@pytest.mark.parametrize("env_class", [TagTrackEnv, TimeOfFlightEnv, RangeOnlyEnv, AreaOnlyEnv])
def test_environments_made_without_an_id_are_those_of_their_docstring(env_class: type[TagTrackEnv]) -> None:
    env = env_class(particles=10)
    assert gym.spec(env.default_id).entry_point == f"{env_class.__module__}:{env_class.__name__}"
    assert env.observation_space == gym.make(env.default_id, particles=10).observation_space


@pytest.mark.parametrize(("env_id", "actions"), [(name, 3 if SCENARIOS[name].speed_control else 2) for name in LONE])
def test_spaces_are_finite_float32_boxes(env_id: str, actions: int) -> None:
    env = gym.make(env_id)
    assert env.observation_space.shape == (21,) and env.observation_space.dtype == np.float32
    assert env.observation_space.is_bounded()
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (actions,), np.float32)


@pytest.mark.parametrize("env_id", LONE)
def test_observations_stay_inside_their_bounds_in_bad_water(env_id: str) -> None:
    env = make(env_id=env_id, overrides={"water.noisy_share": 0.95})
    env.action_space.seed(0)
    observation, _ = env.reset(seed=0)
    for _ in range(400):
        assert observation in env.observation_space
        observation = env.step(env.action_space.sample())[0]


def test_step_returns_python_numbers_and_the_info_it_promises() -> None:
    env = make()
    env.reset(seed=1)
    _, reward, terminated, truncated, info = env.step(AHEAD)
    assert type(reward) is float and terminated is False and truncated is False
    assert info["belief_mean"].shape == (2,) and info["belief_covariance"].shape == (2, 2)
    assert all(f"``{name}``" in TagTrackEnv.__doc__ for name in info)


@pytest.mark.parametrize("team", [{}, {"tags": 2}, {"vehicles": 2, "tags": 2}, {"overrides": {"vehicle.battery": 5.0}}], ids=str)
def test_info_is_flat_and_of_numpy_and_of_one_shape_at_reset_and_step(team: dict[str, Any]) -> None:
    env = make(**team)
    _, first = env.reset(seed=1)
    *_, later = env.step(np.zeros(env.action_space.shape, np.float32))
    assert list(first) == list(later)
    for name in first:
        assert isinstance(later[name], (np.number, np.ndarray)) and type(first[name]) is type(later[name]), name
        assert first[name].dtype == later[name].dtype and first[name].shape == later[name].shape, name
    assert np.all(first["reward_localization"] == 0.0) and np.all(later["reward_localization"] < 0.0)


def test_info_tells_places_and_whose_word_it_is() -> None:
    """In a current, without a fix, a vehicle is not where it believes it is; range is between the true places."""
    env = make(overrides={"vehicle.random_current": 0.3, "vehicle.fix_interval": 0.0})
    env.reset(seed=1)
    for _ in range(50):
        info = env.step(AHEAD)[-1]
    apart = np.hypot(*(info["true_fish_position"] - info["true_vehicle_position"]))
    assert info["range"] == pytest.approx(apart, rel=1e-6)
    navigation = env.simulation.worlds.navigation[0, 0]
    assert info["vehicle_position"].tolist() == [navigation["x"], navigation["y"]]
    assert np.hypot(*(info["vehicle_position"] - info["true_vehicle_position"])) > 0.1


def test_quick_way_of_one_vehicle_and_one_tag_tells_what_others_are_told() -> None:
    env = make(overrides={"vehicle.random_current": 0.3})
    kept = [env.reset(seed=1)[1], *(env.step(AHEAD)[-1] for _ in range(30))]
    again = make(overrides={"vehicle.random_current": 0.3})
    again.reset(seed=1)
    for step, info in enumerate(kept):
        told = {name: values[0] for name, values in tell(again.simulation, np.array([step > 0])).items()}
        assert sorted(told) == sorted(info)
        for name in told:
            np.testing.assert_array_equal(info[name], told[name], err_msg=name)
        again.step(AHEAD)


@pytest.mark.parametrize("count", range(1, 13))
def test_reward_of_a_lone_vehicle_is_summed_as_numpy_sums(count: int) -> None:
    draws = np.random.default_rng(count)
    terms = draws.normal(size=(200, count)) * 10.0 ** draws.integers(-9, 9, (200, count))
    assert [lone_reward(row) for row in terms] == terms.sum(axis=-1).tolist()


def test_several_tags_have_a_row_each_and_their_mean_error_counts() -> None:
    env = gym.make("TagTrack/LeopardShark-v0", tags=3, particles=50).unwrapped
    observation, _ = env.reset(seed=1)
    assert observation.shape == (len(features(env.simulation.scenario)),) and env.action_space.shape == (2,)
    _, reward, _, _, info = env.step(AHEAD)
    simulation = env.simulation
    assert info["localization_error"] == pytest.approx(simulation.error[0, 0].mean())
    assert info["range"] == simulation.range[0, 0].min() and info["true_fish_position"].shape == (3, 2)
    assert info["detected"].shape == (3,) and info["belief_mean"].shape == (3, 2) and info["belief_covariance"].shape == (3, 2, 2)
    assert reward == sum(terms_of(info).values()) == -min(info["localization_error"], 100.0) / 100.0


def test_several_vehicles_are_steered_by_one_action() -> None:
    env = gym.make("TagTrack/LeopardSharkStandoff-v0", vehicles=2, modem="tdma", particles=50).unwrapped
    observation, _ = env.reset(seed=1)
    assert observation.shape == (2, len(features(env.simulation.scenario))) and env.action_space.shape == (2, 3)
    _, reward, terminated, truncated, info = env.step(np.ones((2, 3), np.float32))
    assert type(reward) is float and terminated is False and truncated is False
    assert all(value.shape[0] == 2 for name, value in info.items() if name != "true_fish_position")
    assert {"separation", "encroachments", "messages", "received", "active"} <= info.keys()
    assert reward == pytest.approx(sum(term.mean() for term in terms_of(info).values()))
    with pytest.raises(ValueError, match=r"actions must have shape \(1, 2, 3\), got \(1, 3\)"):
        env.step(np.ones(3, np.float32))


def test_vehicle_whose_battery_is_empty_ends_the_episode() -> None:
    """0.1 Wh at 60 W, hotel and propeller together, last 6 s; at first it is still gaining speed."""
    env = make(overrides={"vehicle.battery": 0.1})
    observation, info = env.reset(seed=1)
    assert info["battery"] == 1.0
    for _ in range(20):
        observation, reward, terminated, truncated, info = env.step(AHEAD)
        if terminated:
            break
    assert terminated is True and truncated is False and info["battery"] == 0.0
    assert reward < 0.0 and (observation == 0.0).all()


def test_info_tells_what_the_simulation_holds() -> None:
    env = make()
    env.reset(seed=2)
    for _ in range(20):
        info = env.step(AHEAD)[-1]
    simulation = env.simulation
    assert info["localization_error"] == simulation.error[0, 0, 0]
    assert info["range"] == pytest.approx(np.hypot(*(simulation.fish_position[0, 0] - simulation.vehicle_position[0, 0])))
    np.testing.assert_array_equal(info["belief_mean"], simulation.mean[0, 0, 0])
    np.testing.assert_array_equal(info["belief_covariance"], simulation.covariance[0, 0, 0])
    np.testing.assert_allclose(info["belief_mean"], simulation.worlds.particles[0, 0, 0, :2].mean(axis=1), rtol=1e-4)


def test_reward_is_the_sum_of_its_terms_and_minus_the_capped_error() -> None:
    env = TagTrackEnv("TagTrack/LeopardSharkStandoff-v0", particles=100, overrides={"reward.perimeter": 500.0})
    env.reset(seed=3)
    for _ in range(30):
        _, reward, _, _, info = env.step(np.array([1.0, 0.0, 1.0], np.float32))
        terms = terms_of(info)
        assert reward == sum(terms.values())
        assert terms["localization"] == -min(info["localization_error"], 100.0) / 100.0
        assert terms["standoff"] == pytest.approx(-(1.0 - info["range"] / 500.0))


@pytest.mark.parametrize(("action", "feature", "sign"), [((1, 0), 2, 1), ((-1, 0), 2, -1), ((0, 1), 3, -1), ((0, -1), 3, 1)])
def test_action_steers_relative_to_the_line_to_the_belief(action: tuple[int, int], feature: int, sign: int) -> None:
    """Ahead brings the belief ahead (cosine of its bearing near 1), astern astern; to port of the line it lies to starboard.

    The belief moves, so that the average over ten episodes after 20 s of turning is not quite 1. Later, the vehicle passes it.
    """
    env, seen = make(particles=300), []
    for seed in range(10):
        env.reset(seed=seed)
        seen += [env.step(np.array(action, np.float32))[0][feature] for _ in range(22)][10:]
    assert sign * np.mean(seen) > 0.6


def test_same_seed_repeats_an_episode_and_another_does_not() -> None:
    env = make()
    first = env.reset(seed=7)[0]
    assert not np.array_equal(first, env.reset(seed=8)[0])
    np.testing.assert_array_equal(first, env.reset(seed=7)[0])


def test_reset_without_a_seed_goes_on_to_the_next_episode() -> None:
    one, other = make(), make()
    first = one.reset(seed=7)[0]
    second, third = one.reset()[0], one.reset()[0]
    assert not np.array_equal(first, second) and not np.array_equal(second, third)
    other.reset(seed=7)
    other.step(AHEAD)
    np.testing.assert_array_equal(second, other.reset()[0])


def test_first_reset_without_a_seed_draws_one() -> None:
    assert not np.array_equal(make().reset()[0], make().reset()[0])


def test_episode_is_truncated_and_never_terminated() -> None:
    env = gym.make("TagTrack/LeopardShark-v0", particles=10)
    env.reset(seed=0)
    ends = [env.step(AHEAD)[2:4] for _ in range(300)]
    assert ends[:-1] == [(False, False)] * 299 and ends[-1] == (False, True)


@pytest.mark.parametrize(
    ("episode_steps", "max_episode_steps", "length"),
    [(20, None, 20), (20, 30, 30), (400, None, 400), (350, 320, 320), (20, -1, 20)],
)
def test_episode_lasts_as_the_scenario_says_or_as_make_is_asked(episode_steps: int, max_episode_steps: int, length: int) -> None:
    env = gym.make(
        "TagTrack/LeopardShark-v0",
        particles=10,
        overrides={"episode_steps": episode_steps},
        max_episode_steps=max_episode_steps,
    )
    env.reset(seed=0)
    ends = [env.step(AHEAD)[3] for _ in range(length)]
    assert ends == [False] * (length - 1) + [True]


def test_step_before_reset_is_refused() -> None:
    with pytest.raises(gym.error.ResetNeeded, match="reset before step"):
        make().step(AHEAD)


@pytest.mark.parametrize("render_mode", ["rgb_array", "human"])
def test_picture_before_reset_is_refused(render_mode: str) -> None:
    pytest.importorskip("pygame")
    env = gym.make("TagTrack/LeopardShark-v0", particles=20, render_mode=render_mode)
    unguarded = gym.wrappers.OrderEnforcing(env.unwrapped, disable_render_order_enforcing=True)
    for each in (env.unwrapped, unguarded):
        with pytest.raises(gym.error.ResetNeeded, match="call reset before render"):
            each.render()


def test_copy_of_an_environment_lives_on_by_itself() -> None:
    env = make()
    env.reset(seed=5)
    env.step(AHEAD)
    twin = copy.deepcopy(env)
    for _ in range(10):
        twin.step(AHEAD)
    expected = [env.step(AHEAD)[4] for _ in range(20)][10:]
    for info in expected:
        told = twin.step(AHEAD)[4]
        assert all(np.array_equal(told[name], value) for name, value in info.items())


def test_every_parameter_is_reached_by_its_dotted_name() -> None:
    env = make(particles=50, overrides={"belief": "levy", "tag.period": 5.0, "vehicle.max_speed": 2.0})
    scenario = env.simulation.scenario
    assert scenario.belief.particles == 50 and type(scenario.belief.motion).__name__ == "LevyFlight"
    assert scenario.tag.period == 5.0 and scenario.vehicle.max_speed == 2.0


def test_whole_scenario_takes_the_place_of_the_ids() -> None:
    env = make(scenario=Scenario(speed_control=True, episode_steps=5), particles=30)
    assert env.action_space.shape == (3,)
    assert env.simulation.scenario.episode_steps == 5 and env.simulation.scenario.belief.particles == 30


def write_straight_track(path: Path, speed: float) -> Path:
    """An animal that swims east for 40 minutes, logged every 10 s."""
    path.write_text("t_unix_s,x,y\n" + "".join(f"{1e9 + t},{5000 + speed * t},300.0\n" for t in range(0, 2401, 10)))
    return path


@pytest.mark.parametrize(("time_scale", "speed"), [(None, 0.5), (1.0, 0.5), (0.5, 0.25)])
def test_fish_swims_a_recorded_track_at_the_chosen_speed(tmp_path: Path, time_scale: float, speed: float) -> None:
    env = make(tracks=write_straight_track(tmp_path / "track.csv", speed=0.5), time_scale=time_scale)
    env.reset(seed=0)
    start = env.simulation.fish_position[0, 0].copy()
    assert 20.0 <= np.hypot(*start) <= 100.0
    for _ in range(100):
        env.step(AHEAD)
    assert np.hypot(*(env.simulation.fish_position[0, 0] - start)) == pytest.approx(100 * 2.0 * speed, abs=1e-3)  # steps of 2 s


def test_replay_of_a_scenario_keeps_its_own_time_scale(tmp_path: Path) -> None:
    track = write_straight_track(tmp_path / "track.csv", speed=0.5)
    env = make(scenario=Scenario(fish=Replay(time_scale=0.25)), tracks=track)
    assert env.simulation.scenario.fish == Replay(time_scale=0.25)
