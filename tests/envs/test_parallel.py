"""The PettingZoo environment: its own conformance tests on every id, and the single environment found in it again."""

import warnings

import gymnasium
import numpy as np
import pettingzoo
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
from pettingzoo.test.state_test import test_state as check_state

import tagtrack
from tagtrack.envs.layout import features, split_observation
from tagtrack.envs.parallel import TagTrackParallelEnv, env, parallel_env

IDS = list(tagtrack._FLEETS)
FLEETS = [(3, 2), (1, 3), (2, 1)]
SMALL = {"particles": 64, "overrides": {"episode_steps": 30}}


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize(("vehicles", "tags"), FLEETS)
def test_passes_pettingzoos_own_tests(env_id: str, vehicles: int, tags: int) -> None:
    def make() -> TagTrackParallelEnv:
        return pettingzoo.make("parallel", env_id, vehicles=vehicles, tags=tags, **SMALL)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(make(), num_cycles=70)
        parallel_seed_test(make, num_cycles=20)
    turns = pettingzoo.make("aec", env_id, vehicles=vehicles, tags=tags, **SMALL)
    api_test(turns, num_cycles=70)
    check_state(turns, num_cycles=20)
    seed_test(lambda: pettingzoo.make("aec", env_id, vehicles=vehicles, tags=tags, **SMALL), num_cycles=20)


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("task", sorted(set(tagtrack._FLEETS.values())))
def test_one_vehicle_and_one_tag_are_the_gymnasium_environment_bit_for_bit(task: str, shared: bool) -> None:
    single = gymnasium.make(task, particles=200)
    fleet = parallel_env(task, vehicles=1, tags=1, modem="perfect" if shared else "none", particles=200)
    assert fleet.observation_space("auv_0") == single.observation_space and fleet.action_space("auv_0") == single.action_space
    for seed in (4, None):
        observation, _ = single.reset(seed=seed)
        observations, _ = fleet.reset(seed=seed)
        rng, ended = np.random.default_rng(1), False
        np.testing.assert_array_equal(observations["auv_0"], observation)
        while not ended:
            action = rng.uniform(-1, 1, single.action_space.shape).astype(np.float32)
            observation, reward, _, ended, info = single.step(action)
            observations, rewards, _, truncations, infos = fleet.step({"auv_0": action})
            np.testing.assert_array_equal(observations["auv_0"], observation)
            assert rewards["auv_0"] == reward and truncations["auv_0"] == ended
            assert infos["auv_0"]["localization_error"] == info["localization_error"]
    assert fleet.agents == []


def test_vehicles_start_in_formation() -> None:
    ring = parallel_env(vehicles=3, overrides={"start.separation": 30.0}, particles=10)
    ring.reset(seed=0)
    place = ring.simulation.vehicle_position[0]
    apart = [np.linalg.norm(place[i] - place[j]) for i, j in ((0, 1), (1, 2), (0, 2))]
    np.testing.assert_allclose(apart, 30.0)
    np.testing.assert_allclose(place.mean(axis=0), 0.0, atol=1e-9)
    line = parallel_env(vehicles=4, formation="line", particles=10)
    line.reset(seed=0)
    np.testing.assert_allclose(line.simulation.vehicle_position[0], [(0, -30), (0, -10), (0, 10), (0, 30)])


def test_state_is_all_observations_and_entities_are_found_in_them() -> None:
    fleet = parallel_env(vehicles=2, tags=3, particles=50)
    observations, _ = fleet.reset(seed=1)
    np.testing.assert_array_equal(fleet.state(), np.concatenate(list(observations.values())))
    parts = split_observation(observations["auv_1"], fleet.simulation.scenario)
    names = [feature.name for feature in features(fleet.simulation.scenario)]
    assert parts["own"].shape == (3,) and parts["tags"].shape == (3, 19) and parts["tag_mask"].all()
    assert parts["tags"][2, 0] == observations["auv_1"][names.index("tag_2.distance")]
    assert parts["own"][0] == observations["auv_1"][names.index("heading_cos")]


def test_course_is_relative_to_the_heading_where_there_are_several_tags() -> None:
    fleet = parallel_env(vehicles=1, tags=2, particles=50)
    fleet.reset(seed=2)
    heading = float(fleet.simulation.worlds.navigation["heading"][0, 0])
    fleet.step({"auv_0": np.array([0.0, 1.0], np.float32)})
    turned = float(fleet.simulation.worlds.vehicles["course"][0, 0]) - heading
    assert np.cos(turned) == pytest.approx(0.0, abs=1e-9) and np.sin(turned) == pytest.approx(1.0)


def test_ends_after_max_cycles_for_all_at_once_and_asks_for_a_reset() -> None:
    fleet = parallel_env(vehicles=2, particles=10, max_cycles=3)
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset before step"):
        fleet.step({})
    fleet.reset(seed=0)
    action = {agent: np.zeros(2, np.float32) for agent in fleet.agents}
    ended = [fleet.step(action)[3] for _ in range(3)]
    assert [list(each.values()) for each in ended] == [[False, False], [False, False], [True, True]]
    with pytest.raises(gymnasium.error.ResetNeeded, match="the episode has ended; call reset"):
        fleet.step(action)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"vehicles": 0}, "vehicles must be a whole number from 1 to 20, got 0"),
        ({"tags": 21}, "tags must be a whole number from 1 to 20, got 21"),
        ({"vehicles": 1.5}, "vehicles must be a whole number from 1 to 20, got 1.5"),
        ({"formation": "wedge"}, "formation must be one of ring, line, got 'wedge'"),
        ({"render_mode": "ansi"}, "render_mode must be None, 'rgb_array' or 'human', got 'ansi'"),
        ({"speed": 3}, "unknown option 'speed' of a task"),
    ],
)
def test_bad_fleets_are_named(options: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        parallel_env(**options)


def test_actions_are_for_all_agents_and_no_one_else() -> None:
    fleet = parallel_env(vehicles=2, particles=10)
    fleet.reset(seed=0)
    rest = np.zeros(2, np.float32)
    with pytest.raises(ValueError, match="no action for auv_1: the agents are auv_0, auv_1"):
        fleet.step({"auv_0": rest})
    with pytest.raises(ValueError, match="an action for 'auv_2': the agents are auv_0, auv_1"):
        fleet.step({"auv_0": rest, "auv_1": rest, "auv_2": rest})
    with pytest.raises(ValueError, match="actions must be finite"):
        fleet.step({"auv_0": rest, "auv_1": np.array([np.nan, 0.0])})


def test_picture_shows_the_fleet() -> None:
    pytest.importorskip("pygame")
    fleet = parallel_env(vehicles=3, tags=2, particles=50, render_mode="rgb_array")
    fleet.reset(seed=0)
    fleet.step({agent: np.ones(2, np.float32) for agent in fleet.agents})
    picture = fleet.render()
    assert picture is not None and picture.dtype == np.uint8 and picture.ndim == 3
    fleet.close()


def test_turn_by_turn_environment_is_pettingzoos_conversion() -> None:
    turns = env("LeopardShark-v0", vehicles=2, particles=10)
    turns.reset(seed=0)
    assert turns.agents == ["auv_0", "auv_1"] and turns.agent_selection == "auv_0"
