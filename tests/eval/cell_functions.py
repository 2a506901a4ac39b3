"""Parts of work for the tests of engines: other processes must be able to import them."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


def double(number: int, *, tell) -> int:
    for _ in range(3):
        tell(1)
    return 2 * number


def note_and_double(number: int, log: Path, *, tell) -> int:
    with log.open("a") as file:
        file.write(f"{number}\n")
    return double(number, tell=tell)


def refuse(number: int, *, tell) -> int:
    raise ValueError(f"{number} is not to be doubled")


def kill_the_process_once(number: int, marker: Path | None, *, tell) -> int:
    """Ends its process the first time; without a marker always."""
    tell(2)
    if marker is None or not marker.exists():
        if marker is not None:
            marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    tell(1)
    return 2 * number


def wait_for_the_end(number: int, place: Path | None = None, *, tell) -> int:
    if place is not None:
        place.write_text(f"{os.getpid()}\n")
    time.sleep(600)
    return number
