"""What is measured in the field: receivers on moorings, files of telemetry, the clock of a tag.

The chain of `tagtrack eval array` as functions: ``read_detections``, ``synchronize`` and ``correct`` for raw clocks,
``locate_tags``.
The names below load their modules when they are first asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tagtrack.envs.lazy import lazily

if TYPE_CHECKING:
    from tagtrack.eval.field.array.chain import Averaging, Locating, locate_tags
    from tagtrack.eval.field.array.located import Located
    from tagtrack.eval.field.array.sound import read_sound_speed
    from tagtrack.eval.field.static_array.clock_model import correct
    from tagtrack.eval.field.static_array.clocks import SyncSetting, SyncTag, synchronize
    from tagtrack.eval.field.static_array.detections import Detections
    from tagtrack.eval.field.static_array.model import ArraySetting, Pings, Positions
    from tagtrack.eval.field.telemetry import read_detections, read_receivers, read_sync_tags

_HOMES = {
    "array.chain": ("Averaging", "Locating", "locate_tags"),
    "array.located": ("Located",),
    "array.sound": ("read_sound_speed",),
    "static_array.clock_model": ("correct",),
    "static_array.clocks": ("SyncSetting", "SyncTag", "synchronize"),
    "static_array.detections": ("Detections",),
    "static_array.model": ("ArraySetting", "Pings", "Positions"),
    "telemetry": ("read_detections", "read_receivers", "read_sync_tags"),
}

__all__ = [
    "ArraySetting",
    "Averaging",
    "Detections",
    "Located",
    "Locating",
    "Pings",
    "Positions",
    "SyncSetting",
    "SyncTag",
    "correct",
    "locate_tags",
    "read_detections",
    "read_receivers",
    "read_sound_speed",
    "read_sync_tags",
    "synchronize",
]

__getattr__, __dir__ = lazily(__name__, _HOMES)
