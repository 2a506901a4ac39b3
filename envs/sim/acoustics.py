"""Tag, water and stereo-hydrophone receiver of Clark et al. 2013: when a ping is heard, and what the receiver then reads.

A usable signal needs both hydrophones. Hearing falls off about L = 100 m, and losses come in bursts (weed, bubbles, the
hull's own noise), so that the rate of usable signals ranges over some 3 to 25 a minute and gaps reach 30 s (6.2; Lin et al.
2013, III.B): with the defaults a minute has 23 (median; 1 % of them 2 or fewer), and the longest gap of ten minutes is 38 s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import HEARING, READING, START, WATER, normal_pair, uniform_pair
from tagtrack.envs.sim.geometry import relative_bearing
from tagtrack.envs.sim.validation import require, settle_numbers

LARGEST_UNIT = 9.0  # Lotek bearing units run from -9 to 9


@dataclass(frozen=True, kw_only=True)
class Tag:
    """An acoustic tag that pings at a fixed period from a random first ping on."""

    period: float = 2.0  # T_c [s]; the paper used tags of 2 s and 5 s

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.period > 0, self, "period", "positive")


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


@dataclass(frozen=True, kw_only=True)
class StereoHydrophone:
    """Noise and calibration of the receiver (Table I; Eq. 8). The belief holds one of its own: what it assumes."""

    bearing_sigma: float = 1.0  # sigma_alpha [Lotek units]
    strength_sigma: float = 15.0  # sigma_ss [Lotek strength units]
    strength_slope: float = -0.871  # a of Eq. 8
    strength_scale: float = 2.18  # b of Eq. 8 (a power of ten)

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("bearing_sigma", "strength_sigma"):
            require(getattr(self, name) > 0, self, name, "positive")


# What one vehicle hears of one tag. `units` [Lotek] and `strength` are the last reading, NaN before the first; `silence` is
# the time since then [s]; `noisy` tells a burst of losses; `heard_lately` and `heard_long` are averages of detections over
# pings, `port` the share of particles to port, `cos_lately` and `sin_lately` averages of the belief's bearing relative to
# the heading.
CONTACT = np.dtype(
    [
        ("pinged", np.bool_),
        ("detected", np.bool_),
        ("noisy", np.bool_),
        ("units", np.float64),
        ("strength", np.float64),
        ("range", np.float64),
        ("silence", np.float64),
        ("heard_lately", np.float64),
        ("heard_long", np.float64),
        ("port", np.float64),
        ("cos_lately", np.float64),
        ("sin_lately", np.float64),
    ]
)


@compiled
def bearing_in_units(bearing):
    """Lotek units, real-valued, of a relative bearing [rad] (Eq. 5): the same to port and to starboard."""
    degrees = 90.0 - abs(bearing) * 180.0 / math.pi
    return ((-1e-6 * degrees + 2e-5) * degrees + 0.0947) * degrees - 0.2757


@compiled
def expected_strength(distance, receiver):
    """Signal strength at a distance [m] (Eq. 8)."""
    return 10.0**receiver.strength_scale * max(distance, 1e-3) ** receiver.strength_slope


@compiled
def pings_within(first_ping, period, time, time_step):
    """Whether a tag pings within (time, time + time_step]."""
    return math.floor((time + time_step - first_ping) / period) > math.floor((time - first_ping) / period)


@compiled
def open_contact(contact, stream, index, water):
    """A contact before the first ping."""
    chance, _ = uniform_pair(stream, START, 16 * index + 2)
    contact.pinged = False
    contact.detected = False
    contact.noisy = chance < water.noisy_share
    contact.units = np.nan
    contact.strength = np.nan
    contact.silence = 0.0
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
def listen(contact, vehicle, fish_x, fish_y, pinged, stream, index, water, receiver, time_step):
    """Advance the water; hear a ping or not; read bearing and strength where both hydrophones heard it."""
    change_water(contact, stream, index, water, time_step)
    dx = fish_x - vehicle.x
    dy = fish_y - vehicle.y
    contact.range = math.sqrt(dx * dx + dy * dy)
    contact.pinged = pinged
    contact.detected = False
    contact.silence += time_step
    if not pinged:
        return
    chance = hearing_chance(contact.range, contact.noisy, water)
    bow, stern = uniform_pair(stream, HEARING, index)
    contact.detected = bow < chance and stern < chance
    heard = 1.0 if contact.detected else 0.0
    contact.heard_lately += 0.2 * (heard - contact.heard_lately)
    contact.heard_long += 0.03 * (heard - contact.heard_long)
    if contact.detected:
        bearing = relative_bearing(vehicle.x, vehicle.y, vehicle.heading, fish_x, fish_y)
        unit_noise, strength_noise = normal_pair(stream, READING, index)
        units = math.floor(bearing_in_units(bearing) + receiver.bearing_sigma * unit_noise + 0.5)
        contact.units = min(max(units, -LARGEST_UNIT), LARGEST_UNIT)
        contact.strength = expected_strength(contact.range, receiver) + receiver.strength_sigma * strength_noise
        contact.silence = 0.0
