"""What all models that a task is made of have in common: parameters that compiled code reads, and who reads which.

A model (a motion, a sensor, a term of the reward) is a frozen dataclass of parameters with functions in agreed signatures. The
world draws from one object and a belief scores with another: give the two different parameters and you have an experiment on
model mismatch. A parameter that only one of the two reads is refused in the other, never ignored.
"""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType
from typing import Any, ClassVar

from tagtrack.envs.kernels.calling import ROW
from tagtrack.envs.validation import guess

TRUTH, BELIEF = "the truth", "a belief"


def read_by(side: str, default: Any) -> Any:
    """A field that only the truth, or only a belief, reads."""
    return dataclasses.field(default=default, metadata={"read_by": side})


class Model:
    """Base of all models. Subclasses are frozen keyword-only dataclasses."""

    name: ClassVar[str] = ""  # by which command lines know it; empty: by MODULE:CLASS alone

    def row(self) -> tuple[float, ...]:
        """The parameters as compiled code reads them: numbers, flags and enumerations in the order of the fields."""
        return tuple(float(getattr(self, field.name)) for field in dataclasses.fields(self))  # type: ignore[arg-type]

    def padded_row(self) -> tuple[float, ...]:
        """The row at the length that all models share. Raises ValueError for more parameters than travel."""
        row = self.row()
        if len(row) > ROW:
            raise ValueError(f"{type(self).__name__} has {len(row)} parameters, at most {ROW} travel to compiled code")
        return row + (0.0,) * (ROW - len(row))

    def unread(self, side: str) -> Mapping[str, str]:
        """Parameters that one side does not read, each with the reason."""
        fields = dataclasses.fields(self)  # type: ignore[arg-type]
        other = {field.name: field.metadata["read_by"] for field in fields if "read_by" in field.metadata}
        return {name: f"only {reader} reads it" for name, reader in other.items() if reader != side}


def find_model(text: str, known: Mapping[str, type[Any]], kinds: tuple[type[Any], ...], parameter: str) -> Any:
    """A model by its name among the ``known``, or by ``MODULE:CLASS`` from a file of the user's own; at its defaults.

    Raises:
        ValueError: for an unknown name, a module or class that is not there, or one of another kind, naming the ``parameter``.
    """
    if text in known:
        return known[text]()
    if ":" not in text:
        choice = f"one of {', '.join(known)}, or " if known else ""
        near = guess(text, known)
        raise ValueError(f"{parameter} must be {choice}MODULE:CLASS of your own, got {text!r}{near and f'; {near.rstrip()}'}")
    model = import_object(text)
    if not (isinstance(model, type) and issubclass(model, kinds)):
        names = " or ".join(f"{kind.__module__}.{kind.__name__}" for kind in kinds)
        raise ValueError(f"{parameter}: {text} must be a class derived from {names}, got {model!r}")
    return model()


def import_own(module: str) -> ModuleType:
    """A module of the user's. It may lie in the working folder, where ``python -m`` looks and a console command does not."""
    here = os.getcwd()
    if not {"", here} & set(sys.path):
        sys.path.append(here)
    return import_module(module)


def import_object(name: str) -> Any:
    """What ``MODULE:OBJECT`` names. Raises ValueError where it cannot be imported."""
    module_name, _, attribute = name.partition(":")
    try:
        module = import_own(module_name)
    except ImportError as error:
        raise ValueError(f"{name!r}: cannot import {module_name!r} ({error}); run where it lies, or set PYTHONPATH") from None
    if not hasattr(module, attribute):
        raise ValueError(f"{name!r}: {module_name} has no {attribute!r}")
    return getattr(module, attribute)
