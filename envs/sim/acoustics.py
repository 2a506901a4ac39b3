"""Water and hearing: which pings reach a receiver, and what a vehicle keeps of them.

Hearing falls off about L = 100 m, and losses come in bursts (weed, bubbles, the hull's own noise), so that the rate of usable
signals ranges over some 3 to 25 a minute and gaps reach 30 s (Clark et al. 2013, 6.2; Lin et al. 2013, III.B): with the defaults
a minute has 23 (median; 1 % of them 2 or fewer), and the longest gap of ten minutes is 38 s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import HEARING, START, WATER, normal_pair, uniform_pair
from tagtrack.envs.sim.readings import presence_chance, read_range, read_stereo, read_time_of_flight
from tagtrack.envs.sim.receivers import ReceiverKind
from tagtrack.envs.sim.validation import require, settle_numbers


@dataclass(frozen=True, kw_only=True)
class Water:
    """How well sound carries from tag to hydrophone."""

    reach: float = 100.0  # L: distance at which hearing has fallen to half [m]
    edge_width: float = 8.0  # scale of the logistic fall-off about it [m]
    clear_hearing: float = 0.93  # chance that one hydrophone hears a near ping in clear water
    noisy_hearing: float = 0.15  # the same within a burst of losses
    noisy_share: float = 0.2  # share of time within bursts: how bad the water is, from 0 to 1
    noisy_duration: float = 20.0  # mean duration of a burst [s]

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("reach", "edge_width", "noisy_duration"):
            require(getattr(self, name) > 0, self, name, "positive")
        for name in ("clear_hearing", "noisy_hearing", "noisy_share"):
            require(0 <= getattr(self, name) <= 1, self, name, "within 0 to 1")


# What one vehicle hears of one tag. `units` [Lotek], `strength` and `slant_range` [m] are the last reading, NaN before the
# first, `previous_range` the one before; `silence` is the time since the last [s]; `noisy` tells a burst of losses; `missed` that
# a ping was not heard, or that a silence has just become certain to have swallowed one, and `surely_by` the time by which the
# next one will have come for certain [s]; `heard_lately` and `heard_long` are averages of detections over pings, `port` the share
# of particles to port, `cos_lately` and `sin_lately` averages of the belief's bearing relative to the heading. The vehicle knows
# the `depth` of the fish [m], not the `clock_error` by which this receiver takes a ping of this tag for later than it was [s].
CONTACT = np.dtype(
    [(name, np.bool_) for name in ("pinged", "detected", "missed", "noisy")]
    + [
        (name, np.float64)
        for name in (
            "units", "strength", "slant_range", "previous_range", "range", "depth", "clock_error", "silence", "surely_by",
            "heard_lately", "heard_long", "port", "cos_lately", "sin_lately",
        )
    ]
)  # fmt: skip


@compiled
def open_contact(contact, target, stream, index, water, receiver, longest_interval):
    """A contact before the first ping."""
    chance, _ = uniform_pair(stream, START, 16 * index + 2)
    contact.pinged = False
    contact.detected = False
    contact.missed = False
    contact.noisy = chance < water.noisy_share
    contact.units = np.nan
    contact.strength = np.nan
    contact.slant_range = np.nan
    contact.previous_range = np.nan
    drift, _ = normal_pair(stream, START, 16 * index + 8)
    contact.clock_error = receiver.clock_sigma * drift
    contact.depth = target.depth
    contact.silence = 0.0
    contact.surely_by = longest_interval
    contact.heard_lately = 0.5
    contact.heard_long = 0.5
    contact.cos_lately = 0.0
    contact.sin_lately = 0.0


@compiled
def change_water(contact, stream, index, water, time_step):
    """Bursts begin and end without memory (a Gilbert-Elliott channel)."""
    chance, _ = uniform_pair(stream, WATER, index)
    leave = min(1.0, time_step / water.noisy_duration)
    enter = leave * water.noisy_share
    stay_clear = 1.0 - water.noisy_share
    if enter > stay_clear:  # clear spells would be shorter than a step: one step each, and longer bursts, keep the share
        leave = stay_clear / water.noisy_share
        enter = stay_clear
    contact.noisy = chance >= leave if contact.noisy else chance * stay_clear < enter


@compiled
def hearing_chance(distance, noisy, water):
    """Chance that one hydrophone hears a ping."""
    near = water.noisy_hearing if noisy else water.clear_hearing
    return near / (1.0 + math.exp(min((distance - water.reach) / water.edge_width, 50.0)))


@compiled
def hear(contact, target, distance, stream, index, water, receiver):
    """Whether a ping is usable: a bearing needs both hydrophones, the others have one."""
    bow, stern = uniform_pair(stream, HEARING, index)
    if receiver.kind == ReceiverKind.STEREO or receiver.kind == ReceiverKind.TIME_OF_FLIGHT:
        chance = hearing_chance(contact.range, contact.noisy, water)
        return bow < chance and stern < chance
    chance = hearing_chance(distance, contact.noisy, water)
    if receiver.kind == ReceiverKind.PRESENCE:
        chance *= presence_chance(distance, target.max_range, target.reception, receiver)
    return bow < chance


@compiled
def count_silence(contact, last_ping, time, longest_interval):
    """Silence tells something only when a ping was certainly due. Returns whether this step told anything, either way.

    Of a tag with random intervals a vehicle knows nothing but their bounds, and of its pings only those it has heard. Any stretch
    of ``longest_interval`` holds a ping: so one was missed for certain each time that so long has passed since the last detection
    (whose time the receiver logs), since the last such silence, or since the episode began. What a part of such a stretch makes
    likely is left out, as is that the ping came some while before it was certain: the silence counts where the vehicle is then.
    """
    contact.missed = False
    if contact.detected:
        contact.surely_by = last_ping + longest_interval
    elif time >= contact.surely_by - 1e-9:
        contact.missed = True
        contact.surely_by += longest_interval
    return contact.detected or contact.missed


@compiled
def listen(contact, vehicle, target, fish_x, fish_y, pinged, stream, index, tag, water, receiver, time, time_step):
    """Advance the water to ``time``; hear a ping of the step before it or not; read what the receiver gives."""
    change_water(contact, stream, index, water, time_step)
    dx = fish_x - vehicle.x
    dy = fish_y - vehicle.y
    contact.range = math.sqrt(dx * dx + dy * dy)
    distance = math.sqrt(dx * dx + dy * dy + contact.depth * contact.depth)
    contact.pinged = pinged
    contact.detected = pinged and hear(contact, target, distance, stream, index, water, receiver)
    contact.missed = pinged and not contact.detected
    contact.silence += time_step
    told = pinged
    if receiver.kind == ReceiverKind.PRESENCE:
        told = count_silence(contact, target.last_ping, time, tag.period + tag.random_delay)
    if told:
        heard = 1.0 if contact.detected else 0.0
        contact.heard_lately += 0.2 * (heard - contact.heard_lately)
        contact.heard_long += 0.03 * (heard - contact.heard_long)
    if contact.detected:
        contact.silence = 0.0
        if receiver.kind == ReceiverKind.STEREO:
            read_stereo(contact, vehicle, fish_x, fish_y, stream, index, receiver)
        elif receiver.kind == ReceiverKind.RANGE:
            read_range(contact, distance, stream, index, receiver)
        elif receiver.kind == ReceiverKind.TIME_OF_FLIGHT:
            read_time_of_flight(contact, vehicle, fish_x, fish_y, distance, target, stream, index, tag, receiver)
