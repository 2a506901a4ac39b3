"""A run's folder: one process at a time, and a checkpoint that a kill cannot spoil."""

from __future__ import annotations

import json
import math
import os
import stat
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

from tagtrack.policies.trust import is_signed, sign
from tagtrack.train import checkpoint
from tagtrack.train.checkpoint import Progress, load_checkpoint, save_checkpoint
from tagtrack.train.run_folder import RunFolder


class Killed(BaseException):
    """Stands for the end of the process."""


@dataclass
class Model:
    """What a checkpoint needs of a model of Stable-Baselines3."""

    content: bytes
    killed: bool = False

    def save(self, path: Path) -> None:
        path.write_bytes(self.content[:2] if self.killed else self.content)
        if self.killed:
            raise Killed


def test_runs_without_a_name_that_begin_together_get_folders_of_their_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with ThreadPoolExecutor(8) as pool:
        folders = list(pool.map(lambda _: RunFolder.create(None, "env-ppo-seed0"), range(8)))
    assert sorted(folder.path.name for folder in folders) == [
        "env-ppo-seed0", *(f"env-ppo-seed0-{number}" for number in range(2, 9))
    ]  # fmt: skip


def test_of_two_runs_that_begin_in_one_folder_the_second_is_refused(tmp_path):
    with RunFolder.create(tmp_path / "run", "") as folder:
        with pytest.raises(ValueError, match=f"run is in use by process {os.getpid()} on "):
            RunFolder.create(tmp_path / "run", "")
        folder.write_json("config.json", {})
    with pytest.raises(ValueError, match="holds a run; go on with it by --resume"):
        RunFolder.create(tmp_path / "run", "")


def test_the_lock_of_a_killed_process_holds_nobody_up(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / ".lock").write_text("process 1 on this machine\n")
    with RunFolder.create(tmp_path / "run", "") as folder:
        assert (folder.path / ".lock").read_text().startswith(f"process {os.getpid()} on ")


@pytest.mark.parametrize("existed", [False, True])
def test_a_folder_in_which_no_run_began_is_as_it_was(tmp_path, existed):
    if existed:
        (tmp_path / "run").mkdir()
    with pytest.raises(MemoryError), RunFolder.create(tmp_path / "run", ""):
        raise MemoryError
    assert os.listdir(tmp_path) == ["run"] * existed and not list(tmp_path.glob("run/*"))


@pytest.mark.parametrize("steps", [10, 20])  # the same checkpoint once more, and the next one
@pytest.mark.parametrize("moment", ["model", "sign", "replace_file", "remove_others"])
def test_a_kill_at_any_moment_of_saving_leaves_a_whole_checkpoint(tmp_path, monkeypatch, steps, moment):
    def kill(*_: object) -> None:
        raise Killed

    save_checkpoint(tmp_path, Model(b"first"), Progress(steps=10))
    with monkeypatch.context() as patch:
        if moment != "model":
            patch.setattr(checkpoint, moment, kill)
        with pytest.raises(Killed):
            save_checkpoint(tmp_path, Model(b"second", killed=moment == "model"), Progress(steps=steps))
    turned = moment == "remove_others"
    found = load_checkpoint(tmp_path)
    assert (found.progress.steps, found.model.read_bytes()) == ((steps, b"second") if turned else (10, b"first"))
    found.require_trust()
    save_checkpoint(tmp_path, Model(b"third"), Progress(steps=30))
    assert sorted(os.listdir(tmp_path / "checkpoint")) == ["latest.json", "steps_30"]


def test_only_its_own_folders_are_removed_beside_a_checkpoint(tmp_path):
    (tmp_path / "checkpoint" / "notes").mkdir(parents=True)
    save_checkpoint(tmp_path, Model(b"first"), Progress(steps=10))
    assert sorted(os.listdir(tmp_path / "checkpoint")) == ["latest.json", "notes", "steps_10"]


def test_a_signature_holds_for_these_files_under_this_key_alone(tmp_path, monkeypatch, own_key):
    file = tmp_path / "model.zip"
    file.write_bytes(b"weights")
    signature = sign([file])
    assert stat.S_IMODE(own_key.stat().st_mode) == 0o600
    assert is_signed([file], signature) and sign([file]) == signature
    assert not any(is_signed([file], wrong) for wrong in (None, "", 5, "0" * 64))
    file.write_bytes(b"others")
    assert not is_signed([file], signature)
    file.write_bytes(b"weights")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert not is_signed([file], signature) and sign([file]) != signature


def test_what_a_kill_left_of_a_key_is_swept_away(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    (tmp_path / "tagtrack").mkdir()
    for name, age in (("old", 3600.0), ("young", 0.0)):
        (tmp_path / "tagtrack" / f".key.{name}").write_text("half")
        os.utime(tmp_path / "tagtrack" / f".key.{name}", (time.time() - age,) * 2)
    (tmp_path / "model.zip").write_bytes(b"weights")
    assert sign([tmp_path / "model.zip"]) is not None
    assert sorted(path.name for path in (tmp_path / "tagtrack").iterdir()) == [".key.young", "key"]


@pytest.mark.parametrize(
    ("name", "value"),
    [("seconds", 10**401), ("seconds", -1.0), ("steps", -5), ("steps", 1.5), ("best_reward", math.nan), ("next_validation", "x")],
)
def test_a_number_in_latest_that_cannot_be_is_named(tmp_path, name, value):
    save_checkpoint(tmp_path, Model(b"first"), Progress(steps=10))
    latest = tmp_path / "checkpoint" / "latest.json"
    latest.write_text(json.dumps(json.loads(latest.read_text()) | {name: value}))
    with pytest.raises(ValueError, match=f"latest.json: {name} must be .*; train anew"):
        load_checkpoint(tmp_path)
