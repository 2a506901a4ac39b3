"""Results of finished cells, kept until the whole is done: a command that was cut off begins where it ended.

They lie in the user's cache, named by the sum over the cell, our code, the packages and the processor: whatever could change a
result changes its name. They are pickles, and read only where this user signed them on this machine.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import json
import os
import pickle
import time
from contextlib import suppress
from pathlib import Path

import tagtrack
from tagtrack.eval.cells.cell import Done, Parcel
from tagtrack.eval.versions import collect_versions
from tagtrack.policies.files import replace_file
from tagtrack.policies.trust import is_signature, signature_of

DAYS = 14  # that what a command left, which nobody repeated, is kept


def cache_folder() -> Path:
    """``$XDG_CACHE_HOME/tagtrack/cells``, by default below ``~/.cache``."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "tagtrack" / "cells"


class Kept:
    """What is kept of one command's cells. Where nothing can be written nothing is kept, and nothing fails."""

    def __init__(self) -> None:
        self._folder: Path | None = None
        self._used: set[Path] = set()
        with suppress(OSError, RuntimeError):  # no home, or one that cannot be written
            folder = cache_folder()
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._folder = folder
            _remove_old(folder)

    def find(self, parcel: Parcel) -> Done | None:
        """What a cell gave back when it ran before."""
        path = self._path(parcel)
        if path is None:
            return None
        try:
            signature, _, content = path.read_bytes().partition(b"\n")
        except OSError:
            return None
        if not is_signature(signature.decode("ascii", "replace"), path.name.encode() + content):
            return None
        self._used.add(path)
        found: Done = pickle.loads(content)
        return found

    def keep(self, parcel: Parcel, done: Done) -> None:
        """Write down what it gave back."""
        path = self._path(parcel)
        if path is None:
            return
        content = pickle.dumps(done, protocol=5)
        signature = signature_of(path.name.encode() + content)
        if signature is None:
            return
        with suppress(OSError):  # a full disk costs the help, not the command
            with replace_file(path) as partial:
                partial.write_bytes(signature.encode() + b"\n" + content)
            self._used.add(path)

    def forget(self) -> None:
        """The whole is done, and written: its parts are of no more use."""
        for path in self._used:
            with suppress(OSError):
                path.unlink()
        self._used.clear()

    def _path(self, parcel: Parcel) -> Path | None:
        if self._folder is None or parcel.own_code:
            return None
        return self._folder / hashlib.sha256(_code_sum() + parcel.content).hexdigest()


@functools.cache
def _code_sum() -> bytes:
    """A sum over our sources, the versions of packages and the kind of processor."""
    from numba.core.registry import cpu_target

    versions = {name: text for name, text in collect_versions().items() if name != "commit"}
    total = hashlib.sha256(json.dumps([versions, cpu_target.target_context.codegen().magic_tuple()]).encode())
    for folder in sorted({Path(place) for name in _PARTS for place in importlib.import_module(name).__path__}):
        for path in sorted(folder.rglob("*.py")):
            total.update(f"{path.relative_to(folder)}\n".encode() + path.read_bytes())
    return total.digest()


_PARTS = [tagtrack.__name__, *(f"{tagtrack.__name__}.{part}" for part in ("envs", "policies", "baselines", "eval", "live"))]


def _remove_old(folder: Path) -> None:
    for path in folder.iterdir():
        with suppress(OSError):
            if time.time() - path.stat().st_mtime > DAYS * 86400:
                path.unlink()
