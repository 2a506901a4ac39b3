"""How the kernels are compiled: one decorator, one cache that knows when any source changed, one message to the user.

Numba keys its cache on the file of the compiled function alone, so a change in a function that it *calls*, in another file,
would be missed and old code would run in silence. Our cache locator stamps each entry with a hash over all sources of this
package instead.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.core.caching import CacheImpl, _CacheLocator

PACKAGE = Path(__file__).resolve().parents[1]  # the folder of tagtrack.envs

# Re-association and contraction let loops become SIMD; NaN and infinity keep their meaning, because NaN marks missing data.
FAST_MATHS = {"contract", "reassoc", "nsz", "arcp"}


@lru_cache(maxsize=1)
def source_stamp() -> str:
    """Hash over every source file of ``tagtrack.envs``: the compiled code is valid only for exactly these."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(str(path.relative_to(PACKAGE)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


FOREIGN = "_tagtrack_model"  # marks functions outside this package that are compiled over its kernels


def mark_foreign(function: Callable[..., Any]) -> None:
    """Let a function of somebody else's file be cached as ours are: valid only for these sources of ours and that file."""
    setattr(function, FOREIGN, True)


class SourceStampedCache(_CacheLocator):
    """Places the cache in ``__pycache__`` beside the source or, where that cannot be written, in the user's cache folder."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_func = py_func
        self._lineno = py_func.__code__.co_firstlineno
        own = PACKAGE in Path(py_file).resolve().parents
        self._foreign = None if own else Path(py_file)
        beside = (PACKAGE if own else Path(py_file).resolve().parent) / "__pycache__"
        if os.environ.get("NUMBA_CACHE_DIR"):
            self._folder = Path(os.environ["NUMBA_CACHE_DIR"]) / "tagtrack"
        elif _is_writable(beside):
            self._folder = beside
        else:
            base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
            self._folder = Path(base) / "tagtrack"

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        if self._foreign is None:
            return source_stamp()
        return source_stamp() + hashlib.sha256(self._foreign.read_bytes()).hexdigest()[:16]

    def get_disambiguator(self) -> str:
        return str(self._lineno)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> SourceStampedCache | None:
        own = PACKAGE in Path(py_file).resolve().parents
        if not own and not (getattr(py_func, FOREIGN, False) and Path(py_file).is_file()):
            return None  # somebody else's function: numba's own rules
        locator = cls(py_func, py_file)
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


class _Announcement(event.Listener):
    """Says once per process, on standard error, that compilation has begun: the first run takes some 20 s longer."""

    def __init__(self) -> None:
        self.said = False

    def on_start(self, event: Any) -> None:
        if self.said or PACKAGE not in Path(event.data["dispatcher"].py_func.__code__.co_filename).resolve().parents:
            return
        self.said = True
        print("TagTrack compiles its simulation for this machine, once (about half a minute) ...", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        pass


if SourceStampedCache not in CacheImpl._locator_classes:
    CacheImpl._locator_classes.insert(0, SourceStampedCache)
    event.register("numba:compile", _Announcement())


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a kernel: cached on disk, free of the interpreter lock, SIMD where its loop allows.

    Callees are inlined before they are optimized. Otherwise the linker takes whichever version of a callee it saw first, that of
    a direct call or that of the step, and two optimizations of one loop may differ in the last bit.
    """
    return numba.njit(cache=True, forceinline=True, nogil=True, fastmath=FAST_MATHS, error_model="numpy")(function)
