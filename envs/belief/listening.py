"""What a listener remembers, from measurements alone: how long it has been silent, how much is heard, when a ping is due.

Silence tells something only when a ping was certainly due. Any stretch of the tag's longest interval holds one, so that one was
missed for certain each time that so long has passed since the last ping heard (whose time the receiver logs), since the last such
silence, or since the beginning; with a fixed period that is each time the tag pings, once it was heard. What a part of such a
stretch makes likely is left out, as is that the ping came some while before it was certain: the silence counts where the vehicle
is then.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.measurement import READINGS, Status

UNKNOWN_PHASE = -1.0  # of a tag at a fixed period that was never heard


@inner
def begin_listening(listener, time, longest_interval):
    """Nothing was heard yet."""
    listener.status = Status.NOTHING
    listener.silence = 0.0
    listener.arrival = np.nan
    listener.surely_by = time + longest_interval
    listener.heard_lately = 0.5
    listener.heard_long = 0.5
    listener.depth = 0.0
    for k in range(READINGS):
        listener.readings[k] = np.nan
        listener.previous[k] = np.nan


@inner
def note(listener, measurement, longest_interval):
    """Take up a measurement; ``listener.status`` afterwards says whether a ping was heard, surely missed, or neither."""
    heard = measurement.status == Status.HEARD
    missed = measurement.status == Status.MISSED
    if heard:
        listener.arrival = measurement.time if math.isnan(measurement.arrival) else measurement.arrival
        listener.surely_by = listener.arrival + longest_interval
        listener.silence = 0.0
        for k in range(READINGS):
            listener.previous[k] = listener.readings[k]
            listener.readings[k] = measurement.readings[k]
    elif measurement.time >= listener.surely_by - 1e-9:
        missed = True
        while listener.surely_by <= measurement.time + 1e-9:
            listener.surely_by += longest_interval
    listener.status = Status.HEARD if heard else Status.MISSED if missed else Status.NOTHING
    listener.depth = measurement.depth
    if heard or missed:
        share = 1.0 if heard else 0.0
        listener.heard_lately += 0.2 * (share - listener.heard_lately)
        listener.heard_long += 0.03 * (share - listener.heard_long)


@compiled
def ping_phase(listener, time, period, random_delay):
    """How far the interval between two pings has run, of random intervals how far until a ping has come for certain; 0 to 1.

    Of a tag at a fixed period that was never heard nobody knows: ``UNKNOWN_PHASE``.
    """
    if random_delay > 0.0:
        return min(max(1.0 - (listener.surely_by - time) / (period + random_delay), 0.0), 1.0)
    if math.isnan(listener.arrival):
        return UNKNOWN_PHASE
    since_ping = (time - listener.arrival) / period
    return since_ping - math.floor(since_ping)


@inner
def get_to_know(mate, pose, time):
    """A teammate is where it says it was at a time."""
    mate.known = True
    mate.time = time
    mate.x = pose.x
    mate.y = pose.y
    mate.heading = pose.heading
    mate.speed = pose.speed
