"""The journal of a mission at sea as a log, so that it can be replayed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tagtrack.envs.task import parse_overrides
from tagtrack.live.journal import JOURNAL_FILE, read_events
from tagtrack.live.mission_log import MissionLog, Navigation, Reading
from tagtrack.live.steer import handle, prepare, read_header


def find_journal(given: Sequence[str]) -> Path | None:
    """The folder of a mission, where a log is one."""
    folder = Path(given[0])
    return folder if len(given) == 1 and (folder / JOURNAL_FILE).is_file() else None


def tell_journal(folder: Path) -> dict[str, Any]:
    """What a mission says of itself, as ``mission.json`` of a recorded episode does."""
    asked = read_header(folder)
    overrides = parse_overrides([text for group in asked["set"] for text in group], None)
    if asked["filter"] is not None:
        overrides["belief"] = asked["filter"]
    told = {"env": asked["env"], "overrides": overrides, "tags": asked["tags"], "seed": asked["seed"] or 0}
    return told if asked["particles"] is None else {**told, "particles": asked["particles"]}


def read_journal(folder: Path) -> MissionLog:
    """What vehicle and receiver said, as far as it counted, at the times that it counted for. Raises ValueError."""
    asked = read_header(folder)
    helm, _, _ = prepare(asked)
    helm.accepted = []
    navigation: dict[float, Navigation] = {}
    for event in read_events(folder / JOURNAL_FILE):
        if "from" not in event:
            continue
        fixes = helm.fixes
        handle(helm, event["from"], event["line"].encode("latin-1"), float(event["t"]))
        if helm.fixes > fixes and helm.tracker is not None:
            pose, conventions = helm.tracker.pose, helm.tracker.conventions
            place, heading = conventions.place_out(pose.x, pose.y), conventions.heading_out(pose.heading)
            navigation[helm.time_of_last_fix] = Navigation(helm.time_of_last_fix, *place, heading, pose.speed)
    if not navigation or helm.tracker is None:
        raise ValueError(f"{folder} holds no navigation that was understood")
    readings = [
        Reading(ping.t, ping.tag, ping.heard, ping.arrival, ping.depth, tuple(ping.values.items())) for ping in helm.accepted
    ]
    fixes_in_order = tuple(navigation[t] for t in sorted(navigation))
    heard = tuple(sorted(dict.fromkeys(readings), key=lambda row: (row.t, row.tag)))
    in_degrees = helm.tracker.conventions.origin is not None
    return MissionLog(fixes_in_order, heard, in_degrees, {"headings": helm.tracker.conventions.headings})
