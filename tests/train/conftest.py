"""`tagtrack train` within this process and as a subprocess, and one small run for the tests to copy."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tagtrack.train.cli import main

SMALL = ["--num-envs", "8", "--particles", "32", "--validation-episodes", "2", "--set", "episode_steps=12"]


@pytest.fixture
def train(tmp_path, monkeypatch, capsys) -> Callable[..., tuple[int, str, str]]:
    """Run a command line in ``tmp_path``; returns exit status, standard output and standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as stop:  # tyro has shown what is wrong
            status = int(stop.code or 0)
        shown = capsys.readouterr()
        errors = [line for line in shown.err.splitlines(keepends=True) if not line.startswith("TagTrack compiles")]
        return status, shown.out, "".join(errors)

    return run


@pytest.fixture(scope="session")
def trained(tmp_path_factory, own_key) -> tuple[Path, str]:
    """A finished run, made as its user makes it, and what it printed."""
    folder = tmp_path_factory.mktemp("train")
    command = [sys.executable, "-m", "tagtrack.train", "--steps", "2000", "--hyper", "rollout=512", *SMALL, "--out", "run"]
    done = subprocess.run(command, cwd=folder, env=os.environ, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return folder / "run", done.stdout


def steps_in(run: Path) -> list[int]:
    """Steps of the rows of progress.csv."""
    return [int(row["steps"]) for row in rows_in(run)]


def rows_in(run: Path) -> list[dict[str, str]]:
    """Rows of progress.csv; none where there is no such file yet."""
    if not (run / "progress.csv").exists():
        return []
    with (run / "progress.csv").open(newline="") as file:
        return list(csv.DictReader(file))
