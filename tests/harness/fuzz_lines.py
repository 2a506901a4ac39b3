"""Lines of instruments that a bad cable has changed, and journals of missions that a bad disk has."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from hypothesis import strategies as st

from tagtrack.live.journal_log import read_journal, tell_journal
from tagtrack.live.lines import BadLine
from tagtrack.live.receivers import RECEIVERS, Heard
from tagtrack.live.steer import ASKED, DEFAULTS, FORMAT
from tagtrack.live.vehicles import Goby, Iver, JsonVehicle
from tests.harness.fuzz_files import SHARK, edited, edited_json, edits, json_edits, place, refused, written

READERS = {
    **{name: kind() for name, kind in RECEIVERS.items()},
    "goby": Goby(),
    "iver": Iver(),
    "json vehicle": JsonVehicle(),
}
LINES = [
    *(RECEIVERS[name]().write(Heard(1.6e9 + 0.25, "1285"), 7) for name in RECEIVERS),
    b"$OSI,1,2*00\r\n", b'{"t": 1, "x": 2, "y": 3, "heading": 90, "speed": 1}\n',
    b"AUV1,NAV_X=1,NAV_Y=2,NAV_HEADING=90,NAV_SPEED=1\n",
]  # fmt: skip


def try_line(asked: tuple[str, bytes, list[tuple[float, int, bytes]]]) -> None:
    name, line, changes = asked
    try:
        found = READERS[name].read(edited(line, changes).strip(b"\r\n"))
    except BadLine as error:
        assert "\n" not in str(error)
        return
    for each in found if isinstance(found, list) else [found]:
        told = [value for value in vars(each).values() if isinstance(value, float)] if each is not None else []
        assert np.isfinite(told).all()


lines = st.tuples(st.sampled_from(list(READERS)), st.sampled_from(LINES), edits)

MISSION = {name: None for name in ASKED} | DEFAULTS | {
    "env": SHARK, "policy": "pursuit", "receiver": "json:stdin", "vehicle": "json:tcp:localhost:5000", "tags": ["7"], "set": [],
    "particles": 20,
}  # fmt: skip
EVENTS = [
    {"format": FORMAT, "mission": MISSION},
    {"t": 0.0, "from": "vehicle", "line": '{"t": 0, "x": 0, "y": 0, "heading": 90, "speed": 1}'},
    {"t": 2.0, "from": "receiver", "line": '{"t": 2, "tag": "7", "bearing_units": -3, "strength": 40}'},
    {"t": 2.1, "to": "vehicle", "line": '{"course": 90, "speed": 1}'},
    {"t": 4.0, "from": "vehicle", "line": '{"t": 4, "x": 4, "y": 0, "heading": 90, "speed": 1}'},
]


def try_journal(asked: tuple[list[tuple[int, str, Any]], list[tuple[float, int, bytes]]]) -> None:
    changes, bytes_changed = asked
    if changes:
        content = "".join(json.dumps(event) + "\n" for event in json.loads(edited_json(EVENTS, changes))).encode()
    else:
        content = edited("".join(json.dumps(event) + "\n" for event in EVENTS).encode(), bytes_changed)
    written("journal.jsonl", content)
    refused(lambda: tell_journal(place()))
    refused(lambda: read_journal(place()))


journals = st.tuples(st.just([]) | json_edits, edits)

LINE_KINDS = {"lines": (try_line, lines), "journals": (try_journal, journals)}
