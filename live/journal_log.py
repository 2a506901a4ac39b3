"""The journal of a mission at sea as a log, so that it can be replayed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tagtrack.envs.task import parse_overrides
from tagtrack.live.journal import JOURNAL_FILE, read_events
from tagtrack.live.lines import BadLine
from tagtrack.live.mission_log import MissionLog, Navigation, Reading
from tagtrack.live.steer import prepare, read_header


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
    """What vehicle and receiver said, as far as it was understood, at the times that counted. Raises ValueError."""
    asked = read_header(folder)
    helm, _, _ = prepare(asked)
    step = helm.orders.step
    navigation: dict[float, Navigation] = {}
    readings: list[Reading] = []
    for event in read_events(folder / JOURNAL_FILE):
        if "from" not in event:
            continue
        line, now = event["line"].encode("latin-1"), float(event["t"])
        if event["from"] == "vehicle":
            fixes = helm.fixes
            helm.steer(line, now)
            if helm.fixes > fixes and helm.tracker is not None:  # one that counted, in the mission's own words
                pose = helm.tracker.pose
                first, second = helm.tracker.conventions.place_out(pose.x, pose.y)
                heading, speed = helm.tracker.conventions.heading_out(pose.heading), pose.speed
                t = helm.time_of_last_fix
                navigation[t] = Navigation(t, first, second, heading, speed)
            continue
        try:
            pings = helm.receiver.read(line)
        except BadLine:
            continue
        clock = now if step == 0 else step * max(helm.fixes - 1, 0)
        for ping in pings:
            tag = ping.tag if ping.tag in helm.orders.tags else ping.tag.rpartition("-")[2]
            host = helm.orders.stamp == "host" or ping.t is None
            t = clock if host or ping.t is None else ping.t
            readings.append(Reading(t, tag, ping.heard, None if host else ping.arrival, ping.depth, tuple(ping.values.items())))
    if not navigation:
        raise ValueError(f"{folder} holds no navigation that was understood")
    in_degrees = helm.tracker is not None and helm.tracker.conventions.origin is not None
    headings = helm.tracker.conventions.headings if helm.tracker is not None else "nautical"
    fixes_in_order = tuple(navigation[t] for t in sorted(navigation))
    heard = tuple(sorted(dict.fromkeys(readings), key=lambda row: (row.t, row.tag)))
    return MissionLog(fixes_in_order, heard, in_degrees, {"headings": headings})
