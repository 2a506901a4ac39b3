"""The log of a mission at sea: every line that came and went, written before anything follows from it.

A journal is JSON lines. The first says what the mission is; the others are ``{"t": ..., "from": "vehicle", "line": "..."}`` and
``{"t": ..., "to": "vehicle", "line": "..."}``, with ``safe`` where an order follows from no line, but from time. Each is written
by a single call, so that a kill leaves whole lines but for the last, which is then cut off: nothing had followed from it.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

JOURNAL_FILE = "journal.jsonl"


class Journal:
    """An append-only file of events."""

    def __init__(self, path: Path, *, fresh: bool) -> None:
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | (os.O_EXCL if fresh else 0)
        try:
            self._file = os.open(path, flags, 0o644)
        except FileExistsError:
            raise FileExistsError(f"{path} is there already; go on with it (--resume), or choose another folder") from None
        self.path = path
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._file)
            raise OSError(f"{path} is being written by another process; end that one first") from None

    def sync(self) -> None:
        """See to it that a power cut loses nothing that was noted."""
        os.fsync(self._file)

    def note(self, event: dict[str, Any]) -> None:
        """Write an event. Raises OSError where the disk is full."""
        data = (json.dumps(event, separators=(",", ":")) + "\n").encode("ascii")
        if os.write(self._file, data) != len(data):
            raise OSError(f"{self.path}: the disk is full")

    def close(self) -> None:
        os.close(self._file)


def mend(path: Path) -> None:
    """Cut off a half line at the end of a journal."""
    with path.open("rb+") as file:
        size = file.seek(0, os.SEEK_END)
        back = min(size, 1 << 16)
        file.seek(size - back)
        tail = file.read(back)
        whole = tail.rfind(b"\n") + 1
        if whole < len(tail):
            file.truncate(size - len(tail) + whole)


def read_events(path: Path) -> Iterator[dict[str, Any]]:
    """The events of a journal, in order. Raises ValueError for a line that is none."""
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if not line.endswith(b"\n"):  # cut off by a kill: nothing had followed from it
                return
            try:
                event = json.loads(line)
            except (ValueError, RecursionError):
                event = None
            if not isinstance(event, dict) or not (_is_header(event) if number == 1 else _is_whole(event)):
                raise ValueError(f"{path}: line {number} is damaged; what comes after it cannot be trusted")
            yield event


def _is_header(event: dict[str, Any]) -> bool:
    """Whether a first line is a mission's, and has not run together with the second."""
    return not {"from", "to"} & event.keys()


def _is_whole(event: dict[str, Any]) -> bool:
    """Whether an event says when, what and of whom."""
    t: Any = event.get("t")
    line = event.get("line")
    who = event.get("from") in ("receiver", "vehicle") or event.get("to") == "vehicle"
    return type(t) in (int, float) and abs(t) < 1e12 and isinstance(line, str) and _is_latin(line) and who


def _is_latin(line: str) -> bool:
    return all(ord(letter) < 256 for letter in line)
