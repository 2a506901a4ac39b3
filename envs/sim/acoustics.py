"""Water and hearing: which pings reach a receiver, and the measurement that a vehicle makes of them.

Hearing falls off about L = 100 m, and losses come in bursts (weed, bubbles, the hull's own noise), so that the rate of usable
signals ranges over some 3 to 25 a minute and gaps reach 30 s (Clark et al. 2013, 6.2; Lin et al. 2013, III.B): with the defaults
a minute has 23 (median; 1 % of them 2 or fewer), and the longest gap of ten minutes is 38 s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.random import HEARING, MOST, OVERLAP, READING, START, WATER, normal_pair, place_of, uniform_pair
from tagtrack.envs.measurement import READINGS, Status
from tagtrack.envs.sensors.sensor import DRAWS, chance_at, read_at
from tagtrack.envs.validation import require, settle_numbers

SOUND_SPEED = 1500.0  # by which transmissions of several tags overlap at a receiver [m/s]


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


@inner
def open_encounter(encounter, stream, index, water, clock_sigma):
    """Before the first ping: the state of the water, and the error of the clocks."""
    chance, _ = uniform_pair(stream, START, 16 * index + 2)
    encounter.noisy = chance < water.noisy_share
    encounter.pinged = False
    encounter.heard = False
    drift, _ = normal_pair(stream, START, 16 * index + 8)
    encounter.clock_error = clock_sigma * drift


@inner
def meet(encounter, vehicle, target, fish_x, fish_y, period):
    """Where vehicle and fish truly are."""
    dx = fish_x - vehicle.x
    dy = fish_y - vehicle.y
    encounter.x = vehicle.x
    encounter.y = vehicle.y
    encounter.heading = vehicle.heading
    encounter.fish_x = fish_x
    encounter.fish_y = fish_y
    encounter.depth = target.depth
    encounter.range = math.sqrt(dx * dx + dy * dy)
    encounter.distance = math.sqrt(dx * dx + dy * dy + target.depth * target.depth)
    encounter.ping = target.last_ping
    encounter.first_ping = target.first_ping
    encounter.period = period
    for k in range(DRAWS):
        encounter.drawn[k] = target.drawn[k]


@inner
def change_water(encounter, stream, index, water, time_step):
    """Bursts begin and end without memory (a Gilbert-Elliott channel)."""
    chance, _ = uniform_pair(stream, WATER, index)
    leave = min(1.0, time_step / water.noisy_duration)
    enter = leave * water.noisy_share
    stay_clear = 1.0 - water.noisy_share
    if enter > stay_clear:  # clear spells would be shorter than a step: one step each, and longer bursts, keep the share
        leave = stay_clear / water.noisy_share
        enter = stay_clear
    encounter.noisy = chance >= leave if encounter.noisy else chance * stay_clear < enter


@compiled
def hearing_chance(distance, noisy, water):
    """Chance that one hydrophone hears a ping."""
    near = water.noisy_hearing if noisy else water.clear_hearing
    return near / (1.0 + math.exp(min((distance - water.reach) / water.edge_width, 50.0)))


@inner
def hear(encounter, stream, index, p):
    """Whether a ping is usable: all the sensor's hydrophones must hear it."""
    bow, stern = uniform_pair(stream, HEARING, index)
    chance = hearing_chance(encounter.distance, encounter.noisy, p.water)
    if p.calls.chance != 0:
        chance *= chance_at(p.calls.chance)(encounter.distance, encounter.drawn[0], encounter.drawn[1], p.sensor[:])
    return bow < chance and (p.hydrophones == 1 or stern < chance)


@inner
def is_destroyed(vehicle, targets, fish, v, t, stream, p):
    """Whether another tag's transmission, loud enough to be heard there, overlaps at a vehicle with the last one of tag ``t``.

    The water, and where the fish are, count as they are now; a ping to come is known already, for each wait is drawn at the one
    before.
    """
    came = targets[t].last_ping + slant_range(vehicle, targets[t], fish[t]) / SOUND_SPEED
    for other in range(targets.shape[0]):
        if other != t:
            distance = slant_range(vehicle, targets[other], fish[other])
            travel = distance / SOUND_SPEED
            if overlaps(targets[other], came - travel, p.tag.burst):
                chance, _ = uniform_pair(stream, OVERLAP, MOST * MOST * (1 + other) + place_of(v, t))
                loud = hearing_chance(distance, False, p.water)
                if p.calls.chance != 0:
                    drawn = targets[other].drawn
                    loud *= chance_at(p.calls.chance)(distance, drawn[0], drawn[1], p.sensor[:])
                if chance < loud:
                    return True
    return False


@inner
def overlaps(target, sent, burst):
    """Whether a tag has begun, or will begin, a transmission within ``burst`` of a time [s]."""
    last = target.last_ping >= 0.0 and abs(target.last_ping - sent) < burst
    previous = target.previous_ping >= 0.0 and abs(target.previous_ping - sent) < burst
    return last or previous or abs(target.next_ping - sent) < burst


@inner
def slant_range(vehicle, target, fish):
    """From a vehicle to a fish [m]."""
    dx, dy = np.float64(fish[0, 0]) - vehicle.x, np.float64(fish[1, 0]) - vehicle.y
    return math.sqrt(dx * dx + dy * dy + target.depth * target.depth)


@compiled
def listen(encounter, vehicle, navigation, target, fish_x, fish_y, destroyed, measurement, v, t, stream, p, time):
    """Advance the water to ``time``; hear a ping of the step before it or not; read what the sensor gives."""
    pinged = target.pinged
    index = place_of(v, t)
    change_water(encounter, stream, index, p.water, p.time_step)
    meet(encounter, vehicle, target, fish_x, fish_y, p.tag.period)
    encounter.pinged = pinged
    encounter.heard = pinged and not destroyed and hear(encounter, stream, index, p)
    measurement.time = time
    measurement.vehicle = v
    measurement.tag = t
    measurement.x = navigation.x
    measurement.y = navigation.y
    measurement.heading = navigation.heading
    measurement.depth = encounter.depth
    measurement.arrival = np.nan
    for k in range(READINGS):
        measurement.readings[k] = np.nan
    measurement.status = Status.MISSED if pinged and p.asks else Status.NOTHING
    if encounter.heard:
        measurement.status = Status.HEARD
        measurement.arrival = encounter.ping  # sound takes no time but where a sensor measures it
        normal_1, normal_2 = normal_pair(stream, READING, 2 * index)
        uniform_1, uniform_2 = uniform_pair(stream, READING, 2 * index + 1)
        read_at(p.calls.read)(measurement, encounter, normal_1, normal_2, uniform_1, uniform_2, p.sensor[:])
