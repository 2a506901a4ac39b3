"""The record of a run on disk. Every file is written under another name and renamed, so that a kill leaves none half written.

    config.json  versions.json       what was run, with which packages and commit
    progress.csv  learning_curve.png how it went
    policy.safetensors  policy.json  the best policy so far
    checkpoint/                      all that --resume needs; SB3's own zip files, which hold pickles: resume only runs you trust
"""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

from tagtrack.policies.files import replace_file

CONFIG_FILE = "config.json"
PROGRESS_FILE = "progress.csv"
COLUMNS = (
    "steps", "seconds", "steps_per_s", "train_error_m", "train_reward",
    "validation_error_m", "validation_reward", "best_error_m",
)  # fmt: skip


class RunFolder:
    """One run's folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def create(cls, path: Path | None, name: str) -> RunFolder:
        """A new folder: the one asked for, or the first free ``runs/NAME``, ``runs/NAME-2`` ...

        Raises:
            ValueError: where the folder exists and is not empty.
        """
        if path is None:
            path = Path("runs") / name
            number = 1
            while path.exists():
                number += 1
                path = Path("runs") / f"{name}-{number}"
        elif path.exists() and not path.is_dir():
            raise ValueError(f"--out {path} is a file; choose a folder")
        elif path.exists() and any(path.iterdir()):
            if (path / CONFIG_FILE).is_file():
                raise ValueError(f"--out {path} holds a run; go on with it by --resume {path}, or choose another folder")
            raise ValueError(f"--out {path} exists and is not a run; choose another folder")
        path.mkdir(parents=True, exist_ok=True)
        return cls(path)

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """The folder of a run to go on with. Raises FileNotFoundError where there is none, or no checkpoint in it."""
        if not (path / CONFIG_FILE).is_file():
            raise FileNotFoundError(f"{path} is not a run: it has no {CONFIG_FILE}")
        folder = cls(path)
        if not folder._latest().is_file():
            raise FileNotFoundError(f"{path} has no checkpoint yet: nothing to resume; remove the folder and train anew")
        return folder

    def write_json(self, name: str, content: dict[str, Any]) -> None:
        with replace_file(self.path / name) as partial:
            partial.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")

    def read_progress(self) -> list[dict[str, str]]:
        """Rows of progress.csv; none where the file is absent."""
        path = self.path / PROGRESS_FILE
        if not path.is_file():
            return []
        with path.open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    def write_progress(self, rows: list[dict[str, str]]) -> None:
        with replace_file(self.path / PROGRESS_FILE) as partial, partial.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)

    def _latest(self) -> Path:
        return self.path / "checkpoint" / "latest.json"

    def save_checkpoint(self, model: Any, state: dict[str, Any]) -> None:
        """Save model and state in a folder of their own; only then is ``latest.json`` turned to it and the old one removed."""
        checkpoint = self.path / "checkpoint"
        name = f"steps_{model.num_timesteps}"
        target = checkpoint / name
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir(parents=True)
        model.save(target / "model.zip")
        if getattr(model, "replay_buffer", None) is not None:
            model.save_replay_buffer(target / "replay_buffer.pkl")
        with replace_file(self._latest()) as partial:
            partial.write_text(json.dumps({"folder": name, **state}, indent=2) + "\n", encoding="utf-8")
        for other in checkpoint.iterdir():
            if other.is_dir() and other.name != name:
                shutil.rmtree(other, ignore_errors=True)

    def load_state(self) -> tuple[Path, dict[str, Any]]:
        """The last checkpoint's folder and state. Raises ValueError where it is broken."""
        try:
            state = json.loads(self._latest().read_text(encoding="utf-8"))
            folder = self.path / "checkpoint" / state["folder"]
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{self._latest()}: not a checkpoint ({error}); train anew") from None
        if not (folder / "model.zip").is_file():
            raise ValueError(f"{folder}: the checkpoint's model.zip is missing; train anew")
        return folder, state
