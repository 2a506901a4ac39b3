"""`python -m train` as its user runs it: in a folder of its own, as a subprocess."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from tagtrack.envs.presets import PRESETS
from tagtrack.policies.files import load_policy
from tagtrack.train.config import SETTINGS, TrainConfig, find_settings

SMALL = ["--num-envs", "8", "--particles", "32", "--validation-episodes", "2", "--set", "episode_steps=12"]
RUN_FILES = {"config.json", "versions.json", "progress.csv", "policy.safetensors", "policy.json", "learning_curve.png"}


def train(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tagtrack.train", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("train")
    done = train(folder, "--steps", "2000", "--hyper", "rollout=512", *SMALL, "--out", "run")
    assert done.returncode == 0, done.stderr
    return folder / "run", done.stdout


def steps_in(run: Path) -> list[int]:
    with (run / "progress.csv").open() as file:
        return [int(row["steps"]) for row in csv.DictReader(file)]


def test_a_run_leaves_its_record_and_a_table_against_the_papers_controller(trained):
    run, printed = trained
    assert {path.name for path in run.iterdir()} >= RUN_FILES
    assert "three_step" in printed and str(run.name) in printed and "trained" in printed
    config = json.loads((run / "config.json").read_text())
    assert config["seed"] == 0 and config["settings"]["rollout"] == 512 and config["scenario"]["episode_steps"] == 12
    assert (run / "learning_curve.png").read_bytes().startswith(b"\x89PNG")
    assert steps_in(run)[0] == 0 and steps_in(run) == sorted(set(steps_in(run)))
    assert load_policy(run).env_id == "TagTrack/LeopardShark-v0"


def test_the_same_seed_gives_the_same_policy(trained, tmp_path):
    run, _ = trained
    again = train(tmp_path, "--config", str(run / "config.json"), "--out", "again")
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "again" / "policy.safetensors").read_bytes() == (run / "policy.safetensors").read_bytes()


def test_a_run_on_a_herd_says_which_animals_it_learned_from(tmp_path):
    rows = "".join(f"{tag},{t},{0.01 * t},0\n" for tag in ("a", "b") for t in range(0, 3601, 300))
    (tmp_path / "herd.csv").write_text("tag,t_unix_s,x,y\n" + rows)
    herd = ["--tracks", "herd.csv", "--time-scale", "20"]
    done = train(tmp_path, "--steps", "400", "--hyper", "rollout=256", *SMALL, *herd, "--out", "run")
    assert done.returncode == 0, done.stderr
    told = {"file": "herd.csv", "animals": 2, "stretches": 2, "hours": 2.0, "time_scale": 20.0, "longest_gap": 900.0}
    assert json.loads((tmp_path / "run" / "config.json").read_text())["replayed"] == told
    again = train(tmp_path, "--resume", "run", "--steps", "700")
    assert again.returncode == 0, again.stderr


def test_a_run_learns_on_another_motion(tmp_path):
    done = train(tmp_path, "--steps", "300", "--hyper", "rollout=256", *SMALL, "--motion", "levy", "--out", "run")
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "run" / "config.json").read_text())["scenario"]["fish"]["kind"] == "LevyFlight"
    assert "benchmark --env TagTrack/LeopardShark-v0 --motion levy --set episode_steps=12 --policies" in done.stdout


def test_a_finished_run_can_be_trained_on(trained, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(trained[0], run)
    done = train(tmp_path, "--resume", "run", "--steps", "3000")
    assert done.returncode == 0, done.stderr
    assert steps_in(run)[: len(steps_in(trained[0]))] == steps_in(trained[0]) and steps_in(run)[-1] >= 3000


def test_a_killed_run_resumes_from_its_last_checkpoint(tmp_path):
    command = [sys.executable, "-m", "tagtrack.train", "--steps", "200000", "--hyper", "rollout=512", *SMALL, "--out", "run"]
    run = tmp_path / "run"
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for_checkpoint(run, process)
    process.kill()
    process.wait()
    reached = json.loads((run / "checkpoint" / "latest.json").read_text())["steps"]
    done = train(tmp_path, "--resume", "run", "--steps", str(reached + 600))
    assert done.returncode == 0, done.stderr
    assert steps_in(run)[-1] >= reached + 600
    load_policy(run)


def test_ctrl_c_saves_and_says_how_to_resume(tmp_path):
    command = [sys.executable, "-m", "tagtrack.train", "--steps", "300000", "--hyper", "rollout=512", *SMALL, "--out", "run"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    wait_for_checkpoint(tmp_path / "run", process)
    process.send_signal(signal.SIGINT)
    printed, _ = process.communicate(timeout=120)
    assert process.returncode == 130 and "python -m train --resume run" in printed
    latest = json.loads((tmp_path / "run" / "checkpoint" / "latest.json").read_text())
    assert latest["steps"] == steps_in(tmp_path / "run")[-1] > 0


def wait_for_checkpoint(run: Path, process: subprocess.Popen) -> None:
    deadline = time.monotonic() + 240  # a first compilation is among it
    while len(steps_in(run) if (run / "progress.csv").exists() else []) < 2:
        assert process.poll() is None and time.monotonic() < deadline, "training ended or hung before its first checkpoint"
        time.sleep(0.1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--env", "Whale-v0"], "unknown environment 'Whale-v0'; known: TagTrack/LeopardShark-v0"),
        (["--steps", "0"], "--steps must be at least 1, got 0"),
        (["--particles", "0"], "at least 1, got 0"),
        (["--validation-episodes", "1"], "--validation-episodes must be at least 2, got 1"),
        (["--set", "tag.period=-2"], "Tag.period must be positive, got -2.0"),
        (["--set", "vehicle.max_speed=nan"], "max_speed"),
        (["--set", "water.clarity=1"], "unknown parameter 'water.clarity'"),
        (["--set", "nonsense"], "NAME=VALUE"),
        (["--hyper", "momentum=1"], "unknown hyper-parameter 'momentum' of ppo; known: rollout"),
        (["--tracks", "absent.csv"], "no track file absent.csv"),
        (["--time-scale", "0.5"], "add tracks=FILE"),
        (["--motion", "swift"], "fish must be one of momentum, brownian, levy, boat, got 'swift'"),
        (["--motion", "levy", "--tracks", "absent.csv"], "either the tracks of absent.csv or by a motion (fish=levy)"),
        (["--resume", "absent"], "absent is not a run"),
        (["--config", "absent.json"], "no configuration absent.json"),
        (["--device", "tpu"], "--device tpu cannot be used here"),
        (["--out", "full"], "--out full exists and is not a run"),
        (["--seed", "-1"], "seed must be from 0"),
    ],
)
def test_a_mistake_is_one_line_with_status_2_and_leaves_nothing(tmp_path, arguments, words):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("years of work")
    done = train(tmp_path, *arguments)
    assert done.returncode == 2 and words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and done.stderr.startswith("error: ")
    assert sorted(os.listdir(tmp_path)) == ["full"] and os.listdir(tmp_path / "full") == ["thesis.txt"]


def test_a_preset_has_hyper_parameters_of_its_own_and_the_command_line_goes_before_them():
    named = TrainConfig(env="RangeOnly-v0", preset="masmitja2023")
    assert find_settings(named) == SETTINGS["masmitja2023", "ppo"] != find_settings(TrainConfig(env="RangeOnly-v0"))
    assert find_settings(replace(named, hyper=("gamma=0.9",), steps=7)) == replace(find_settings(named), gamma=0.9, steps=7)
    assert {preset for presets in PRESETS.values() for preset in presets} <= {name for name, _ in SETTINGS}


def test_an_unknown_algorithm_lists_those_that_exist(tmp_path):
    done = train(tmp_path, "--algo", "dqn")
    assert done.returncode == 2 and "ppo" in done.stderr and "sac" in done.stderr
    assert os.listdir(tmp_path) == []


def test_a_resumed_run_keeps_its_configuration(trained):
    run, _ = trained
    done = train(run.parent, "--resume", "run", "--seed", "5")
    assert done.returncode == 2 and "--seed cannot change in a resumed run" in done.stderr


@pytest.mark.parametrize("broken", ["", "{", "[]", '{"folder": "steps_1"}'])
def test_a_broken_checkpoint_is_an_error_and_is_left_as_it_is(trained, tmp_path, broken):
    run = tmp_path / "run"
    shutil.copytree(trained[0], run)
    (run / "checkpoint" / "latest.json").write_text(broken)
    done = train(tmp_path, "--resume", "run", "--steps", "9000")
    assert done.returncode == 2 and "train anew" in done.stderr
    assert (run / "checkpoint" / "latest.json").read_text() == broken


def test_sac_trains_and_resumes(tmp_path):
    small = [*SMALL, "--hyper", "learning_starts=64", "gradient_steps=1", "--algo", "sac"]
    done = train(tmp_path, "--steps", "400", *small, "--out", "run")
    assert done.returncode == 0, done.stderr
    assert load_policy(tmp_path / "run").algorithm == "sac"
    done = train(tmp_path, "--resume", "run", "--steps", "600")
    assert done.returncode == 0, done.stderr


def test_help_explains_every_option(tmp_path):
    done = train(tmp_path, "--help")
    assert done.returncode == 0
    for option in ("env", "algo", "steps", "seed", "num-envs", "particles", "out", "resume", "config", "threads", "device"):
        assert f"--{option}" in done.stdout
