"""How the kernels are compiled: one decorator, one cache that knows when a source of theirs changed, one message to the user.

Numba keys its cache on the file of the compiled function alone, so a change in a function that it *calls*, in another file,
would be missed and old code would run in silence. Our cache locator stamps each entry with a hash over all files of this package
that compiled code is made from: those that hold kernels, and what they import. One stamp serves all, since a kernel also depends
on files that it does not import: on the order of the fields of a named tuple that it is handed. Such a class belongs beside the
kernels that fill it.
"""

from __future__ import annotations

import getpass
import hashlib
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import lru_cache, update_wrapper
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
from numba.core import event
from numba.core.caching import CacheImpl, _CacheLocator

from tagtrack.envs.kernels.parts import OptimizedPartCompiler, PartCompiler
from tagtrack.envs.kernels.turns import compile_in_turn

if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise ImportError("the simulation is compiled code, which NUMBA_DISABLE_JIT forbids; unset NUMBA_DISABLE_JIT")

PACKAGE = Path(__file__).resolve().parents[1]  # the folder of tagtrack.envs

# Re-association and contraction let loops become SIMD; NaN and infinity keep their meaning, because NaN marks missing data.
FAST_MATHS = {"contract", "reassoc", "nsz", "arcp"}


# What a kernel and an import within the package look like. To search the text takes a tenth of the time that parsing it would
# take at each start; tests/envs/test_compiling.py holds both against Python's own parser.
_DECORATOR = rb"@(?:compiled|inner|outlined|native|numba\.|n?jit|cfunc|intrinsic|overload\w*|(?:gu)?vectorize)\b"
_KERNEL = re.compile(rb"^[ \t]*" + _DECORATOR, re.MULTILINE)
_IMPORT = re.compile(rb"^[ \t]*(?:from|import)[ \t]+tagtrack\.envs\b([\w.]*)(?:[ \t]+import[ \t]+(\([^)]*\)|.*))?", re.MULTILINE)


def compiled_sources(package: Path) -> dict[str, bytes]:
    """Content of the files that hold kernels and of what these import, directly or through others, by path within the package."""
    content = {path.relative_to(package).as_posix(): path.read_bytes() for path in package.rglob("*.py")}
    found: set[str] = set()
    waiting = [name for name, text in content.items() if _KERNEL.search(text)]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += [imported for imported in _imported_files(content[name]) if imported in content]
    return {name: content[name] for name in sorted(found)}


def _imported_files(text: bytes) -> Iterator[str]:
    """Where the modules that a file imports would lie; of ``from a import b``, b may be a module as well as a name within a."""
    for module, names in _IMPORT.findall(text):
        parts = module.decode().split(".")[1:]
        for path in (parts, *([*parts, name.decode()] for name in re.findall(rb"\w+", names))):
            yield "/".join([*path, "__init__.py"])
            if path:
                yield "/".join(path) + ".py"


def stamp_sources(package: Path) -> str:
    """Hash over the names and contents of ``compiled_sources``: compiled code is valid only for exactly these."""
    digest = hashlib.sha256()
    for name, text in compiled_sources(package).items():
        digest.update(name.encode() + b"\0" + text + b"\0")
    return digest.hexdigest()[:16]


@lru_cache(maxsize=1)
def source_stamp() -> str:
    """That of this package, as it was when the first kernel asked."""
    return stamp_sources(PACKAGE)


FOREIGN = "_tagtrack_model"  # marks functions outside this package that are compiled over its kernels


def mark_foreign(function: Callable[..., Any]) -> None:
    """Let a function of somebody else's file be cached as ours are: valid only for these sources of ours and that file."""
    setattr(function, FOREIGN, True)


class SourceStampedCache(_CacheLocator):
    """Places the cache in ``__pycache__`` beside the source or, where that cannot be written, in the user's cache folder.

    Where neither can be, as in a container that only reads, it is in a temporary folder.
    """

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_func = py_func
        self._lineno = py_func.__code__.co_firstlineno
        path = Path(py_file).resolve()
        own = PACKAGE in path.parents
        self._foreign = None if own else path
        self._relative = "-".join(path.relative_to(PACKAGE).with_suffix("").parts) if own else ""
        beside = (PACKAGE if own else path.parent) / "__pycache__"
        if os.environ.get("NUMBA_CACHE_DIR"):
            self._folder = Path(os.environ["NUMBA_CACHE_DIR"]) / "tagtrack"
        elif _is_writable(beside):
            self._folder = beside
        else:
            self._folder = _users_cache() or temporary_cache(beside)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        if self._foreign is None:
            return source_stamp()
        return source_stamp() + hashlib.sha256(self._foreign.read_bytes()).hexdigest()[:16]

    def get_disambiguator(self) -> str:
        return f"{self._relative}-{self._lineno}"  # two rooms may have files and functions of one name

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> SourceStampedCache | None:
        own = PACKAGE in Path(py_file).resolve().parents
        if not own and not (getattr(py_func, FOREIGN, False) and Path(py_file).is_file()):
            return None  # somebody else's function: numba's own rules
        locator = cls(py_func, py_file)
        try:
            locator.ensure_cache_path()
        except OSError:
            locator._folder = temporary_cache(locator._folder)
        return locator


@lru_cache(maxsize=1)
def temporary_cache(refused: Path) -> Path:
    """A folder for compiled code in place of one that cannot be written; says so, once per process.

    It is the user's own and for nobody else to write, for what lies there is run: the same one for all processes of a user.
    """
    try:
        folder = Path(tempfile.gettempdir()) / f"tagtrack-{getpass.getuser()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        owned = folder.lstat()
        safe = not folder.is_symlink() and owned.st_uid == getattr(os, "getuid", lambda: owned.st_uid)()
        safe = safe and not owned.st_mode & 0o022 and os.access(folder, os.W_OK)
    except (OSError, KeyError):  # a user without a name
        safe = False
    if not safe:
        folder = Path(tempfile.mkdtemp(prefix="tagtrack-"))
    print(f"TagTrack cannot write to {refused}; it keeps its compiled code in {folder} (NUMBA_CACHE_DIR names another)",
          file=sys.stderr, flush=True)  # fmt: skip
    return folder


def _users_cache() -> Path | None:
    """Where the user's compiled code goes; None for a user without a home."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tagtrack"
    except RuntimeError:
        return None


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


class _Announcement(event.Listener):
    """Says once per process, on standard error, that compilation has begun: the first run takes some half a minute longer."""

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


_njit: Any = numba.njit  # its types know only some of the options

# References to arrays are not counted (``_nrt``): kernels work on arrays that their callers hold and make none of their own, and
# numba refuses to compile one that would. To count them, by two locked additions for each array of a tuple at each call of an
# inlined function, took half of all that a step costs beside its particles.
#
# Loops are inlined into the kernel that runs them. Otherwise the linker takes whichever version of a callee it saw first, that of
# one kernel or that of another, and two optimizations of one loop may differ in the last bit.
_OPTIONS = {
    "cache": True, "nogil": True, "fastmath": FAST_MATHS, "error_model": "numpy", "forceinline": True, "_nrt": False,
    "no_cfunc_wrapper": True,
}  # fmt: skip


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a kernel: cached on disk, free of the interpreter lock, SIMD where its loop allows.

    Compiled callers get a part of their own: of what Python never calls directly there is no other code.
    """
    kernel = _njit(**_OPTIONS)(function)
    compile_in_turn(kernel)
    twin = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__)
    update_wrapper(twin, function).__qualname__ += ".part"
    part = _part(twin, OptimizedPartCompiler)
    kernel.get_call_template, kernel.get_overload = part.get_call_template, part.get_overload
    return kernel


def inner(function: Callable[..., Any]) -> Any:
    """Compile a part of kernels that only compiled code calls, and inlines.

    Raises:
        TypeError: when Python calls it.
    """
    return _part(function, PartCompiler)


def outlined(function: Callable[..., Any]) -> Any:
    """As ``inner``, but called: for what is long and stands in several places, or at an episode's beginning.

    To inline all of it takes the compiler longer. Not for what each step hands the ``worlds``: a call copies all their fields.
    """
    return _part(function, PartCompiler, forceinline=False)


def _part(function: Callable[..., Any], compiler: type[PartCompiler], **options: Any) -> Any:
    part = _njit(**{**_OPTIONS, **options}, no_cpython_wrapper=True, pipeline_class=compiler)(function)

    def register(result: Any) -> None:  # for callers that are compiled; not in the table of calls from Python
        part.overloads[tuple(result.signature.args)] = result

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise TypeError(f"{function.__name__} is a part of compiled kernels; to call it from Python, decorate it with @compiled")

    compile_in_turn(part)
    part.add_overload = register
    part._compile_for_args = refuse
    return part
