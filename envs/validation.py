"""Checks of what is handed in, at the edge: one line that names the value and what is allowed."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

import numpy as np

LARGEST = 1e6  # of a parameter: 1,000 km, 11 days. Beyond it float32 ends sooner or later, and no sea does
FASTEST = 100.0  # of speeds and their spreads [m/s]
MANY = 24  # names that one still reads through


def unknown(what: str, name: Any, known: Iterable[str], *, of: str = "") -> ValueError:
    """The error for a name that there is not: those like it, and what there is; of many dotted names those of their groups."""
    names = list(known)
    near = _near(name, names)
    heads = {each.partition(".")[0] for each in (str(name), *near)}
    group = [each for each in names if each.partition(".")[0] in heads] if len(names) > MANY else []
    listed = f"{', '.join(group)} ({len(names)} in all)" if group else ", ".join(names)
    return ValueError(f"unknown {what} {name!r}{of and f' of {of}'}; {guess(name, names)}known: {listed}")


def guess(name: Any, known: Iterable[str]) -> str:
    """Words on what a wrong name may have meant; none where nothing is like it."""
    near = _near(name, known)
    return f"did you mean {' or '.join(near)}? " if near else ""


def _near(name: Any, known: Iterable[str]) -> list[str]:
    short = {each.rpartition("/")[2].lower(): each for each in known}  # namespaces are alike in all
    return [short[each] for each in get_close_matches(str(name).rpartition("/")[2].lower(), short, n=2)]


def settle_numbers(parameters: Any, **largest: float) -> None:
    """Turn every field declared float into a finite float (so that 2 and 2.0 are one scenario).

    Args:
        largest: limits by field, where they are narrower than that of all, ``LARGEST``; signs do not count.
    """
    for field in dataclasses.fields(parameters):
        if field.type not in ("float", float):
            continue
        name = f"{type(parameters).__name__}.{field.name}"
        value = getattr(parameters, field.name)
        most = largest.get(field.name, LARGEST)
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise ValueError(f"{name} must be a number, got {brief(value)}") from None
        except OverflowError:
            raise ValueError(f"{name} must be at most {most:g} in size, got a number of hundreds of digits") from None
        if not math.isfinite(number):
            raise ValueError(f"{name} must be finite, got {number}")
        if abs(number) > most:
            raise ValueError(f"{name} must be at most {most:g} in size, got {number:g}")
        object.__setattr__(parameters, field.name, number)


def require(condition: bool, parameters: Any, name: str, rule: str) -> None:
    """Raise ``ValueError("Tag.period must be positive, got -2.0")`` unless the condition holds."""
    if not condition:
        raise ValueError(f"{type(parameters).__name__}.{name} must be {rule}, got {getattr(parameters, name)}")


def as_actions(actions: Any) -> np.ndarray:
    """Actions as float32, of at least one axis; what is no number in float32 becomes an infinity, which the simulation refuses.

    Raises:
        ValueError: for what is no array of real numbers: None, texts, dictionaries, complex numbers, dates, rows of two lengths.
    """
    if type(actions) is np.ndarray and actions.dtype == np.float32 and actions.ndim:
        return actions
    try:
        found = np.asarray(actions)
    except (TypeError, ValueError):
        found = np.array(None)
    if found.dtype.kind not in "fiub":
        raise ValueError(f"actions must be an array of numbers, got {brief(actions)}")
    with np.errstate(over="ignore"):
        return np.atleast_1d(found.astype(np.float32))


def whole_number(value: Any, name: str) -> int:
    """The value, of any kind of integer. Raises ValueError for True, 1.5 and all else."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise ValueError(f"{name} must be a whole number, got {brief(value)}")
    return int(value)


def brief(value: Any) -> str:
    """A value as an error message shows it: on one line, and not all of a long one."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else text[:80] + "..."
