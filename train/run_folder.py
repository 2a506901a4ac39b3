"""The record of a run on disk. Every file is written under another name and renamed, so that a kill leaves none half written.

    config.json  versions.json       what was run, with which packages and commit
    progress.csv  learning_curve.png how it went
    policy.safetensors  policy.json  the best policy so far
    untrained/                       the policy before its first step
    table.md                         both beside the best heuristics; a finished run has it
    checkpoint/                      all that --resume needs; SB3's own files, which hold pickles: loaded if signed here

A row of progress.csv is a validation: ``steps`` of training so far, ``seconds`` since the beginning, ``steps_per_s`` of training
alone; ``train_error_m`` and ``train_reward_per_step``, means over the steps of the training episodes that ended since the last
row; ``validation_error_m`` and ``validation_reward_per_step``, means over all steps of the validation episodes;
``best_error_m`` of the policy that was kept.
"""

from __future__ import annotations

import csv
import itertools
import json
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from tagtrack.eval.results_folder import require_room
from tagtrack.policies.files import is_leftover, remove_leftovers, replace_file
from tagtrack.train.checkpoint import CHECKPOINT_FOLDER
from tagtrack.train.lock import LOCK_FILE, FolderLock

CONFIG_FILE = "config.json"
PROGRESS_FILE = "progress.csv"
TABLE_FILE = "table.md"
UNTRAINED = "untrained"
COLUMNS = (
    "steps", "seconds", "steps_per_s", "train_error_m", "train_reward_per_step",
    "validation_error_m", "validation_reward_per_step", "best_error_m",
)  # fmt: skip


class RunFolder:
    """One run's folder, closed to other processes until the ``with`` block ends. One made in vain is removed."""

    def __init__(self, path: Path, *, made: bool = False) -> None:
        self.path = path
        self._made = made
        self._lock = FolderLock(path)

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if not (self.path / CONFIG_FILE).exists():
            with suppress(OSError):
                self._lock.path.unlink()
                if self._made:
                    self.path.rmdir()
        self._lock.release()

    @classmethod
    def create(cls, path: Path | None, name: str) -> RunFolder:
        """A new folder: the one asked for, or the first free ``runs/NAME``, ``runs/NAME-2`` ...

        Raises:
            ValueError: where the folder exists and is not empty, or another process has just begun a run in it.
        """
        if path is None:
            return cls(_make_free_folder(Path("runs"), name), made=True)
        if path.exists() and not path.is_dir():
            raise ValueError(f"--out {path} is a file; choose a folder")
        made = not path.exists()
        if not made:
            _require_empty(path)
        require_room(path, f"--out {path}")
        path.mkdir(parents=True, exist_ok=True)
        folder = cls(path, made=made)
        try:
            remove_leftovers(path)
            _require_empty(path)  # once more: it may have been another's until now
        except ValueError:
            folder._lock.release()
            raise
        return folder

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """The folder of a run to go on with.

        Raises:
            FileNotFoundError: where there is none.
            ValueError: where another process trains in it.
        """
        if not (path / CONFIG_FILE).is_file():
            within = sorted(run.parent for run in path.glob(f"*/{CONFIG_FILE}"))
            way = f"; the command that began those in it goes on with all, --resume {within[0]} with one" if within else ""
            raise FileNotFoundError(f"{path} is not a run: it has no {CONFIG_FILE}{way}")
        for part in (CHECKPOINT_FOLDER, UNTRAINED, "tensorboard"):
            if (path / part).is_symlink():
                raise ValueError(f"{path / part} is a link, which may lead out of the run; put what it means in its place")
        folder = cls(path)
        for place in (path, path / UNTRAINED):
            if place.is_dir():
                remove_leftovers(place)
        return folder

    def write_json(self, name: str, content: dict[str, Any]) -> None:
        with replace_file(self.path / name) as partial:
            partial.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")

    def read_progress(self) -> list[dict[str, str]]:
        """Rows of progress.csv, "" for what an older one lacks; none where the file is absent. ValueError: if it is damaged."""
        path = self.path / PROGRESS_FILE
        if not path.is_file():
            return []
        try:
            with path.open(newline="", encoding="utf-8") as file:
                rows = [{column: row.get(column) or "" for column in COLUMNS} for row in csv.DictReader(file)]
            for row in rows:
                int(row["steps"]), float(row["validation_error_m"])
        except (ValueError, csv.Error) as error:
            raise ValueError(f"{path}: damaged ({error}); remove it to go on without its rows") from None
        return rows

    def write_progress(self, rows: list[dict[str, str]]) -> None:
        with replace_file(self.path / PROGRESS_FILE) as partial, partial.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)


def _make_free_folder(place: Path, name: str) -> Path:
    """The first of ``name``, ``name-2`` ... that is free: made, so that whoever comes at the same time takes the next."""
    for number in itertools.count(1):
        path = place / (name if number == 1 else f"{name}-{number}")
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            continue
        return path
    raise AssertionError("there is always a free number")


def _require_empty(path: Path) -> None:
    if (path / CONFIG_FILE).is_file():
        raise ValueError(f"--out {path} holds a run; go on with it by --resume {path}, or choose another folder")
    if any(entry.name != LOCK_FILE and not is_leftover(entry) for entry in path.iterdir()):
        raise ValueError(f"--out {path} exists and is not a run; choose another folder")
