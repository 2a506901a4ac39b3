"""At sea: the filter and a policy on measurements of real receivers and vehicles, live or from the log of a mission."""

from __future__ import annotations

from typing import Any

__all__ = ["Command", "Conventions", "Estimate", "Tracker"]


def __getattr__(name: str) -> Any:  # the command line must answer --help before numba has loaded
    if name in ("Command", "Estimate", "Tracker"):
        from tagtrack.live import tracker

        return getattr(tracker, name)
    if name == "Conventions":
        from tagtrack.live.conventions import Conventions

        return Conventions
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
