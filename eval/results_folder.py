"""A folder of results is replaced as a whole: made elsewhere first, moved in at the end, and never over files of others.

Files are written into a hidden folder ``.partial-...`` within it, which is renamed to ``.whole-...`` when all are there. What a
kill leaves of the first is rubbish; what it leaves of the second, in the middle of the move, is moved in by the next command.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from tagtrack.eval.folder_claim import claim, release
from tagtrack.policies.files import replace_file

PARTIAL, WHOLE = ".partial-", ".whole-"
LIST = ".list"  # of the files of a complete set


def default_folder(command: str, env_id: str) -> Path:
    """``runs/benchmark-LeopardShark-v0-20260131-154502``: by command, environment and local time."""
    return Path("runs") / f"{command}-{env_id.rpartition('/')[2]}-{datetime.now():%Y%m%d-%H%M%S}"


def require_replaceable(folder: Path, own: Sequence[str], what: str) -> None:
    """Refuse, before any work is done, a folder that must not or cannot be written; then it is this process's alone.

    Args:
        own: patterns of the file names that an earlier result of the same kind may have left there. what: that kind.
    Raises:
        ValueError: if it is a file, or holds anything else; if another process is at work on it.
        PermissionError: if it, or the folder it would be made in, cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file; choose a folder")
    if folder.is_dir():
        for entry in sorted(folder.iterdir()):
            if not any(entry.match(pattern) for pattern in own) and not _is_left(entry):
                raise ValueError(f"--out {folder} holds {entry.name}, which is no part of a {what}; choose another folder")
    require_room(folder, f"--out {folder}")
    claim(folder)
    if folder.is_dir():
        settle(folder, own)


def require_writable_file(path: Path | None) -> None:
    """Refuse, before any work is done, a file that cannot be written; None is none.

    Raises:
        ValueError: if it is a folder. FileNotFoundError: if its folder is missing. PermissionError: if that cannot be written.
    """
    if path is None:
        return
    folder = path.absolute().parent
    if path.is_dir():
        raise ValueError(f"{path} is a folder; name a file in it")
    if not folder.is_dir():
        raise FileNotFoundError(f"cannot write {path}: make the folder {folder} first")
    require_room(folder, str(path))


def require_room(folder: Path, what: str) -> None:
    """Raise PermissionError unless something can be made in a folder, or where that is made: permissions alone do not tell."""
    folder = folder.absolute()
    while not folder.exists():
        folder = folder.parent
    try:
        tempfile.TemporaryDirectory(dir=folder, prefix=PARTIAL).cleanup()
    except OSError as error:
        raise PermissionError(f"{what} cannot be written ({folder}: {error.strerror}); choose another folder") from None


@contextmanager
def replace_results(folder: Path, own: Sequence[str]) -> Iterator[Path]:
    """Give an empty folder to write into; when the block is done its files take the place of the ``own`` ones in ``folder``.

    If the block fails, the folder is as it was before, or absent if it was absent.
    """
    made = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=PARTIAL, dir=folder))
    try:
        yield staging
        for file in staging.iterdir():
            _write_through(file)
        whole = staging.with_name(WHOLE + staging.name.removeprefix(PARTIAL))
        staging.rename(whole)
        _move_in(whole, own)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if made:
            with suppress(OSError):  # not empty: the results are there
                folder.rmdir()
        release(folder)


def settle(folder: Path, own: Sequence[str]) -> None:
    """Put in order what a kill left of a folder of results; nobody else may be at work on it."""
    for entry in sorted(folder.iterdir()):
        if _is_left(entry) and entry.name.startswith(WHOLE):
            _move_in(entry, own)
        elif _is_left(entry):
            shutil.rmtree(entry, ignore_errors=True)


def _is_left(entry: Path) -> bool:
    return entry.name.startswith((PARTIAL, WHOLE)) and entry.is_dir() and not entry.is_symlink()


def _move_in(whole: Path, own: Sequence[str]) -> None:
    """Move a complete set of results, or what is left of it, one level up; files of earlier results that it lacks go."""
    folder = whole.parent
    listed = whole / LIST
    if not listed.exists():
        names = sorted(path.name for path in whole.iterdir() if not path.name.startswith("."))
        with replace_file(listed) as partial:
            partial.write_text(json.dumps(names), encoding="utf-8")
    names = json.loads(listed.read_text(encoding="utf-8"))
    for old in folder.iterdir():
        if old.is_file() and old.name not in names and any(old.match(pattern) for pattern in own):
            old.unlink()
    for name in names:
        with suppress(FileNotFoundError):  # moved before
            os.replace(whole / name, folder / name)
    shutil.rmtree(whole)


def _write_through(file: Path) -> None:
    """To the disk itself: a power cut after the move must not leave an empty file."""
    with file.open("rb+") as content:
        os.fsync(content.fileno())
