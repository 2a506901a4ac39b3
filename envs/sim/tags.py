"""When acoustic tags ping: at a fixed period, or, lest two tags collide for ever, at random intervals (Vemco)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import PING, START, uniform_pair
from tagtrack.envs.sim.validation import require, settle_numbers


@dataclass(frozen=True, kw_only=True)
class Tag:
    """An acoustic tag that pings from a random first ping on. Of several pings within one step the last one counts."""

    period: float = 2.0  # T_c [s]; the leopard shark's tags had 2 s and 5 s
    random_delay: float = 0.0  # a further wait before each ping, uniform from 0 to this [s]; a Vemco V7: 60 s and up to 30 s

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.period > 0, self, "period", "positive")
        require(self.random_delay >= 0, self, "random_delay", "at least 0")

    @property
    def longest_interval(self) -> float:
        """Any stretch of this length [s] holds a ping for certain."""
        return self.period + self.random_delay


# Per tag: its first ping, its last and, where intervals are random, its next one [s] and how many there were; the depth at which
# its fish swims [m], how far and how often a presence receiver hears it in this episode [m; share]. For a replay the row of the
# table at which the episode begins and the one with which its stretch ends, the angle by which the track is turned and the place
# at which the fish starts; for straight legs the time at which the next one begins [s] and how many there were.
TARGET = np.dtype(
    [(name, np.float64) for name in ("first_ping", "last_ping", "next_ping", "depth", "max_range", "reception")]
    + [("pings", np.int64), ("start_row", np.int64), ("turn", np.float64), ("start_x", np.float64), ("start_y", np.float64)]
    + [("end_row", np.int64), ("leg_end", np.float64), ("legs", np.int64)]
)


@compiled
def start_pinging(target, stream, t, tag):
    """Tags do not know when an episode begins."""
    phase, _ = uniform_pair(stream, START, 16 * t + 5)
    target.first_ping = phase * (tag.period + tag.random_delay)
    target.next_ping = target.first_ping
    target.last_ping = -1.0
    target.pings = 0


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
        return True
    pinged = False
    k0, k1, episode, _ = stream
    while target.next_ping <= time + time_step:
        target.last_ping = target.next_ping
        target.pings += 1
        wait, _ = uniform_pair((k0, k1, episode, np.uint64(target.pings)), PING, t)
        target.next_ping += tag.period + tag.random_delay * wait
        pinged = True
    return pinged
