"""The policies that come with the package: one for each environment id, and for fleets."""

from __future__ import annotations

import json
from pathlib import Path

LEARNED = "learned"  # their name on command lines
BOX = Path(__file__).parent / "box"


def boxed_policy(env_id: str, *, vehicles: int = 1, tags: int = 1) -> Path:
    """The folder of the policy for a task. Raises ValueError where there is none, naming those there are."""
    name = env_id.rpartition("/")[2].rpartition("-v")[0] or env_id
    kind = "" if vehicles == tags == 1 else "-fleet" if tags == 1 else "-tags"
    folder = BOX / f"{name}{kind}"
    if not folder.is_dir():
        known = ", ".join(sorted(path.name for path in BOX.iterdir() if path.is_dir()))
        raise ValueError(f"no policy for {name}{kind} comes with the package, only {known}; train one, and name its folder")
    return folder


def trained_by(folder: Path) -> str:
    """The command that trained one of them."""
    return str(json.loads((folder / "run.json").read_text(encoding="utf-8"))["command"])
