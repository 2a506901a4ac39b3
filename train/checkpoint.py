"""All that a run needs to go on: SB3's own files in a folder of their own, and ``latest.json``, which names it and its signature.

A kill at any moment leaves ``latest.json`` at a checkpoint that is whole: a new one is written beside the old one, and only
when it is on the disk ``latest.json`` is turned to it.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tagtrack.policies.files import remove_leftovers, replace_file
from tagtrack.train.trust import is_signed, sign

CHECKPOINT_FOLDER = "checkpoint"
LATEST_FILE = "latest.json"
MODEL_FILE = "model.zip"
BUFFER_FILE = "replay_buffer.pkl"  # of SAC
FOLDER_NAME = re.compile(r"steps_\d+(-\d+)?")


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a run has come."""

    steps: int = 0
    seconds: float = 0.0  # of all parts of the run [s]
    best_reward: float = -math.inf  # of a step, of the policy that was kept
    best_error_m: float = math.inf


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A saved model and what belongs to it."""

    folder: Path
    progress: Progress
    signature: str | None

    @property
    def model(self) -> Path:
        return self.folder / MODEL_FILE

    @property
    def replay_buffer(self) -> Path:
        return self.folder / BUFFER_FILE

    def require_trust(self) -> None:
        """Raise ValueError unless its pickles were written by this user on this machine."""
        if not is_signed(_pickles(self.folder), self.signature):
            raise ValueError(
                f"{self.folder} was not written by your own training on this machine, and loading it runs whatever code it "
                "holds; if you know where it comes from, add --trust"
            )


def has_checkpoint(run: Path) -> bool:
    """Whether a run has come to its first checkpoint."""
    return (run / CHECKPOINT_FOLDER / LATEST_FILE).is_file()


def save_checkpoint(run: Path, model: Any, progress: Progress) -> None:
    """Save model and progress in a new folder; only then turn ``latest.json`` to it, and remove what came before."""
    place = run / CHECKPOINT_FOLDER
    target = _make_folder(place, f"steps_{progress.steps}")
    model.save(target / MODEL_FILE)
    if getattr(model, "replay_buffer", None) is not None:
        model.save_replay_buffer(target / BUFFER_FILE)
    for path in _pickles(target):
        with path.open("rb+") as file:
            os.fsync(file.fileno())
    content = {"folder": target.name, **vars(progress), "signature": sign(_pickles(target))}
    with replace_file(place / LATEST_FILE) as partial:
        partial.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    remove_others(place, target.name)


def load_checkpoint(run: Path) -> Checkpoint:
    """The last checkpoint; nothing in it is executed yet. Raises ValueError where it is broken."""
    latest = run / CHECKPOINT_FOLDER / LATEST_FILE
    try:
        content = json.loads(latest.read_text(encoding="utf-8"))
        name = content["folder"]
        progress = Progress(**{key: content[key] for key in vars(Progress())})
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"{latest}: not a checkpoint ({type(error).__name__}: {error}); train anew") from None
    if not isinstance(name, str) or not FOLDER_NAME.fullmatch(name):
        raise ValueError(f"{latest}: folder must be a name like steps_1000 beside it, got {name!r}; train anew")
    for key, value in vars(progress).items():
        if isinstance(value, bool) or not isinstance(value, int if key == "steps" else (int, float)):
            raise ValueError(f"{latest}: {key} must be a number, got {value!r}; train anew")
    checkpoint = Checkpoint(folder=latest.parent / name, progress=progress, signature=content.get("signature"))
    if not checkpoint.model.is_file():
        raise ValueError(f"{checkpoint.folder}: the checkpoint's {MODEL_FILE} is missing; train anew")
    return checkpoint


def remove_others(place: Path, name: str) -> None:
    """Remove checkpoints but one, and what a kill left half written."""
    for other in place.iterdir():
        if other.is_dir() and not other.is_symlink() and FOLDER_NAME.fullmatch(other.name) and other.name != name:
            shutil.rmtree(other, ignore_errors=True)
    remove_leftovers(place)


def _make_folder(place: Path, name: str) -> Path:
    """A new folder: one of that name may be the very one that ``latest.json`` names."""
    for number in itertools.count(1):
        target = place / (name if number == 1 else f"{name}-{number}")
        try:
            target.mkdir(parents=True)
        except FileExistsError:
            continue
        return target
    raise AssertionError("there is always a free number")


def _pickles(folder: Path) -> list[Path]:
    return [path for path in (folder / MODEL_FILE, folder / BUFFER_FILE) if path.is_file()]
