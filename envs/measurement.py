"""The wall: what passes from the world to a belief, and nothing else does.

A measurement may come from the simulated water, a file, a serial line or a teammate's message; the belief cannot tell. It holds
no truth: its pose is what the vehicle believed of itself at that moment, and what was not measured is NaN. What a listener
remembers (``LISTENER``) follows from measurements alone.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence

import numpy as np


class Status(enum.IntEnum):
    """What a measurement tells."""

    ABSENT = 0  # there is no record
    NOTHING = 1  # the receiver listened and heard nothing; whether a ping was due is for the listener to know
    HEARD = 2
    MISSED = 3  # a ping was surely there and not heard: the tag was asked and did not answer


READINGS = 4  # numbers that a sensor may read of one ping

# What a vehicle knows of itself: where it believes to be [m], heading by the compass [rad], speed through the water [m/s]; the
# share of its battery that is left, and whether it still takes part.
NAVIGATION = np.dtype([(name, np.float64) for name in ("x", "y", "heading", "speed", "battery")] + [("active", np.bool_)])

# One vehicle, one tag, one time [s]. `x`, `y`, `heading` as in NAVIGATION at that time; `depth` of the tag below the vehicle,
# which it knows [m]; `arrival` is when the ping came by the receiver's clock [s], NaN where none did; `readings` are the
# sensor's own.
MEASUREMENT = np.dtype(
    [("time", np.float64)]
    + [(name, np.int64) for name in ("vehicle", "tag", "status")]
    + [(name, np.float64) for name in ("x", "y", "heading", "depth", "arrival")]
    + [("readings", np.float64, (READINGS,))]
)

# What one vehicle remembers of listening for one tag. `status` of the latest measurement, MISSED also where a silence has just
# become certain to have swallowed a ping; `silence` since the last detection, or since the beginning [s]; `arrival` of the last
# ping heard, NaN before; `surely_by` the time by which the next one will have come for certain [s]; `heard_lately` and
# `heard_long` are averages of detections over pings; `readings` the last ones and `previous` those before, NaN where none were.
LISTENER = np.dtype(
    [("status", np.int64)]
    + [(name, np.float64) for name in ("silence", "arrival", "surely_by", "heard_lately", "heard_long", "depth")]
    + [("readings", np.float64, (READINGS,)), ("previous", np.float64, (READINGS,))]
)


def measurement(
    *,
    time: float,
    x: float,
    y: float,
    heading: float = 0.0,
    vehicle: int = 0,
    tag: int = 0,
    depth: float = 0.0,
    status: Status = Status.HEARD,
    arrival: float = math.nan,
    readings: Sequence[float] = (),
) -> np.ndarray:
    """One measurement, (1,) of ``MEASUREMENT``; ``np.concatenate`` joins several. Units are those of the fields."""
    if len(readings) > READINGS:
        raise ValueError(f"a measurement holds at most {READINGS} readings, got {len(readings)}")
    row = np.zeros(1, MEASUREMENT)
    values = (time, vehicle, tag, int(status), x, y, heading, depth, arrival)
    for name, value in zip(MEASUREMENT.names or (), values, strict=False):
        row[name] = value
    row["readings"] = np.nan
    row["readings"][0, : len(readings)] = readings
    return row
