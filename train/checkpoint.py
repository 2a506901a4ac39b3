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
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.envs.validation import brief
from tagtrack.policies.files import remove_leftovers, replace_file
from tagtrack.policies.trust import is_signed, sign

CHECKPOINT_FOLDER = "checkpoint"
LATEST_FILE = "latest.json"
MODEL_FILE = "model.zip"
BUFFER_FILE = "replay_buffer.pkl"  # of SAC
COURSE_FILE = "course.npz"
WHOLE, MOST = ("steps", "next_validation"), 10**18
FOLDER_NAME = re.compile(r"steps_\d+(-\d+)?")


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a run has come."""

    steps: int = 0
    seconds: float = 0.0  # of all parts of the run [s]
    best_reward: float = -math.inf  # of a step, of the policy that was kept
    best_error_m: float = math.inf
    next_validation: int | None = None  # steps; None in checkpoints of earlier versions


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A saved model and what belongs to it. Nothing of it lies outside of the run's folder: no part may be a link."""

    folder: Path
    progress: Progress
    signature: str | None

    @property
    def model(self) -> Path:
        return self.folder / MODEL_FILE

    @property
    def replay_buffer(self) -> Path:
        return self.folder / BUFFER_FILE

    @property
    def course(self) -> Path:
        return self.folder / COURSE_FILE

    def require_trust(self) -> None:
        """Raise ValueError unless its pickles were written by this user on this machine."""
        if not is_signed(_signed(self.folder), self.signature):
            raise ValueError(
                f"{self.folder} was not written by your own training on this machine, and loading it runs whatever code it "
                "holds; if you know where it comes from, add --trust"
            )


def has_checkpoint(run: Path) -> bool:
    """Whether a run has come to its first checkpoint."""
    return (run / CHECKPOINT_FOLDER / LATEST_FILE).is_file()


def save_checkpoint(run: Path, model: Any, progress: Progress, course: Mapping[str, np.ndarray] | None = None) -> None:
    """Save model, progress and course (``course.py``) in a new folder; only then turn ``latest.json`` to it, remove the rest."""
    place = run / CHECKPOINT_FOLDER
    target = _make_folder(place, f"steps_{progress.steps}")
    model.save(target / MODEL_FILE)
    if getattr(model, "replay_buffer", None) is not None:
        model.save_replay_buffer(target / BUFFER_FILE)
    if course is not None:
        np.savez(target / COURSE_FILE, **course)  # type: ignore[arg-type]
    for path in _signed(target):
        with path.open("rb+") as file:
            os.fsync(file.fileno())
    content = {"folder": target.name, **vars(progress), "signature": sign(_signed(target))}
    with replace_file(place / LATEST_FILE) as partial:
        partial.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    remove_others(place, target.name)


def load_checkpoint(run: Path) -> Checkpoint:
    """The last checkpoint; nothing in it is executed yet. Raises ValueError where it is broken."""
    latest = run / CHECKPOINT_FOLDER / LATEST_FILE
    try:
        content = json.loads(latest.read_text(encoding="utf-8"))
        name = content["folder"]
        progress = Progress(**{key: content[key] for key in vars(Progress()) if key in content or key != "next_validation"})
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"{latest}: not a checkpoint ({type(error).__name__}: {error}); train anew") from None
    if not isinstance(name, str) or not FOLDER_NAME.fullmatch(name):
        raise ValueError(f"{latest}: folder must be a name like steps_1000 beside it, got {name!r}; train anew")
    for key, value in vars(progress).items():
        if not _is_number(value, whole=key in WHOLE) and (key, value) != ("next_validation", None):
            raise ValueError(f"{latest}: {key} must be a number, got {brief(value)}; train anew")
    if progress.seconds < 0:
        raise ValueError(f"{latest}: seconds must be at least 0, got {progress.seconds}; train anew")
    checkpoint = Checkpoint(folder=latest.parent / name, progress=progress, signature=content.get("signature"))
    for part in (latest.parent, checkpoint.folder, checkpoint.model, checkpoint.replay_buffer, checkpoint.course):
        if part.is_symlink():
            raise ValueError(f"{part} is a link, which may lead out of the run; put what it means in its place")
    if not checkpoint.model.is_file():
        raise ValueError(f"{checkpoint.folder}: the checkpoint's {MODEL_FILE} is missing; train anew")
    return checkpoint


def sign_anew(run: Path) -> None:
    """Make a checkpoint, which this user's own training wrote on another machine, one of this machine."""
    latest = run / CHECKPOINT_FOLDER / LATEST_FILE
    content = json.loads(latest.read_text(encoding="utf-8"))
    content["signature"] = sign(_signed(load_checkpoint(run).folder))
    with replace_file(latest) as partial:
        partial.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


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


def _is_number(value: Any, *, whole: bool) -> bool:
    if isinstance(value, bool) or not isinstance(value, int if whole else (int, float)):
        return False
    return 0 <= value <= MOST if whole else abs(value) <= MOST or value in (math.inf, -math.inf)


def _signed(folder: Path) -> list[Path]:
    return [path for path in (folder / MODEL_FILE, folder / BUFFER_FILE, folder / COURSE_FILE) if path.is_file()]
