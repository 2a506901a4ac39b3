"""One process compiles, the others wait and load what it has written: a lock beside the compiled code.

Twenty workers that start in a new place would otherwise each compile the same kernels, and share the cores meanwhile.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from numba.core.caching import FunctionCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.sigutils import normalize_signature

fcntl: Any = None if sys.platform == "win32" else import_module("fcntl")  # without it each compiles for itself

LOCK = "tagtrack-compiling.lock"
INDEX_LOCK = "tagtrack-index.lock"


class _Turn:
    """This process's turn in one folder. It is entered under numba's own lock, so that one thread at a time asks."""

    said = False

    def __init__(self) -> None:
        self.belongs_to_parent = False  # who waits for this process, and holds the lock
        self._depth = 0
        self._file: IO[bytes] | None = None
        self._collects = True

    @contextmanager
    def take(self, folder: str) -> Iterator[None]:
        """Wait until nobody else compiles in the folder; kernels that are compiled for others belong to the same turn."""
        with global_compiler_lock:
            if self._depth == 0:
                self._file = None if self.belongs_to_parent else _lock(Path(folder) / LOCK)
                self._collects = gc.isenabled()
                gc.disable()  # nothing of what a compiler builds is garbage before it is done; to look took a tenth of the time
            self._depth += 1
            try:
                yield
            finally:
                self._depth -= 1
                if self._depth == 0:
                    if self._collects:
                        gc.enable()
                    if self._file is not None:
                        self._file.close()  # unlocks, too
                        self._file = None


TURN = _Turn()


def can_lock() -> bool:
    """Whether processes can take turns here."""
    return fcntl is not None


def _lock(path: Path) -> IO[bytes] | None:
    """The file, locked by this process; None where files cannot be locked."""
    if fcntl is None:
        return None
    try:
        file = path.open("ab")
    except OSError:  # it is for the time saved alone
        return None
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return file
    except OSError:
        pass
    if not _Turn.said:
        _Turn.said = True
        print("TagTrack waits for another process that compiles its simulation ...", file=sys.stderr, flush=True)
    try:
        fcntl.lockf(file, fcntl.LOCK_EX)
    except OSError:  # a file system without locks
        file.close()
        return None
    return file


def is_cached(cache: Any, signature: Any, context: Any) -> bool:
    """Whether a kernel's cache on disk (numba's ``Cache``) has code for a signature; it is not loaded for that."""
    context.refresh()
    return cache._index_key(signature, context.codegen()) in cache._cache_file._load_index()


def is_ready(kernel: Any, signature: Any) -> bool:
    """Whether a kernel (numba's dispatcher) has code for a signature, in this process or on disk; or cannot be cached at all."""
    cache = kernel._cache
    if tuple(normalize_signature(signature)[0]) in kernel.overloads:
        return True
    return not hasattr(cache, "_cache_file") or is_cached(cache, signature, kernel.targetctx)


def compile_in_turn(kernel: Any) -> None:
    """Let a kernel (numba's dispatcher) wait for its turn before it compiles what is not on disk yet."""
    compile_now: Callable[[Any], Any] = kernel.compile

    def compile(signature: Any) -> Any:
        if is_ready(kernel, signature):
            return compile_now(signature)
        with TURN.take(kernel._cache.cache_path):
            return compile_now(signature)  # which looks at the disk once more

    kernel.compile = compile
    _save_one_by_one(kernel._cache)


def _save_one_by_one(cache: Any) -> None:
    """Two processes that write to one index at once would give one number to two pieces of code, and load the wrong one."""
    if fcntl is None or not hasattr(cache, "_cache_file"):
        return
    save_now: Callable[[Any, Any], None] = cache.save_overload

    def save(signature: Any, result: Any) -> None:
        try:
            file = (Path(cache.cache_path) / INDEX_LOCK).open("ab")
        except OSError:  # nor can anything be saved there
            return save_now(signature, result)
        with file:
            with suppress(OSError):  # a file system without locks
                fcntl.lockf(file, fcntl.LOCK_EX)
            return save_now(signature, result)

    cache.save_overload = save


@contextmanager
def turn_of_callback(function: Callable[..., Any], signature: Any) -> Iterator[None]:
    """The same for a function that is compiled by ``numba.cfunc``. Raises RuntimeError where its code cannot be cached."""
    cache = FunctionCache(function)
    if is_cached(cache, signature, cpu_target.target_context):
        yield
        return
    with TURN.take(cache.cache_path):
        yield
