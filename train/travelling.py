"""A run that is trained on another machine, which may share no disk with this one: its folder travels back as a whole.

What a lost machine was at begins anew elsewhere, and comes to the same.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from tagtrack.eval.report import write_text
from tagtrack.policies.files import is_leftover_name, remove_leftovers
from tagtrack.train.checkpoint import has_checkpoint, sign_anew
from tagtrack.train.cli import guarded
from tagtrack.train.config import TrainConfig
from tagtrack.train.lock import LOCK_FILE
from tagtrack.train.run_folder import CONFIG_FILE
from tagtrack.train.runs import run
from tagtrack.train.training import Tell


class Outcome(NamedTuple):
    """What a run came to."""

    status: int  # as the command's
    said: str  # what it printed
    files: Mapping[str, bytes] | None  # of its folder, by path within; None: it was trained in its place

    @property
    def last_line(self) -> str:
        """What went wrong, if anything has."""
        return (self.said.strip().splitlines() or ["it said nothing"])[-1]


def train_there(config: TrainConfig, folder: Path, *, tell: Tell) -> Outcome:
    """Train a run in a temporary folder, of the name that it will have."""
    said = io.StringIO()
    with tempfile.TemporaryDirectory(prefix="tagtrack-run-") as place:
        there = Path(place) / folder.name
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            status = guarded(lambda: run(dataclasses.replace(config, out=there), tell))
        files = {
            path.relative_to(there).as_posix(): path.read_bytes()
            for path in sorted(there.rglob("*"))
            if path.is_file() and path.name != LOCK_FILE
        }
    return Outcome(status, said.getvalue().replace(str(there), str(folder)), files)


def take_in(folder: Path, outcome: Outcome) -> None:
    """Write a run that came back, whole or not at all, and what it said."""
    write_text(folder.with_name(f"{folder.name}.log"), outcome.said)
    if outcome.status != 0 or outcome.files is None:
        return
    half = folder.with_name(f".{folder.name}.{secrets.token_hex(8)}")
    for name, content in outcome.files.items():
        path = half / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    told = json.loads((half / CONFIG_FILE).read_text(encoding="utf-8"))
    write_text(half / CONFIG_FILE, json.dumps(told | {"out": str(folder)}, indent=2) + "\n")
    if has_checkpoint(half):
        sign_anew(half)  # our own run on a machine of our own
    if folder.is_dir():
        folder.rmdir()  # another than an empty one was refused
    os.rename(half, folder)


def remove_halves(place: Path) -> None:
    """Remove what a kill left in the folder of several runs: halves of files, and of runs that were being taken in."""
    remove_leftovers(place)
    for path in place.iterdir():
        if is_leftover_name(path.name) and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
