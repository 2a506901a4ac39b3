"""A specification says all that an environment was made with, survives JSON, and decides how long an episode lasts."""

import sys
import types
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec, register, registry

import tagtrack  # noqa: F401  registers the ids
from tagtrack.envs.motions import LevyFlight, Replay
from tagtrack.envs.overrides import describe_scenario, read_scenario
from tagtrack.envs.presets import PRESETS
from tagtrack.envs.rewards import Reward, Term
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sim.modem import TdmaModem
from tagtrack.envs.vector import TagTrackVectorEnv
from tests.envs.test_single import AHEAD, write_straight_track

ID = "TagTrack/LeopardShark-v0"
OPTIONS: dict[str, dict[str, Any]] = {
    "scenario": {"scenario": Scenario(fish=LevyFlight(), reward=Reward(standoff=0.5, perimeter=9.0)), "particles": 20},
    "models": {"modem": TdmaModem(), "vehicles": 3, "overrides": {"fish": LevyFlight(), "start.formation": "line"}},
    "numpy": {"overrides": {"water.noisy_share": np.float64(0.5)}, "particles": 20},
}


@pytest.mark.parametrize("options", OPTIONS)
def test_environment_is_made_again_from_json(options: str) -> None:
    env = gym.make(ID, **OPTIONS[options])
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.simulation.scenario == env.unwrapped.simulation.scenario
    assert again.spec == env.spec


def test_recorded_tracks_survive_json(tmp_path: Path) -> None:
    track = write_straight_track(tmp_path / "track.csv", speed=0.5)
    env = gym.make(ID, tracks=track, scenario=Scenario(fish=Replay(time_scale=0.5)), particles=20)
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    for each in (env, again):
        each.reset(seed=1)
    np.testing.assert_array_equal(env.step(AHEAD)[0], again.step(AHEAD)[0])


def test_vector_is_made_again_from_json() -> None:
    env = gym.make_vec(ID, num_envs=3, scenario=Scenario(speed_control=True), autoreset_mode=gym.vector.AutoresetMode.SAME_STEP)
    again = gym.make_vec(EnvSpec.from_json(env.spec.to_json()))
    assert isinstance(again, TagTrackVectorEnv) and again.metadata == env.metadata and again.num_envs == 3
    assert again.simulation.scenario == env.simulation.scenario


@pytest.mark.parametrize("scenarios", [SCENARIOS, *PRESETS.values()], ids=["ids", *PRESETS])
def test_every_scenario_is_read_back_from_its_description(scenarios: dict[str, Scenario]) -> None:
    for scenario in scenarios.values():
        assert read_scenario(describe_scenario(scenario)) == scenario


def test_models_of_ones_own_are_found_by_their_module(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(repository / "examples"))
    import own_motion
    import own_reward

    own: tuple[Term, ...] = (own_reward.KeepDistance(weight=0.5),)
    env = gym.make(ID, overrides={"reward.own": own, "fish": own_motion.DartAndRest()})
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.simulation.scenario == env.unwrapped.simulation.scenario
    assert isinstance(sys.modules["own_motion"], types.ModuleType)


@pytest.mark.parametrize(
    ("plain", "says"),
    [
        ({"fish": {"kind": "Teleport"}}, "fish.kind must be one of MomentumRandomWalk"),
        ({"depth": 3}, "unknown parameter 'scenario.depth'"),
    ],
)
def test_description_of_what_there_is_not_is_refused(plain: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        gym.make(ID, scenario=plain)


def length(env: gym.Env) -> int:
    """Steps until the environment itself, below Gymnasium's own limit, ends its episode."""
    own, steps, ended = env.unwrapped, 0, False
    own.reset(seed=0)
    while not ended:
        *_, ended, _ = own.step(AHEAD)
        steps += 1
    return steps


@pytest.mark.parametrize("limit", [5, 1000])
def test_limit_that_make_is_asked_for_is_the_environments(limit: int) -> None:
    env = gym.make(ID, particles=2, max_episode_steps=limit)
    assert length(env) == limit
    assert length(gym.make(EnvSpec.from_json(env.spec.to_json()))) == limit
    assert length(gym.make(ID, particles=2, overrides={"episode_steps": 7})) == 7


def test_limit_of_a_registration_is_the_environments() -> None:
    register("Mine/Long-v0", entry_point="tagtrack.envs.single:TagTrackEnv", max_episode_steps=400, kwargs={"particles": 2})
    try:
        assert length(gym.make("Mine/Long-v0")) == 400
        assert TagTrackVectorEnv("Mine/Long-v0").episode_limit == 400
    finally:
        del registry["Mine/Long-v0"]


def test_limit_beyond_what_recorded_tracks_were_chosen_for_is_refused(tmp_path: Path) -> None:
    track = write_straight_track(tmp_path / "track.csv", speed=0.5)
    with pytest.raises(ValueError, match="max_episode_steps=301 is beyond the 300 steps for which recorded tracks were chosen"):
        gym.make(ID, tracks=track, max_episode_steps=301)
