"""One process at a time for a folder of results, from its first step to its last file: the second would work in vain.

A lock of the operating system on a file among the temporary ones, named after the folder, which need not exist yet. It ends with
the process, however that ends.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

_held: dict[Path, int] = {}  # open files by folder


def claim(folder: Path) -> None:
    """Take a folder for this process, until ``release`` or its end. Raises ValueError where another process has it.

    Where the operating system knows no such locks, or there is no temporary folder to write in, nothing is claimed.
    """
    folder = folder.resolve()
    if folder in _held:
        return
    try:
        import fcntl
    except ImportError:  # Windows
        return
    name = f"tagtrack-{os.getuid()}-{hashlib.sha256(os.fsencode(folder)).hexdigest()[:16]}.lock"
    try:
        file = os.open(Path(tempfile.gettempdir()) / name, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    except OSError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(file)
        raise ValueError(f"--out {folder} is being written by another process; wait for it, or choose another folder") from None
    except OSError:  # a temporary folder without locks
        os.close(file)
        return
    _held[folder] = file


def release(folder: Path) -> None:
    """Let others have it. The file stays: who removed it would let two in."""
    file = _held.pop(folder.resolve(), None)
    if file is not None:
        os.close(file)
