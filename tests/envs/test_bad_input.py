"""Bad input ends in one line that names the value and the way out, before anything was changed."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tagtrack.envs.parallel import parallel_env
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
        ({"overrides": {"tag.perod": 2.0}}, r"unknown parameter 'tag.perod'; did you mean tag.period\? known: tag.period, "),
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
        ({"overrides": {"tag.period": 5e-150}}, "Tag.period must be at least 0.0002 s, a 10000th of the time step"),
        ({"overrides": {"fish": "legs", "fish.longest_leg": 1e-9}}, "StraightLegs.longest_leg must be at least 0.0002 s"),
        ({"overrides": {"vehicle.control_interval": 1e-6}}, "control_interval must be at least 0.0002 s, a 10000th of the time"),
        ({"overrides": {"time_step": 1e7}}, r"time_step must be at most 100000 in size, got 1e\+07"),
        ({"overrides": {"targets": 10**6}}, "targets must be at most 256, got 1000000"),
        ({"overrides": {"episode_steps": 10**30}}, "episode_steps must be at most 10000000, got 10000"),
        ({"overrides": {"vehicle.fix_sigma": 1e39}}, r"Vehicle.fix_sigma must be at most 1e\+06 in size, got 1e\+39"),
        ({"overrides": {"belief.half_width": 1e39}}, r"Belief.half_width must be at most 1e\+06 in size, got 1e\+39"),
        ({"overrides": {"fish.max_speed": 1e4}}, "MomentumRandomWalk.max_speed must be at most 100 in size, got 10000"),
        ({"overrides": {"tag.period": 10**401}}, "Tag.period must be at most .* got a number of hundreds of digits"),
        ({"overrides": {"tag.period": "1" * 401}}, "Tag.period must be at most .* got a number of hundreds of digits"),
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


NO_NUMBERS = [None, {}, "abc", b"ab", 1j, [1j, 0.0], [None, None], [10**401, 0], np.array([1, 2], "M8[s]"), object()]


@pytest.mark.parametrize("actions", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("shell", SHELLS)
def test_actions_that_are_no_numbers_are_refused(shell: Any, actions: Any) -> None:
    env = shell(particles=20)
    env.reset()
    with pytest.raises(ValueError, match="actions must be an array of numbers, got "):
        env.step(actions)


def test_an_agent_whose_action_is_no_number_is_named() -> None:
    fleet = parallel_env(vehicles=2, particles=20)
    fleet.reset(seed=0)
    for action in NO_NUMBERS:
        with pytest.raises(ValueError, match="the action of auv_1 must be numbers, got "):
            fleet.step({"auv_0": np.zeros(2, np.float32), "auv_1": action})


@pytest.mark.parametrize("seed", [1.5, "1", True, {}, 1j, [1.5], ["a"], np.array([1.0])], ids=repr)
def test_seeds_that_are_no_whole_numbers_are_refused(seed: Any) -> None:
    with pytest.raises(ValueError, match="seed must be a whole number, got "):
        Simulation(Scenario()).reset(seed)
    with pytest.raises(ValueError, match="seed must be a whole number, got "):
        TagTrackVecEnv(particles=20).seed(seed)


@pytest.mark.parametrize("command", ["train --steps 2", "eval benchmark --episodes 2 --policies pursuit"])
def test_a_compiler_that_is_switched_off_is_one_line(command: str, tmp_path: Path) -> None:
    program, *words = command.split()
    line = [sys.executable, "-m", f"tagtrack.{program}", *words, "--out", str(tmp_path / "out")]
    done = subprocess.run(line, env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.endswith("; unset NUMBA_DISABLE_JIT\n"), done.stderr
    assert done.stderr.count("\n") == 1


def test_seed_out_of_range_is_named() -> None:
    with pytest.raises(ValueError, match="seeds must be from 0 to 9223372036854775807, got -1 to -1"):
        Simulation(Scenario()).reset(seed=-1)
