"""Parameters on their way into compiled code: a frozen dataclass becomes a numpy record with the same field names.

Kernels read ``parameters.vehicle.max_speed`` as Python code does; numbers stay float64, flags and enumerations int64, so that
no choice of values ever makes numba compile again.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np


def record_type(parameters: Any) -> np.dtype:
    """Structured dtype of a dataclass instance of numbers, flags, enumerations, tuples of numbers and such dataclasses."""
    fields = []
    for field in dataclasses.fields(parameters):
        value = getattr(parameters, field.name)
        if dataclasses.is_dataclass(value):
            fields.append((field.name, record_type(value)))
        elif isinstance(value, tuple):
            kind = np.int64 if value and all(isinstance(each, int) for each in value) else np.float64
            fields.append((field.name, np.dtype((kind, len(value)))))
        else:
            fields.append((field.name, np.dtype(np.int64 if isinstance(value, int) else np.float64)))
    return np.dtype(fields)


def to_record(parameters: Any) -> np.ndarray:
    """One-element structured array of a dataclass instance."""
    record = np.zeros(1, record_type(parameters))
    _fill(record[0], parameters)
    return record


def _fill(record: Any, parameters: Any) -> None:
    for field in dataclasses.fields(parameters):
        value = getattr(parameters, field.name)
        if dataclasses.is_dataclass(value):
            _fill(record[field.name], value)
        else:
            record[field.name] = value
