"""Bad input ends in one line that names the value and the way out, before anything was changed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import TagTrackEnv
from tagtrack.envs.vector import TagTrackVectorEnv
from tagtrack.train.vec_env import TagTrackVecEnv

SHELLS = [TagTrackEnv, TagTrackVectorEnv, TagTrackVecEnv]


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"env_id": "TagTrack/Whale-v0"}, "'TagTrack/Whale-v0'; known: TagTrack/LeopardShark-v0, TagTrack/LeopardSharkSt"),
        ({"particles": 0}, "particles must be a whole number of at least 1, got 0"),
        ({"particles": -5}, "particles must be a whole number of at least 1, got -5"),
        ({"particles": 10.5}, "particles must be a whole number of at least 1, got 10.5"),
        ({"particles": 2**21}, "particles must be at most 1048576, got 2097152"),
        ({"overrides": {"tag.perod": 2.0}}, "unknown parameter 'tag.perod'; known: .*tag.period"),
        ({"overrides": {"tag": 2.0}}, r"tag must be given part by part \(period, random_delay, burst\), got 2.0"),
        ({"overrides": {"tag.period": -2.0}}, "Tag.period must be positive, got -2.0"),
        ({"overrides": {"tag.random_delay": -1.0}}, "Tag.random_delay must be at least 0, got -1.0"),
        ({"overrides": {"receiver": "range"}}, "belief.receiver cannot score the readings of a RangeReceiver, got StereoHydr"),
        ({"overrides": {"receiver": "sonar"}}, "one of stereo, .*, measured, or MODULE:CLASS of your own, got 'sonar'"),
        ({"overrides": {"start.deepest": 20.0}}, "Start.deepest must be 0 with a StereoHydrophone"),
        ({"preset": "masmitja2023"}, "unknown preset 'masmitja2023' of TagTrack/LeopardShark-v0; known: surf_zone"),
        ({"preset": "masmitja2023", "scenario": Scenario()}, "preset='masmitja2023' and a scenario are two scenarios"),
        ({"overrides": {"tag.period": float("nan")}}, "Tag.period must be finite, got nan"),
        ({"overrides": {"water.reach": "far"}}, "water.reach must be a number, got 'far'"),
        ({"overrides": {"belief": "kalman"}}, "belief must be one of standard, acoustic_ss, .*, got 'kalman'"),
        ({"overrides": {"belief.receiver.weighting": "loudness"}}, "one of bearing, strength, combined, got 'loudness'"),
        ({"overrides": {"episode_steps": 0}}, "episode_steps must be a whole number of at least 1, got 0"),
        ({"overrides": ["tag.period"]}, "overrides must map dotted names to values"),
        ({"scenario": "LeopardShark"}, "scenario must be a tagtrack.envs.scenario.Scenario, got 'LeopardShark'"),
        ({"vehicles": 21}, "vehicles must be a whole number from 1 to 20, got 21"),
        ({"tags": 0}, "tags must be a whole number from 1 to 20, got 0"),
        ({"modem": "radio"}, "modem must be one of perfect, none, instant, tdma, .*got 'radio'"),
        ({"time_scale": 0.5}, "time_scale=0.5 slows a recorded track, but none is given; add tracks=FILE"),
    ],
)
def test_bad_arguments_are_refused_alike_by_all_shells(shell: Any, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as raised:
        shell(**arguments)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("time_scale", [0.0, -1.0, float("nan")])
def test_bad_time_scale_is_named(tmp_path: Path, time_scale: float) -> None:
    track = tmp_path / "track.csv"
    track.write_text("t_unix_s,x,y\n0,0,0\n100,5,5\n")
    with pytest.raises(ValueError, match="time_scale must be (positive|finite), got"):
        TagTrackEnv(tracks=track, time_scale=time_scale)


def test_track_shorter_than_an_episode_is_refused_with_the_way_out(tmp_path: Path) -> None:
    track = tmp_path / "track.csv"
    track.write_text("t_unix_s,x,y\n0,0,0\n100,5,5\n")
    with pytest.raises(ValueError, match="lasts 100 s at time_scale=1, an episode 600 s; lower time_scale"):
        TagTrackEnv(tracks=track)
    assert TagTrackEnv(tracks=track, time_scale=0.05, particles=10).simulation.scenario.fish.time_scale == 0.05


def test_missing_track_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no track file .*nowhere.csv"):
        TagTrackEnv(tracks=tmp_path / "nowhere.csv")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_action_that_is_no_number_is_refused_and_changes_nothing(value: float) -> None:
    env = TagTrackEnv(particles=20)
    env.reset(seed=0)
    before = env.simulation.save_state()
    with pytest.raises(ValueError, match=r"actions must be finite, got .* for world 0"):
        env.step(np.array([0.0, value], np.float32))
    for own, saved in zip(env.simulation.save_state(), before, strict=True):
        assert own.tobytes() == saved.tobytes()


def test_the_world_of_a_bad_action_is_named() -> None:
    env = TagTrackVectorEnv(num_envs=3, particles=20)
    env.reset(seed=0)
    actions = np.zeros((3, 2), np.float32)
    actions[2, 1] = np.nan
    with pytest.raises(ValueError, match="for world 2"):
        env.step(actions)


@pytest.mark.parametrize(
    "step",
    [
        lambda: TagTrackEnv(particles=20).step,
        lambda: TagTrackVectorEnv(num_envs=3, particles=20).step,
        lambda: TagTrackVecEnv(num_envs=3, particles=20).step,
    ],
)
def test_actions_of_another_shape_are_refused(step: Callable[[], Any]) -> None:
    run = step()
    run.__self__.reset()
    with pytest.raises(ValueError, match=r"actions must have shape \(., 1, 2\), got"):
        run(np.zeros((3, 5), np.float32))


@pytest.mark.parametrize("value", [0, -1, 2.5, True])
def test_numbers_of_worlds_and_threads_are_whole_and_positive(value: Any) -> None:
    with pytest.raises(ValueError, match=f"num_worlds must be a whole number of at least 1, got {value}"):
        TagTrackVectorEnv(num_envs=value)
    with pytest.raises(ValueError, match=f"threads must be a whole number of at least 1, got {value}"):
        Simulation(Scenario(), threads=value)


@pytest.mark.parametrize("value", [0, -3, 1.5])
def test_limit_of_an_episode_is_whole_and_positive(value: Any) -> None:
    with pytest.raises(ValueError, match=f"max_episode_steps must be a whole number of at least 1, got {value}"):
        TagTrackVectorEnv(max_episode_steps=value)


def test_seed_out_of_range_is_named() -> None:
    with pytest.raises(ValueError, match="seeds must be from 0 to 9223372036854775807, got -1 to -1"):
        Simulation(Scenario()).reset(seed=-1)
