"""Lines of instruments: what is wrong with one, and checksums."""

from __future__ import annotations

import functools
import json
import math
import operator
import re
from typing import Any

LONGEST_LINE = 1024  # bytes; what is longer is no line of ours
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


class BadLine(ValueError):
    """A line that is not understood: it is counted by its reason, and nothing follows from it."""


def text_of(line: bytes) -> str:
    """A line as text. Raises BadLine for bytes that no instrument sends."""
    try:
        text = line.decode("ascii")
    except UnicodeDecodeError:
        raise BadLine("foreign bytes") from None
    if not text.isprintable():
        raise BadLine("foreign bytes")
    return text


def number(value: Any, what: str, *, least: float = -math.inf, most: float = math.inf) -> float:
    """A finite number within bounds, of a text or of JSON. Raises BadLine."""
    if isinstance(value, str):
        if not _NUMBER.fullmatch(value.strip()):
            raise BadLine(f"{what} is no number")
    elif isinstance(value, bool) or not isinstance(value, (int, float)):
        raise BadLine(f"{what} is no number")
    try:
        found = float(value)
    except OverflowError:
        found = math.inf
    if not (math.isfinite(found) and least <= found <= most):
        raise BadLine(f"{what} out of range")
    return found


def xor(text: str) -> int:
    """The checksum of NMEA 0183: all bytes between $ and * by exclusive or."""
    return functools.reduce(operator.xor, text.encode("ascii"), 0)


def nmea(body: str) -> bytes:
    """A sentence with its checksum and line end; ``body`` goes between $ and *."""
    return f"${body}*{xor(body):02X}\r\n".encode("ascii")


def open_nmea(text: str) -> str:
    """What stands between $ and *. Raises BadLine for a missing or wrong checksum."""
    body, star, check = text[1:].partition("*")
    if not text.startswith("$") or not star:
        raise BadLine("no checksum")
    if len(check) != 2 or check.upper() != f"{xor(body):02X}":
        raise BadLine("wrong checksum")
    return body


def object_of(line: bytes) -> dict[str, Any]:
    """A line of JSON. Raises BadLine unless it is an object."""
    try:
        found = json.loads(line.decode("utf-8"))
    except (ValueError, RecursionError):
        raise BadLine("no JSON") from None
    if not isinstance(found, dict):
        raise BadLine("no JSON object")
    return found
