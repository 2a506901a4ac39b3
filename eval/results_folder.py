"""A folder of results is replaced as a whole: made elsewhere first, moved in at the end, and never over files of others."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path


def default_folder(command: str, env_id: str) -> Path:
    """``runs/benchmark-LeopardShark-v0-20260131-154502``: by command, environment and local time."""
    return Path("runs") / f"{command}-{env_id.rpartition('/')[2]}-{datetime.now():%Y%m%d-%H%M%S}"


def require_replaceable(folder: Path, own: Sequence[str], what: str) -> None:
    """Refuse, before any work is done, a folder that must not or cannot be written.

    Args:
        own: patterns of the file names that an earlier result of the same kind may have left there. what: that kind.
    Raises:
        ValueError: if it is a file, or holds anything else.
        PermissionError: if it, or the folder it would be made in, cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file; choose a folder")
    if folder.is_dir():
        for entry in sorted(folder.iterdir()):
            if not any(entry.match(pattern) for pattern in own):
                raise ValueError(f"--out {folder} holds {entry.name}, which is no part of a {what}; choose another folder")
    nearest = folder.absolute()
    while not nearest.exists():
        nearest = nearest.parent
    if not nearest.is_dir() or not os.access(nearest, os.W_OK | os.X_OK):
        raise PermissionError(f"--out {folder} cannot be written ({nearest} refuses); choose another folder")


@contextmanager
def replace_results(folder: Path, own: Sequence[str]) -> Iterator[Path]:
    """Give an empty folder to write into; when the block is done its files take the place of the ``own`` ones in ``folder``.

    If the block fails, the folder is as it was before, or absent if it was absent.
    """
    made = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=".partial-", dir=folder))
    try:
        yield staging
        new = {path.name for path in staging.iterdir()}
        for old in folder.iterdir():
            if old.is_file() and old.name not in new and any(old.match(pattern) for pattern in own):
                old.unlink()
        for name in sorted(new):
            os.replace(staging / name, folder / name)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if made:
            with suppress(OSError):  # not empty: the results are there
                folder.rmdir()
