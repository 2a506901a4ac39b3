"""At sea: the filter and a policy on measurements of real receivers and vehicles, live or from the log of a mission.

The names below load their modules when they are first asked for: the command line answers --help before numba has loaded.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tagtrack.envs.lazy import lazily

if TYPE_CHECKING:
    from tagtrack.live.conventions import Conventions
    from tagtrack.live.tracker import Command, Estimate, Tracker

_HOMES = {"conventions": ("Conventions",), "tracker": ("Command", "Estimate", "Tracker")}

__all__ = ["Command", "Conventions", "Estimate", "Tracker"]

__getattr__, __dir__ = lazily(__name__, _HOMES)
