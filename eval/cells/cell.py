"""A cell: a function and what it is given, which alone decide what it gives back, wherever and whenever it runs.

It travels as bytes. Those bytes, together with the code and the versions that would run them, also name its result on the disk
(``kept.py``): equal bytes are equal work.
"""

from __future__ import annotations

import io
import pickle
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import BuiltinFunctionType, FunctionType
from typing import Any, NamedTuple

Tell = Callable[[int], None]  # units that were just done

# Whose code the sum over ours and the versions of packages account for; a user's own module may change without a trace.
ACCOUNTED = {*sys.stdlib_module_names, "tagtrack", "numpy", "torch", "gymnasium", "stable_baselines3", "scipy", "filterpy"}


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One part of the work.

    ``function`` is one of a module, called with ``arguments`` and ``tell``, to which it reports ``units`` in all.
    """

    name: str  # for the progress bar
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    units: int

    def run(self, tell: Tell) -> Done:
        """Do the work, here and now."""
        begun = time.perf_counter()
        value = self.function(*self.arguments, tell=tell)
        return Done(value, time.perf_counter() - begun)


class Done(NamedTuple):
    """What a cell gave back, and the time it took [s]."""

    value: Any
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Parcel:
    """A cell as it travels."""

    content: bytes
    own_code: bool  # a user's own module takes part

    def run(self, tell: Tell) -> Done:
        """Unpack and do the work."""
        cell: Cell = pickle.loads(self.content)
        return cell.run(tell)


def pack(cell: Cell) -> Parcel:
    """Raises ValueError for what cannot travel, such as a function within a function."""
    content = io.BytesIO()
    packer = _Packer(content, protocol=5)
    try:
        packer.dump(cell)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        way = "run it in this one, or move what it is made of to a module"
        raise ValueError(f"{cell.name} cannot be sent to another process ({error}); {way}") from None
    return Parcel(content=content.getvalue(), own_code=packer.own_code)


class _Packer(pickle.Pickler):
    """Notes whether anything comes from a module that is not accounted for."""

    own_code = False

    def persistent_id(self, part: Any) -> None:
        named = part if isinstance(part, (type, FunctionType, BuiltinFunctionType)) else type(part)
        module = getattr(named, "__module__", None) or "builtins"
        if module.partition(".")[0] not in ACCOUNTED:
            self.own_code = True
