"""`tagtrack train` as its user runs it: what a run leaves, and what is refused before it begins."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest
import torch
from stable_baselines3 import PPO

from tagtrack.policies.files import load_policy
from tests.train.conftest import SMALL, rows_in, steps_in

RUN_FILES = {
    "config.json", "versions.json", "progress.csv", "policy.safetensors", "policy.json", "learning_curve.png", "table.md",
}  # fmt: skip


def test_a_run_leaves_its_record_and_a_table_against_the_papers_controller(trained):
    run, printed = trained
    assert {path.name for path in run.iterdir()} >= RUN_FILES
    assert "three_step" in printed and str(run.name) in printed and "trained" in printed
    table = (run / "table.md").read_text()
    assert all(f"| {name} |" in table for name in ("three_step", "information:21", "untrained", "run"))
    config = json.loads((run / "config.json").read_text())
    assert config["seed"] == 0 and config["hyper"] == ["rollout=512"] and config["scenario"]["episode_steps"] == 12
    assert (run / "learning_curve.png").read_bytes().startswith(b"\x89PNG")
    assert steps_in(run)[0] == 0 and steps_in(run) == sorted(set(steps_in(run)))
    assert load_policy(run).env_id == "TagTrack/LeopardShark-v0"


def test_both_rewards_are_means_of_a_step(trained):
    """A step's reward is minus a hundredth of its error, but for the largest errors."""
    whole = [row for row in rows_in(trained[0]) if row["train_error_m"]]
    assert whole
    for row in whole:
        for part in ("train", "validation"):
            assert float(row[f"{part}_reward_per_step"]) == pytest.approx(-float(row[f"{part}_error_m"]) / 100, rel=0.1)


def test_the_same_seed_gives_the_same_policy(trained, tmp_path, train):
    run, _ = trained
    assert train("--config", run / "config.json", "--out", "again")[0] == 0
    assert (tmp_path / "again" / "policy.safetensors").read_bytes() == (run / "policy.safetensors").read_bytes()


def test_a_run_on_a_herd_says_which_animals_it_learned_from(tmp_path, train):
    rows = "".join(f"{tag},{t},{0.01 * t},0\n" for tag in ("a", "b") for t in range(0, 3601, 300))
    (tmp_path / "herd.csv").write_text("tag,t_unix_s,x,y\n" + rows)
    status, printed, _ = train("--steps", "100", *SMALL, "--tracks", "herd.csv", "--time-scale", "20", "--out", "run")
    assert status == 0 and "--tracks herd.csv --time-scale 20.0" in printed
    told = {"file": "herd.csv", "animals": 2, "stretches": 2, "hours": 2.0, "time_scale": 20.0, "longest_gap": 900.0}
    assert json.loads((tmp_path / "run" / "config.json").read_text())["replayed"] == told
    assert train("--resume", "run", "--steps", "200")[0] == 0


def test_a_run_learns_on_another_motion(tmp_path, train):
    status, printed, _ = train("--steps", "100", *SMALL, "--motion", "levy", "--out", "run")
    assert status == 0
    assert json.loads((tmp_path / "run" / "config.json").read_text())["scenario"]["fish"]["kind"] == "LevyFlight"
    assert "benchmark --env TagTrack/LeopardShark-v0 --motion levy --set episode_steps=12 --policies" in printed


@pytest.mark.parametrize(("steps", "worlds"), [("2", []), ("8", ["--num-envs", "8"])])
def test_the_fewest_steps_make_a_policy(tmp_path, train, steps, worlds):
    status, printed, _ = train("--steps", steps, *SMALL[2:], *worlds, "--out", "run")
    assert status == 0 and f"1 update, each from {steps} steps" in printed and f"trained {steps} steps" in printed
    load_policy(tmp_path / "run")


def test_a_run_that_is_shorter_than_a_rollout_learns_eight_times_and_says_so(tmp_path, train):
    status, printed, _ = train("--steps", "100", *SMALL[2:], "--out", "run")
    assert status == 0
    assert printed.startswith("8 updates, each from 14 steps in 2 worlds, up to step 112\n")
    assert steps_in(tmp_path / "run") == [0, 14, 28, 42, 56, 70, 84, 98, 112]


def test_a_folder_may_have_the_name_of_a_baseline(train):
    status, printed, _ = train("--steps", "50", *SMALL, "--out", "pursuit")
    assert status == 0 and "pursuit/" in printed


def test_learning_that_blows_up_ends_with_a_line_and_keeps_the_best_policy(tmp_path, train, monkeypatch):
    def blow_up(model: PPO) -> None:
        for parameter in model.policy.parameters():
            parameter.data.fill_(torch.nan)

    monkeypatch.setattr(PPO, "train", blow_up)
    status, _, error = train("--steps", "100", *SMALL, "--out", "run")
    assert status == 2 and error.startswith("error: training diverged before step 16: ") and error.count("\n") == 1
    load_policy(tmp_path / "run")


def test_ctrl_c_saves_and_says_how_to_resume(tmp_path):
    command = [sys.executable, "-m", "tagtrack.train", "--steps", "1e5", "--hyper", "rollout=512", *SMALL, "--out", "a run"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    run = tmp_path / "a run"
    while len(steps_in(run)) < 2:
        assert process.poll() is None, "training ended before its second checkpoint"
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    printed, _ = process.communicate(timeout=120)
    assert process.returncode == 130 and "train --resume 'a run'" in printed
    assert json.loads((run / "checkpoint" / "latest.json").read_text())["steps"] == steps_in(run)[-1] > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--env", "Whale-v0"], "unknown environment 'Whale-v0'; known: TagTrack/LeopardShark-v0"),
        (["--steps", "0"], "--steps must be at least 2, got 0"),
        (["--steps", "1"], "--steps must be at least 2, got 1"),
        (["--steps", "100", "--num-envs", "256"], "--steps must be at least 256, one for each of 256 worlds"),
        (["--algo", "sac", "--steps", "10"], "--steps must be at least 64, one for each of 64 worlds"),
        (["--num-envs", "1e9"], "1,000,000,000 worlds of 1,000 particles, and the steps they learn from, take 17,1"),
        (["--num-envs", "0"], "--num-envs must be at least 1, got 0"),
        (["--num-envs", "5000"], "--num-envs must be at most 4096, got 5000: the next worlds are those of the next seed"),
        (["--threads", "0"], "--threads must be at least 1, got 0"),
        (["--particles", "0"], "at least 1, got 0"),
        (["--validation-episodes", "1"], "--validation-episodes must be at least 2 and at most 4096, got 1"),
        (["--set", "tag.period=-2"], "Tag.period must be positive, got -2.0"),
        (["--set", "vehicle.max_speed=nan"], "max_speed"),
        (["--set", "water.clarity=1"], "unknown parameter 'water.clarity'"),
        (["--set", "nonsense"], "NAME=VALUE"),
        (["--set", "tag.period=2", "--set", "tag.period=4"], "tag.period is set twice, to 2 and to 4; drop one"),
        (["--hyper", "momentum=1"], "unknown hyper-parameter 'momentum' of ppo; known: rollout"),
        (["--tracks", "absent.csv"], "no track file absent.csv"),
        (["--time-scale", "0.5"], "add tracks=FILE"),
        (["--motion", "swift"], "boat, acceleration, legs, or MODULE:CLASS of your own, got 'swift'"),
        (["--motion", "levy", "--tracks", "absent.csv"], "either the tracks of absent.csv or by a motion (fish=levy)"),
        (["--resume", "absent"], "absent is not a run"),
        (["--trust"], "--trust goes with --resume"),
        (["--config", "absent.json"], "no configuration absent.json"),
        (["--device", "tpu"], "--device tpu cannot be used here"),
        (["--out", "full"], "--out full exists and is not a run"),
        (["--out", "full/thesis.txt"], "--out full/thesis.txt is a file"),
        (["--seed", "-1"], "seed must be from 0"),
    ],
)
def test_a_mistake_is_one_line_with_status_2_and_leaves_nothing(tmp_path, train, arguments, words):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("years of work")
    status, _, error = train(*arguments)
    assert status == 2 and words in error
    assert error.count("\n") == 1 and error.startswith("error: ")
    assert sorted(os.listdir(tmp_path)) == ["full"] and os.listdir(tmp_path / "full") == ["thesis.txt"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--algo", "dqn"], ("ppo", "sac")), (["--steps", "2.5"], ("--steps:", "whole number")), (["--speed", "3"], ("--speed",))],
)
def test_a_mistake_in_the_grammar_shows_no_traceback(tmp_path, train, arguments, words):
    status, _, error = train(*arguments)
    assert status == 2 and all(word in error for word in words) and "Traceback" not in error
    assert os.listdir(tmp_path) == []


def test_help_explains_every_option(train):
    status, printed, _ = train("--help")
    assert status == 0
    for option in ("env", "algo", "steps", "seed", "num-envs", "particles", "out", "resume", "trust", "config", "threads"):
        assert f"--{option}" in printed
    assert "as if it had never been cut off" in " ".join(printed.split()) and "{None}" not in printed
