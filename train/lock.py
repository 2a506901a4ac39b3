"""One process at a time in a run's folder, by a lock of the operating system: it ends with the process, however that ends."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import IO

LOCK_FILE = ".lock"


class FolderLock:
    """The lock on a folder, held from its making to ``release``. The file stays and means nothing by itself.

    Where the file system or the operating system knows no such locks, there is none.

    Raises:
        ValueError: if another process holds it.
        OSError: if the folder cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / LOCK_FILE
        self._file: IO[str] = self.path.open("a+", encoding="utf-8")
        try:
            _lock(self._file)
        except BlockingIOError:
            self._file.seek(0)
            holder = self._file.read().strip()
            self._file.close()
            raise ValueError(f"{folder} is in use by {holder or 'another process'}; wait for it or stop it") from None
        self._file.truncate(0)
        self._file.write(f"process {os.getpid()} on {platform.node()}\n")
        self._file.flush()

    def release(self) -> None:
        """Let others in."""
        self._file.close()


def _lock(file: IO[str]) -> None:
    """Take the lock at once. Raises BlockingIOError where another has it."""
    try:
        import fcntl
    except ImportError:  # Windows
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # a network drive without locks
        return
