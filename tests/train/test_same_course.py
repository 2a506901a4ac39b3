"""A run that was cut off and resumed is, bit for bit, the run that was never cut off."""

from __future__ import annotations

import csv
import io
import json
import signal
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch

from tagtrack.train import session, training
from tests.train.conftest import SMALL, rows_in

RUNS = {
    "ppo": ["--steps", "1000"],
    "sac": ["--steps", "160", "--algo", "sac", "--hyper", "learning_starts=64", "gradient_steps=1"],
    "fleet": ["--steps", "500", "--vehicles", "2", "--tags", "2"],
}


@pytest.fixture(autouse=True)
def short_table(monkeypatch) -> None:
    """It is not about the episodes of the table."""
    monkeypatch.setattr(session, "TABLE_EPISODES", 4)


def weights(run: Path) -> dict[str, torch.Tensor]:
    """All that the last checkpoint learned, optimizers included."""
    place = run / "checkpoint"
    model = place / json.loads((place / "latest.json").read_text())["folder"] / "model.zip"
    found = {}
    with zipfile.ZipFile(model) as archive:
        for name in archive.namelist():
            if name.endswith(".pth"):
                loaded = torch.load(io.BytesIO(archive.read(name)), weights_only=True)
                found |= {f"{name} {key}": value for key, value in flat(loaded).items()}
    return found


def flat(tree: object, name: str = "") -> dict[str, torch.Tensor]:
    if isinstance(tree, torch.Tensor):
        return {name: tree}
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return {key: value for each, part in items for key, value in flat(part, f"{name}.{each}").items()}


def told(run: Path) -> list[dict[str, str]]:
    """progress.csv but for the time that it took."""
    return [{key: value for key, value in row.items() if key not in ("seconds", "steps_per_s")} for row in rows_in(run)]


def assert_same(first: Path, second: Path) -> None:
    one, other = weights(first), weights(second)
    assert one.keys() == other.keys() and len(one) > 10
    assert all(torch.equal(value, other[key]) for key, value in one.items())
    assert (first / "policy.safetensors").read_bytes() == (second / "policy.safetensors").read_bytes()


@pytest.mark.parametrize("kind", RUNS)
def test_a_run_killed_at_a_checkpoint_goes_on_as_if_nothing_had_been(tmp_path, train, monkeypatch, kind):
    assert train(*RUNS[kind], *SMALL, "--out", "whole")[0] == 0
    save, saved = training.save_checkpoint, []

    def save_two(*arguments):
        save(*arguments)
        saved.append(arguments)
        if len(saved) == 3:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(training, "save_checkpoint", save_two)
        assert train(*RUNS[kind], *SMALL, "--out", "cut")[0] == 130
    np.random.seed(1), torch.manual_seed(1)
    assert train("--resume", "cut")[0] == 0
    assert_same(tmp_path / "whole", tmp_path / "cut")
    assert told(tmp_path / "whole") == told(tmp_path / "cut")
    assert (tmp_path / "whole" / "table.md").read_text().replace("whole", "cut") == (tmp_path / "cut" / "table.md").read_text()


def test_ctrl_c_learns_from_the_rollout_in_hand_and_changes_no_weight(tmp_path, train, monkeypatch):
    assert train(*RUNS["ppo"], *SMALL, "--out", "whole")[0] == 0
    step = training.Training._on_step

    def interrupt(self):
        if self.num_timesteps == 400:
            signal.raise_signal(signal.SIGINT)
        return step(self)

    with monkeypatch.context() as patch:
        patch.setattr(training.Training, "_on_step", interrupt)
        status, printed, _ = train(*RUNS["ppo"], *SMALL, "--out", "cut")
    assert status == 130 and "stopped at 512 of 1,000 steps" in printed
    assert train("--resume", "cut")[0] == 0
    assert weights(tmp_path / "whole").keys() == weights(tmp_path / "cut").keys()
    assert all(torch.equal(value, weights(tmp_path / "cut")[key]) for key, value in weights(tmp_path / "whole").items())


def test_with_more_worlds_it_goes_on_in_new_episodes(tmp_path, train):
    free = [word for word in SMALL if word not in ("--num-envs", "8")]
    assert train("--steps", "50", *free, "--out", "run")[0] == 0
    before = rows_in(tmp_path / "run")
    assert train("--resume", "run", "--steps", "600")[0] == 0
    assert rows_in(tmp_path / "run")[: len(before)] == before and int(rows_in(tmp_path / "run")[-1]["steps"]) >= 600


def test_a_run_killed_before_its_first_checkpoint_begins_anew(tmp_path, train, monkeypatch):
    def kill(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(training, "save_checkpoint", kill)
        assert train(*RUNS["ppo"], *SMALL, "--out", "run")[0] == 130
    assert train("--resume", "run")[0] == 0
    assert [int(row["steps"]) for row in csv.DictReader((tmp_path / "run" / "progress.csv").open())][-1] >= 1000


def test_what_a_kill_left_before_the_configuration_blocks_no_folder(tmp_path, train):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / ".config.0123456789abcdef.json").write_text("half")
    assert train("--steps", "50", *SMALL, "--out", "run")[0] == 0
    assert not list((tmp_path / "run").glob(".config.*"))


def test_a_strangers_modules_are_not_imported_unasked(tmp_path, train, monkeypatch):
    (tmp_path / "evil.py").write_text("raise SystemExit('it ran')")
    monkeypatch.syspath_prepend(tmp_path)
    assert train("--steps", "50", *SMALL, "--out", "run")[0] == 0
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    (tmp_path / "run" / "config.json").write_text(json.dumps(config | {"set": [*config["set"], "fish=evil:Fish"]}))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "elsewhere"))
    status, _, error = train("--resume", "run", "--steps", "2000")
    assert status == 2 and "add --trust" in error and error.count("\n") == 1


@pytest.mark.parametrize("part", ["checkpoint", "untrained"])
def test_a_link_out_of_the_run_is_not_followed(tmp_path, train, part):
    assert train("--steps", "50", *SMALL, "--out", "run")[0] == 0
    (tmp_path / "run" / part).rename(tmp_path / "elsewhere")
    (tmp_path / "run" / part).symlink_to(tmp_path / "elsewhere")
    status, _, error = train("--resume", "run", "--steps", "2000")
    assert status == 2 and "is a link, which may lead out of the run" in error
