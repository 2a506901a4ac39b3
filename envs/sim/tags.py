"""When the true tags ping, and what else is true of a tagged fish for an episode."""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import PING, START, uniform_pair
from tagtrack.envs.motions.motion import MEMORY
from tagtrack.envs.sensors.sensor import DRAWS

# Per tag: its first ping, its last, the one before that and its next one [s], how many there were, and whether it has `pinged` in
# this step; the depth at which its fish swims [m]; what the sensor draws for the episode (`Sensor.draws`), and what the path of
# the fish remembers.
TARGET = np.dtype(
    [(name, np.float64) for name in ("first_ping", "last_ping", "previous_ping", "next_ping", "depth")]
    + [("pings", np.int64), ("pinged", np.bool_), ("drawn", np.float64, (DRAWS,)), ("memory", np.float64, (MEMORY,))]
)


@compiled
def start_pinging(target, stream, t, tag):
    """Tags do not know when an episode begins."""
    phase, _ = uniform_pair(stream, START, 16 * t + 5)
    target.first_ping = phase * (tag.period + tag.random_delay)
    target.next_ping = target.first_ping
    target.last_ping = -1.0
    target.previous_ping = -1.0
    target.pings = 0
    target.pinged = False


@compiled
def ping_within(target, stream, t, tag, time, time_step):
    """Whether a tag pings within (time, time + time_step]; ``target.last_ping`` tells when it last did.

    Each random wait is keyed by the number of its ping, not by the step: the tag pings the same whatever the time step.
    """
    if tag.random_delay == 0.0:
        pings = math.floor((time + time_step - target.first_ping) / tag.period)
        if pings <= math.floor((time - target.first_ping) / tag.period):
            return False
        target.last_ping = target.first_ping + pings * tag.period
        target.previous_ping = target.last_ping - tag.period if pings > 0 else -1.0
        target.next_ping = target.last_ping + tag.period
        return True
    pinged = False
    k0, k1, episode, _ = stream
    while target.next_ping <= time + time_step:
        target.previous_ping = target.last_ping
        target.last_ping = target.next_ping
        target.pings += 1
        wait, _ = uniform_pair((k0, k1, episode, np.uint64(target.pings)), PING, t)
        target.next_ping += tag.period + tag.random_delay * wait
        pinged = True
    return pinged
