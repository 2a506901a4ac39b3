"""Commands are killed at many moments, most of them while files change; what they leave is whole, and they go on from there.

    python -m tests.harness.kill [MOMENTS] [SEED]

A command runs in a child process that ends itself (SIGKILL) at a random one of its operations on files, or is ended at a random
time; the next one, which goes on, is killed, too, in one case of three. Checked: every file in the folder can be read whole, the
command or its ``--resume`` then succeeds, nothing hidden is left, and the results are those of a run that nobody killed.
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from tests.harness.kill_commands import COMMANDS, Command

EVENTS = {
    "open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod", "os.link", "os.symlink", "shutil.rmtree",
}  # fmt: skip


@dataclass
class Moment:
    """When a child ends: at an operation on files below a folder, counted from 0, or after so many seconds."""

    operation: int | None = None
    seconds: float | None = None


def run_child(line: Callable[[], int], folder: Path, moment: Moment | None) -> tuple[int, int, float]:
    """Exit status (-9: killed), operations on files below the folder, and seconds of a command in a process of its own."""
    read, write = os.pipe()
    begun = time.monotonic()
    child = os.fork()
    if child == 0:
        status = 70
        try:
            os.close(read)
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, 1)
            os.dup2(null, 2)
            sys.addaudithook(_Watch(str(folder), moment, write))
            status = line()
        finally:
            os._exit(status)
    os.close(write)
    if moment is not None and moment.seconds is not None:
        time.sleep(moment.seconds)
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
    _, how = os.waitpid(child, 0)
    with os.fdopen(read, "rb") as pipe:
        operations = len(pipe.read())
    return os.waitstatus_to_exitcode(how), operations, time.monotonic() - begun


class _Watch:
    """Counts a process's operations on files below a folder, and ends it at one of them."""

    def __init__(self, folder: str, moment: Moment | None, pipe: int) -> None:
        self.folder, self.pipe = folder, pipe
        self.last = None if moment is None else moment.operation
        self.count = 0

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        if event not in EVENTS or not any(self.folder in str(each) for each in arguments[:2]):
            return
        if event == "open" and isinstance(arguments[2], int) and not arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            return  # only read
        if self.count == self.last:
            os.kill(os.getpid(), signal.SIGKILL)
        self.count += 1
        os.write(self.pipe, b".")


def try_moment(command: Command, expected: dict[str, object], size: tuple[int, float], chance: random.Random) -> str:
    """Kill a command at a random moment, once or twice. Returns where; raises AssertionError for what is left wrong."""
    operations, seconds = size
    place = Path(tempfile.mkdtemp(prefix="tagtrack-kill-"))
    told = []
    try:
        out = place / "out"
        command.prepare(out)
        lines = [command.line]
        for _ in range(1 + (chance.random() < 1 / 3)):
            by_file = chance.random() < 0.8
            moment = Moment(operation=chance.randrange(operations)) if by_file else Moment(seconds=chance.uniform(0, seconds))
            status, *_ = run_child(lambda: lines[-1](out), out, moment)
            told.append(f"operation {moment.operation}" if by_file else f"{moment.seconds:.2f} s")
            assert status in (0, -signal.SIGKILL), f"exit status {status} after {told}"
            command.require_whole(out)
            lines.append(command.go_on(out))
        status, *_ = run_child(lambda: lines[-1](out), out, None)
        assert status == 0, f"does not go on (exit status {status}) after {told}"
        command.require_whole(out)
        hidden = [path for path in out.rglob(".*") if path.name != ".lock"]
        assert not hidden, f"left: {hidden} after {told}"
        found = command.results(out)
        assert found == expected, f"other results after {told}: {[key for key in expected if found.get(key) != expected[key]]}"
    finally:
        shutil.rmtree(place, ignore_errors=True)
    return ", then ".join(told)


def kill(moments: int, seed: int, names: list[str] | None = None) -> dict[str, int]:
    """Try so many moments, spread over the commands. Returns how many of each were tried; raises at the first that fails."""
    chance = random.Random(seed)
    chosen = {name: COMMANDS[name] for name in names or COMMANDS}
    with (
        tempfile.TemporaryDirectory(prefix="tagtrack-kill-key-") as own,
        mock.patch.dict(os.environ, XDG_CONFIG_HOME=own, XDG_CACHE_HOME=own),
    ):
        return _kill_all(chosen, moments, chance)


def _kill_all(chosen: dict[str, Command], moments: int, chance: random.Random) -> dict[str, int]:
    counts = {}
    for number, (name, command) in enumerate(chosen.items()):
        with tempfile.TemporaryDirectory(prefix="tagtrack-kill-") as place:
            out = Path(place) / "out"
            command.prepare(out)
            status, operations, seconds = run_child(lambda: command.line(out), out, None)  # noqa: B023 - called at once
            assert status == 0, f"{name} does not run (exit status {status})"
            expected = command.results(out)
        tried = moments // len(chosen) + (number < moments % len(chosen))
        for _ in range(tried):
            where = try_moment(command, expected, (operations, seconds), chance)
            print(
                f"{name}: killed at {where} of {operations} and {seconds:.1f} s: whole, went on, same results",
                flush=True,
            )
        counts[name] = tried
    return counts


def main() -> None:
    words = sys.argv[1:]
    seed = int(words[1]) if len(words) > 1 else random.randrange(2**31)
    counts = kill(int(words[0]) if words else 50, seed)
    print(f"{sum(counts.values())} moments (seed {seed}): " + ", ".join(f"{name} {number}" for name, number in counts.items()))


if __name__ == "__main__":
    main()
