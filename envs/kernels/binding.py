"""Compiled code for arguments of given types; where several kernels wait to be compiled, two processes do it.

The compiler holds a lock of its own, so that threads would not help. The helping process writes what it makes into the same
cache, and what both need, whoever comes first has compiled for both.
"""

from __future__ import annotations

import json
import os
import pickle
import select
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import IO, Any

import numba

from tagtrack.envs.kernels.turns import TURN, can_lock, is_ready
from tagtrack.envs.workers import cores

PATIENCE = 10.0  # [s] for what the helping process takes longer
LEFT_ALONE = 75  # its exit status where nobody waits for it any more

Wanted = tuple[Any, tuple[Any, ...]]  # a kernel and the types of its arguments

# The first line of what it reads is where to look for modules, which is not the working folder by itself; the second is the
# work. Then nothing comes until the pipe is closed, with the process that asks: who is left without it has no turn to compile.
_HELPER = (
    "import sys; sys.path[:] = filter(None, sys.path); import json; sys.path[:] = json.loads(sys.stdin.buffer.readline());"
    "from tagtrack.envs.kernels.binding import help_out; help_out(sys.stdin.buffer)"
)


def bind(*calls: tuple[Any, ...]) -> list[Any]:
    """The compiled code of kernels for arguments like these, without numba's look-up at each call (a third of a step).

    It trusts their types, so it may be called only with arrays of our own making.

    Args:
        calls: each a kernel and its arguments. The one that takes longest to compile comes last.
    """
    wanted = [(kernel, tuple(numba.typeof(argument) for argument in arguments)) for kernel, *arguments in calls]
    missing = _missing(wanted)
    if len(missing) > 1:
        with TURN.take(missing[0][0]._cache.cache_path):
            missing = _missing(wanted)  # while we waited, others may have compiled them
            with _help(missing[:-1]):
                for kernel, types in missing[-1:]:
                    kernel.compile(types)
    return [kernel.compile(types) for kernel, types in wanted]


def _missing(wanted: Sequence[Wanted]) -> list[Wanted]:
    return [(kernel, types) for kernel, types in wanted if not is_ready(kernel, types)]


@contextmanager
def _help(wanted: Sequence[Wanted]) -> Iterator[None]:
    """Another process compiles these meanwhile. Whatever keeps it from that costs time alone: they are compiled here, then."""
    helper = _start(wanted) if wanted and can_lock() and cores() > 1 else None
    begun = time.monotonic()
    try:
        yield
        if helper is not None:  # it began when we did
            with suppress(subprocess.TimeoutExpired):
                helper.wait(PATIENCE + time.monotonic() - begun)
    finally:
        if helper is not None:
            helper.kill()
            helper.wait()
            with suppress(OSError):
                helper.stdin.close()  # type: ignore[union-attr]


def _start(wanted: Sequence[Wanted]) -> subprocess.Popen[bytes] | None:
    if not sys.executable or getattr(sys, "frozen", False):
        return None  # no interpreter to start
    names = [(kernel.py_func.__module__, kernel.py_func.__qualname__, types) for kernel, types in wanted]
    work = json.dumps(sys.path).encode() + b"\n" + pickle.dumps(names).hex().encode() + b"\n"
    try:
        helper = subprocess.Popen(
            [sys.executable, "-c", _HELPER],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return None
    assert helper.stdin is not None
    with suppress(OSError):
        helper.stdin.write(work)
        helper.stdin.flush()
    return helper


def help_out(pipe: IO[bytes]) -> None:
    """In the helping process: compile kernels named by their modules, within the turn of the process that asks."""
    TURN.belongs_to_parent = True
    work = pickle.loads(bytes.fromhex(pipe.readline().decode()))

    asking = os.getppid()

    def follow() -> None:  # forks of the one that asks may hold the pipe open beyond its end
        while os.getppid() == asking and not select.select([pipe], [], [], 1.0)[0]:
            pass
        os._exit(LEFT_ALONE)

    threading.Thread(target=follow, daemon=True).start()
    for module, name, types in work:
        getattr(import_module(module), name).compile(types)
