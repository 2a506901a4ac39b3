"""Checks of parameters at the edge: one line that names the value and what is allowed."""

from __future__ import annotations

import dataclasses
import math
from typing import Any


def settle_numbers(parameters: Any) -> None:
    """Turn every field declared float into a finite float (so that 2 and 2.0 are one scenario)."""
    for field in dataclasses.fields(parameters):
        if field.type not in ("float", float):
            continue
        name = f"{type(parameters).__name__}.{field.name}"
        value = getattr(parameters, field.name)
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise ValueError(f"{name} must be a number, got {value!r}") from None
        if not math.isfinite(number):
            raise ValueError(f"{name} must be finite, got {number}")
        object.__setattr__(parameters, field.name, number)


def require(condition: bool, parameters: Any, name: str, rule: str) -> None:
    """Raise ``ValueError("Tag.period must be positive, got -2.0")`` unless the condition holds."""
    if not condition:
        raise ValueError(f"{type(parameters).__name__}.{name} must be {rule}, got {getattr(parameters, name)}")
