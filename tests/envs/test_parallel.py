"""The PettingZoo environment: its own conformance tests on every id, and the single environment found in it again."""

import copy
import pickle
import warnings
from functools import partial
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pettingzoo
import pytest
from pettingzoo import AECEnv
from pettingzoo.test import api_test, max_cycles_test, parallel_api_test, parallel_seed_test, render_test, seed_test
from pettingzoo.test.state_test import test_state as check_state

import tagtrack
from tagtrack.envs.layout import features, split_observation
from tagtrack.envs.parallel import TagTrackParallelEnv, env, parallel_env
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.task import full_id
from tests.tasks import LONE

IDS = list(tagtrack._FLEETS)
FLEETS = [(3, 2), (1, 3), (2, 1)]
STEPS = 14
SMALL: dict[str, Any] = {"particles": 16, "overrides": {"episode_steps": STEPS}}
# What the hotel load uses up within an episode, give or take half, at most: some vehicles leave, some stay.
KINDS = {"plain": {}, "drop out": {"vehicle.battery_spread": 0.5}, "talk": {"modem": "tdma"}}


def conform(env_id: str, kind: str, vehicles: int, tags: int) -> dict[str, Any]:
    """Options of a small fleet: plain, of vehicles that drop out, or of such that talk."""
    overrides = {**SMALL["overrides"], **KINDS[kind]}
    if kind == "drop out":
        scenario = SCENARIOS[tagtrack._FLEETS[env_id]]
        overrides["vehicle.battery"] = scenario.vehicle.hotel_power * STEPS * scenario.time_step / 3600.0
    return {"vehicles": vehicles, "tags": tags, "particles": 16, "overrides": overrides}


@pytest.mark.filterwarnings("ignore:(Observation|State) numpy array is all zeros")  # as those who have left see
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize(("vehicles", "tags"), FLEETS)
def test_passes_pettingzoos_own_tests(env_id: str, vehicles: int, tags: int, kind: str) -> None:
    options = conform(env_id, kind, vehicles, tags)

    def make() -> TagTrackParallelEnv:
        return pettingzoo.make("parallel", env_id, **options)

    def make_turns() -> AECEnv:
        return pettingzoo.make("aec", env_id, **options)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(make(), num_cycles=2 * STEPS)
        parallel_seed_test(make, num_cycles=STEPS)
    api_test(make_turns(), num_cycles=2 * STEPS * vehicles)
    check_state(make_turns(), num_cycles=STEPS)
    seed_test(make_turns, num_cycles=STEPS)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("env_id", IDS)
def test_episode_of_any_fleet_lasts_max_cycles_and_is_drawn(env_id: str, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    options = {"env_id": env_id, **conform(env_id, kind, 3, 2)}
    lasting = {**options, "overrides": dict(options["overrides"])}
    if kind == "drop out":
        lasting["overrides"]["vehicle.battery"] *= 10.0  # the test resets without a seed, and wants most to stay for its 4 cycles
    module = SimpleNamespace(parallel_env=partial(parallel_env, **lasting), env=partial(env, **lasting))
    max_cycles_test(module)
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr("tagtrack.envs.rendering.FRAMES_PER_SECOND", 0)  # no waiting between frames
    render_test(lambda render_mode: env(render_mode=render_mode, **options))


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("task", sorted(set(tagtrack._FLEETS.values()) & set(LONE)))
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
    assert parts["mates"].shape == (1, 9) and parts["mate_mask"].all()
    assert parts["tags"][2, 0] == observations["auv_1"][names.index("tag_2.distance")]
    assert parts["mates"][0, 2] == observations["auv_1"][names.index("mate_0.distance")]
    assert parts["own"][0] == observations["auv_1"][names.index("heading_cos")]


def drifting(**options: Any) -> TagTrackParallelEnv:
    """Three vehicles at rest, whose batteries end one after the other."""
    overrides = {"vehicle.battery": 0.1, "vehicle.battery_spread": 0.9, "speed_control": True, "vehicle.fix_interval": 0.0}
    return parallel_env(**{"vehicles": 3, "particles": 20, **options, "overrides": {**overrides, **options.get("overrides", {})}})


def rest(fleet: TagTrackParallelEnv) -> dict[str, np.ndarray]:
    action = np.zeros(fleet.action_space("auv_0").shape, np.float32)
    action[2] = -1.0
    return {agent: action.copy() for agent in fleet.agents}


@pytest.mark.parametrize("modem", ["perfect", "none", "tdma"])
def test_agent_leaves_for_good_when_its_battery_is_empty(modem: str) -> None:
    """0.1 Wh, or 360 J, last 9 steps of 2 s at 20 W; 90 % more or less, 1 to 18."""
    fleet = drifting(modem=modem)
    fleet.reset(seed=4)
    width = fleet.observation_space("auv_0").shape[0]
    left: dict[str, int] = {}
    for step in range(1, 20):
        present = list(fleet.agents)
        observations, rewards, terminations, truncations, infos = fleet.step(rest(fleet))
        for told in (observations, rewards, terminations, truncations, infos):
            assert list(told) == present
        assert not any(truncations.values())
        for agent in present:
            assert (infos[agent]["battery"] == 0.0) == terminations[agent] == (agent not in fleet.agents)
            if terminations[agent]:
                left[agent] = step
                assert rewards[agent] < 0.0 and infos[agent]["localization_error"] > 0.0
                assert (observations[agent] == 0.0).all()
        for agent in left:
            row = int(agent[-1])
            assert (fleet.state()[row * width : (row + 1) * width] == 0.0).all()
        if not fleet.agents:
            break
    assert fleet.state().shape == fleet.state_space.shape == (3 * width,)
    assert len(set(left.values())) > 1 and set(left) == set(fleet.possible_agents)
    with pytest.raises(gymnasium.error.ResetNeeded, match="the episode has ended"):
        fleet.step({})
    assert len(fleet.reset()[0]) == len(fleet.agents) == 3


def test_action_for_an_agent_that_has_left_is_refused() -> None:
    fleet = drifting()
    fleet.reset(seed=4)
    everyone = rest(fleet)
    while len(fleet.agents) == 3:
        fleet.step(rest(fleet))
    gone = (set(everyone) - set(fleet.agents)).pop()
    with pytest.raises(ValueError, match=f"an action for '{gone}' has left, its battery is empty; agents are still auv_"):
        fleet.step(everyone)


def test_who_has_left_is_no_danger_and_is_known_to_nobody() -> None:
    """All lie within 20 m of one another, which counts as too near: the last one has nobody to come near to."""
    fleet = drifting(overrides={"reward.least_separation": 60.0})
    _, infos = fleet.reset(seed=4)
    assert all(info["separation"] == pytest.approx(20.0) for info in infos.values())
    while len(fleet.agents) > 1:
        observations, *_, infos = fleet.step(rest(fleet))
        assert all(info["encroachments"] == 1 for info in infos.values())
    last = fleet.agents[0]
    assert infos[last]["separation"] == np.inf
    assert not split_observation(observations[last], fleet.simulation.scenario)["mate_mask"].any()


def test_infos_count_messages_and_masks_tell_who_has_been_heard_of() -> None:
    """Slots of 10 s in turn: within 20 steps of 2 s each of two vehicles sends twice, and nothing is lost."""
    fleet = parallel_env(vehicles=2, modem="tdma", particles=20, overrides={"modem.loss": 0.0, "modem.loss_at_range": 0.0})
    observations, infos = fleet.reset(seed=0)
    scenario = fleet.simulation.scenario
    assert not any(split_observation(observation, scenario)["mate_mask"].any() for observation in observations.values())
    for _ in range(20):
        observations, *_, infos = fleet.step({agent: np.zeros(2, np.float32) for agent in fleet.agents})
    assert [(info["messages"], info["received"]) for info in infos.values()] == [(2, 2), (2, 2)]
    assert all(split_observation(observation, scenario)["mate_mask"].all() for observation in observations.values())
    assert "battery" not in infos["auv_0"]


def test_action_has_a_component_for_each_choice() -> None:
    overrides = {"steer_by": "chosen", "speed_control": True, "message_control": True, "modem": "tdma"}
    fleet = parallel_env(vehicles=2, tags=3, particles=20, overrides=overrides)
    assert fleet.action_space("auv_1").shape == (7,) and len(fleet.simulation.action_names) == 7
    assert all(f"{name}" in TagTrackParallelEnv.__doc__ for name in ("ahead", "port", "speed", "tag_0, tag_1", "message"))
    fleet.reset(seed=0)
    silent, talking = np.full(7, -1.0, np.float32), np.ones(7, np.float32)
    for _ in range(20):
        *_, infos = fleet.step({"auv_0": silent, "auv_1": talking})
    assert infos["auv_0"]["messages"] == 0 and infos["auv_1"]["messages"] == 2


def test_picture_before_reset_is_refused() -> None:
    pytest.importorskip("pygame")
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset before render"):
        parallel_env(vehicles=2, particles=20, render_mode="rgb_array").render()


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
    ],
)
def test_bad_fleets_are_named(options: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        parallel_env(**options)


def test_unknown_option_is_refused_as_python_does() -> None:
    """TorchRL offers ``frameskip`` and goes on without where the words are these."""
    with pytest.raises(TypeError, match="got an unexpected keyword argument 'frameskip'; options of a task: preset, "):
        parallel_env(frameskip=1)


def test_actions_are_for_all_agents_and_no_one_else() -> None:
    fleet = parallel_env(vehicles=2, particles=10)
    fleet.reset(seed=0)
    rest = np.zeros(2, np.float32)
    with pytest.raises(ValueError, match="no action for auv_1: the agents are auv_0, auv_1"):
        fleet.step({"auv_0": rest})
    with pytest.raises(ValueError, match="an action for 'auv_2': the agents are auv_0, auv_1"):
        fleet.step({"auv_0": rest, "auv_1": rest, "auv_2": rest})
    for action, message in (
        (np.array([np.nan, 0.0]), "the action of auv_1 must be finite"),
        (np.zeros(3), r"the action of auv_1 must have shape \(2,\), got \(3,\)"),
        ("left", "the action of auv_1 must be numbers, got 'left'"),
    ):
        with pytest.raises(ValueError, match=message):
            fleet.step({"auv_0": rest, "auv_1": action})
    with pytest.raises(ValueError, match="actions must map agents to arrays, got list"):
        fleet.step([rest, rest])  # type: ignore[arg-type]


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


def test_names_are_those_of_pettingzoos_registry_which_every_way_in_takes() -> None:
    for env_id, task in tagtrack._FLEETS.items():
        assert full_id(env_id) == task
        assert parallel_env(env_id, particles=10).metadata["name"] == env_id.partition("/")[2]


def test_errors_name_the_argument_as_it_is_called_here() -> None:
    with pytest.raises(ValueError, match="max_cycles must be a whole number of at least 1, got 0"):
        parallel_env(max_cycles=0)
    with pytest.raises(ValueError, match="formation must be one of ring, line, got 3"):
        parallel_env(formation=3)  # type: ignore[arg-type]


def test_a_copy_of_a_fleet_that_is_drawn_goes_on_alike_and_draws_the_same_picture() -> None:
    pytest.importorskip("pygame")
    fleet = parallel_env(vehicles=2, particles=20, render_mode="rgb_array")
    fleet.reset(seed=3)
    ahead = {agent: np.array([1.0, 0.2], np.float32) for agent in fleet.agents}
    fleet.step(ahead)
    for other in (copy.deepcopy(fleet), pickle.loads(pickle.dumps(fleet))):
        np.testing.assert_array_equal(other.render(), fleet.render())
        original = copy.deepcopy(fleet)
        for each in (original, other):
            each.step(ahead)
        np.testing.assert_array_equal(other.state(), original.state())
        np.testing.assert_array_equal(other.render(), original.render())
