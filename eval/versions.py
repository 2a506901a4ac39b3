"""Which code made a result: versions of the packages that can change its numbers, and the commit of this repository."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import tagtrack

SOURCES = Path(__file__).resolve().parents[1]
PACKAGES = (
    "numpy",
    "numba",
    "llvmlite",
    "gymnasium",
    "pettingzoo",
    "stable-baselines3",
    "torch",
    "safetensors",
    "filterpy",
    "scipy",
)


def collect_versions() -> dict[str, str]:
    """Versions by name: ``tagtrack``, ``commit``, ``python`` and the packages that are installed.

    ``commit`` ends in ``-dirty`` where tracked files were changed since, and is ``unknown`` outside a clone of the repository.
    """
    found = {"tagtrack": tagtrack.__version__, "commit": _commit(), "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _commit() -> str:
    # Installed from a wheel, the sources may lie inside somebody else's repository (a project with its .venv): not our commit.
    if _git("rev-parse", "--show-toplevel") != str(SOURCES):
        return "unknown"
    return _git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*") or "unknown"


def _git(*arguments: str) -> str:
    """The output of a git command in the sources' folder; empty where it fails. Never writes to the repository."""
    environment = os.environ | {"GIT_OPTIONAL_LOCKS": "0"}
    try:
        done = subprocess.run(
            ["git", *arguments], cwd=SOURCES, env=environment, capture_output=True, text=True, timeout=30, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()
