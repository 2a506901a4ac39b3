"""`tagtrack train --resume`: a run goes on from wherever it was cut off, and a stranger's only if it is trusted."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from stable_baselines3 import PPO

from tagtrack.policies.files import load_policy
from tagtrack.policies.trust import is_signature, signature_of
from tagtrack.train import session
from tagtrack.train.lock import FolderLock
from tests.train.conftest import SMALL, steps_in


@pytest.fixture
def run(trained, tmp_path) -> Path:
    """A copy of the finished run: 2,048 steps."""
    return Path(shutil.copytree(trained[0], tmp_path / "run"))


def break_off(*_: object) -> None:
    raise KeyboardInterrupt


def latest(run: Path) -> dict[str, object]:
    return json.loads((run / "checkpoint" / "latest.json").read_text())


def test_a_finished_run_says_that_it_is_finished(run, train):
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file() and path.name != ".lock"}
    status, printed, error = train("--resume", "run")
    assert (status, error) == (0, "")
    assert printed.startswith("run is finished: 2,048 of 2,000 steps; --steps with a larger number trains it on\n")
    assert {path: path.read_bytes() for path in before} == before


def test_a_finished_run_can_be_trained_on(trained, run, train):
    status, printed, _ = train("--resume", "run", "--steps", "3e3")
    assert status == 0 and "after 2,048 earlier ones" in printed
    done = steps_in(trained[0])
    assert steps_in(run)[: len(done)] == done and 3000 <= steps_in(run)[-1] < 3376


def test_a_run_without_its_table_gets_it_and_is_not_trained_again(tmp_path, train, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(session, "write_comparison", break_off)
        status, _, error = train("--steps", "50", *SMALL, "--out", "run")
    assert (status, error) == (130, "\nbroken off; what was saved stays\n")
    assert not (tmp_path / "run" / "table.md").exists()
    steps = steps_in(tmp_path / "run")
    status, printed, _ = train("--resume", "run")
    assert status == 0 and "three_step" in printed and (tmp_path / "run" / "table.md").is_file()
    assert steps_in(tmp_path / "run") == steps


def test_the_table_is_the_last_that_a_run_writes(trained):
    """Who is killed before has none, and whoever goes on writes what is missing."""
    written = {path: path.stat().st_mtime_ns for path in trained[0].rglob("*") if path.is_file() and path.name != ".lock"}
    assert max(written, key=written.__getitem__) == trained[0] / "table.md"


def test_a_run_cut_off_at_its_beginning_resumes_and_validates_step_0_once(tmp_path, train, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(PPO, "train", break_off)
        assert train("--steps", "50", *SMALL, "--out", "run")[0] == 130
    assert steps_in(tmp_path / "run") == [0] and latest(tmp_path / "run")["steps"] == 0
    assert train("--resume", "run")[0] == 0
    assert steps_in(tmp_path / "run").count(0) == 1 and steps_in(tmp_path / "run")[-1] >= 50


def test_more_steps_asked_for_are_not_forgotten_when_that_is_cut_off(run, train, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(PPO, "train", break_off)
        assert train("--resume", "run", "--steps", "3000")[0] == 130
    assert not (run / "table.md").exists()  # it told of the policy before
    status, printed, _ = train("--resume", "run")
    assert status == 0 and "finished" not in printed and steps_in(run)[-1] >= 3000 and (run / "table.md").is_file()


def test_a_killed_run_resumes_from_its_last_checkpoint_whatever_else_it_left(tmp_path, train):
    command = [sys.executable, "-m", "tagtrack.train", "--steps", "1e5", "--hyper", "rollout=512", *SMALL, "--out", "run"]
    run = tmp_path / "run"
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while len(steps_in(run)) < 2:
        assert process.poll() is None, "training ended before its second checkpoint"
        time.sleep(0.1)
    status, _, error = train("--resume", "run")
    assert status == 2 and f"run is in use by process {process.pid} on" in error and error.count("\n") == 1
    process.kill()
    process.wait()
    leftovers = [run / ".policy.0123456789abcdef.json", run / "checkpoint" / ".latest.0123456789abcdef.json"]
    for path in leftovers:
        path.write_text("half of")
    reached = int(str(latest(run)["steps"]))
    assert train("--resume", "run", "--steps", reached + 600)[0] == 0
    assert steps_in(run)[-1] >= reached + 600 and not any(path.exists() for path in leftovers)
    load_policy(run)


def test_of_two_that_resume_a_run_the_second_is_refused(run, train):
    lock = FolderLock(run)
    status, _, error = train("--resume", "run", "--steps", "3000")
    lock.release()
    assert status == 2 and error.startswith("error: run is in use by process ")
    assert train("--resume", "run")[0] == 0


def test_a_resumed_run_keeps_its_configuration(run, train):
    status, _, error = train("--resume", "run", "--seed", "5")
    assert status == 2 and "--seed cannot change in a resumed run" in error


def test_a_run_of_another_key_is_loaded_only_on_trust(run, tmp_path, train, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "elsewhere"))
    monkeypatch.setattr(session, "load_model", lambda *_: pytest.fail("it was loaded"))
    status, _, error = train("--resume", "run", "--steps", "3000")
    assert status == 2 and "was not written by your own training" in error and error.strip().endswith("add --trust")
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "elsewhere"))
    assert train("--resume", "run", "--steps", "2100", "--trust")[0] == 0
    assert train("--resume", "run", "--steps", "2200")[0] == 0  # by now the checkpoint is one's own


def test_a_model_that_was_exchanged_is_not_loaded(run, train):
    model = run / "checkpoint" / str(latest(run)["folder"]) / "model.zip"
    model.write_bytes(model.read_bytes()[:-4] + bytes(4))
    status, _, error = train("--resume", "run", "--steps", "3000")
    assert status == 2 and "add --trust" in error
    model.write_bytes(b"no zip")
    status, _, error = train("--resume", "run", "--steps", "3000", "--trust")
    assert status == 2 and "cannot be loaded" in error and error.count("\n") == 1


def test_training_goes_on_where_no_key_can_be_kept(tmp_path, train, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "file"))
    assert train("--steps", "50", *SMALL, "--out", "run")[0] == 0
    assert latest(tmp_path / "run")["signature"] is None


def test_a_key_is_made_where_there_are_no_hard_links(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setattr(os, "link", refuse_links)
    signature = signature_of(b"mine")
    assert signature is not None and is_signature(signature, b"mine") and not is_signature(signature, b"thine")
    assert [path.name for path in (tmp_path / "tagtrack").iterdir()] == ["key"]


def refuse_links(*_):
    raise PermissionError("no links here")


@pytest.mark.parametrize("folder", ["/tmp/steps_2048", "../steps_2048", "steps_2048/..", "", 5, None])
def test_a_checkpoint_lies_in_the_run_and_nowhere_else(run, train, folder):
    (run / "checkpoint" / "latest.json").write_text(json.dumps(latest(run) | {"folder": folder}))
    status, _, error = train("--resume", "run", "--steps", "3000", "--trust")
    assert status == 2 and "folder must be a name like steps_1000" in error


@pytest.mark.parametrize("broken", ["", "{", "[]", '{"folder": "steps_1"}', "[" * 100_000])
def test_a_broken_checkpoint_is_an_error_and_is_left_as_it_is(run, train, broken):
    (run / "checkpoint" / "latest.json").write_text(broken)
    status, _, error = train("--resume", "run", "--steps", "9000")
    assert status == 2 and "train anew" in error and error.count("\n") == 1
    assert (run / "checkpoint" / "latest.json").read_text() == broken


@pytest.mark.parametrize("broken", ["steps\nmany\n", "lines\n3\n"])
def test_a_damaged_progress_file_is_named(run, train, broken):
    (run / "progress.csv").write_text(broken)
    status, _, error = train("--resume", "run", "--steps", "3000")
    assert status == 2 and "progress.csv: damaged" in error


def test_sac_trains_and_resumes(tmp_path, train):
    small = [*SMALL, "--hyper", "learning_starts=64", "gradient_steps=1", "--algo", "sac"]
    assert train("--steps", "120", *small, "--out", "run")[0] == 0
    assert load_policy(tmp_path / "run").algorithm == "sac"
    assert train("--resume", "run", "--steps", "160")[0] == 0
    assert steps_in(tmp_path / "run")[-1] == 160
