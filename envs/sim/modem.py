"""Acoustic modems: who may send when, what a packet holds, how long it travels and whether it arrives.

Vehicles send in slots, one after the other (time division, as goby's users set up Micro-Modems), packets of a modem's smallest
frame. Left out: bit errors that only spoil part of a packet, rounding of what is told, and the noise that tags and modems make
for one another, which use other bands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tagtrack.envs.kernels.compiling import inner
from tagtrack.envs.kernels.random import MODEM, MODEM_POSE, normal_pair, place_of, uniform_pair
from tagtrack.envs.model import Model
from tagtrack.envs.validation import require, settle_numbers

SAME_TIME = 1e-9  # [s]


class Modem(Model):
    """Base of what vehicles may tell one another with."""

    shares: ClassVar[bool] = False  # whether there is one belief for all vehicles, of all that any of them measures
    talks: ClassVar[bool] = False  # whether packets travel
    calls: ClassVar[bool] = False  # whether all tell all at each step, at once


@dataclass(frozen=True, kw_only=True)
class PerfectModem(Modem):
    """A fusion centre knows at once what every vehicle measures, and every vehicle what it believes."""

    name: ClassVar[str] = "perfect"
    shares: ClassVar[bool] = True


@dataclass(frozen=True, kw_only=True)
class NoModem(Modem):
    """Nobody tells anybody anything: each vehicle has beliefs of its own."""

    name: ClassVar[str] = "none"


@dataclass(frozen=True, kw_only=True)
class InstantModem(Modem):
    """At each step every vehicle tells all the others at once what it has measured; each has beliefs of its own.

    What other simulations of fleets assume, UTracking among them: no slots and no travel, but losses and wrong places.
    """

    name: ClassVar[str] = "instant"
    calls: ClassVar[bool] = True

    loss: float = 0.1  # chance that one vehicle does not hear another at a step
    pose_sigma: float = 0.0  # error of the places that a vehicle tells, each axis, beside the navigation's own [m]

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(0 <= self.loss <= 1, self, "loss", "within 0 to 1")
        require(self.pose_sigma >= 0, self, "pose_sigma", "at least 0")


@dataclass(frozen=True, kw_only=True)
class TdmaModem(Modem):
    """Vehicles send packets in turn; each has beliefs of its own, from what it measures and what arrives.

    A packet holds the sender's pose and its measurements since its last packet, the newest first, as many as fit. A loss is told
    to nobody, and nothing is sent twice.
    """

    name: ClassVar[str] = "tdma"
    talks: ClassVar[bool] = True

    slot: float = 10.0  # from one packet to the next, of whichever vehicle [s]
    slots: int = 0  # of a cycle, the first for vehicle 0 ...; 0: as many as there are vehicles
    packet_bytes: int = 32  # the smallest frame of a WHOI Micro-Modem
    pose_bytes: int = 8  # place in decimetres (3 bytes each), heading, speed
    measurement_bytes: int = 7  # tag, age, place beside the pose (2 bytes each), heading; and 2 more for each reading
    largest_range: float = 1500.0  # beyond it nothing arrives [m]
    loss: float = 0.1  # chance that a packet from nearby is lost
    loss_at_range: float = 0.5  # the same at the largest range; between the two it grows with the square of the distance
    sound_speed: float = 1500.0  # [m/s]
    pose_sigma: float = 0.0  # error of all places that a packet tells, each axis, beside the navigation's own [m]
    memory: float = 120.0  # a measurement older than this when it arrives is passed over [s]

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name, most in (("slot", 3600.0), ("largest_range", 1e5), ("sound_speed", 1e4), ("memory", 3600.0)):
            require(0 < getattr(self, name) <= most, self, name, f"positive and at most {most:g}")
        for name, least, most in (
            ("slots", 0, 1000), ("packet_bytes", 1, 10_000), ("pose_bytes", 0, 10_000), ("measurement_bytes", 1, 10_000),
        ):  # fmt: skip
            value = getattr(self, name)
            whole = isinstance(value, int) and not isinstance(value, bool)
            require(whole and least <= value <= most, self, name, f"a whole number from {least} to {most}")
        for name in ("loss", "loss_at_range"):
            require(0 <= getattr(self, name) <= 1, self, name, "within 0 to 1")
        require(self.pose_sigma >= 0, self, "pose_sigma", "at least 0")

    def cycle_slots(self, vehicles: int) -> int:
        """Slots of a cycle. Raises ValueError where there are fewer than vehicles."""
        rule = f"at least {vehicles}, the number of vehicles (0: as many as there are)"
        require(self.slots == 0 or self.slots >= vehicles, self, "slots", rule)
        return self.slots or vehicles

    def capacity(self, readings: int) -> int:
        """Measurements of so many readings that one packet holds. Raises ValueError where there is room for none."""
        least = self.pose_bytes + self.measurement_bytes + 2 * readings
        rule = f"at least {least}: the pose ({self.pose_bytes}) and one measurement of {readings} readings"
        require(self.packet_bytes >= least, self, "packet_bytes", rule)
        return (self.packet_bytes - self.pose_bytes) // (self.measurement_bytes + 2 * readings)


MODEMS: dict[str, type[Modem]] = {modem.name: modem for modem in (PerfectModem, NoModem, InstantModem, TdmaModem)}


@dataclass(frozen=True, kw_only=True)
class ModemRule:
    """What compiled code reads of a modem, and how much room its messages need."""

    shares: bool = False
    talks: bool = False
    calls: bool = False
    slot: float = 1.0  # [s]
    slots: int = 1  # of a cycle
    capacity: int = 0  # measurements in a packet
    letters: int = 0  # measurements that a vehicle sends in a step at most
    flights: int = 0  # packets of one vehicle that may be on their way
    largest_range: float = 0.0  # [m]
    loss: float = 0.0
    loss_at_range: float = 0.0
    sound_speed: float = 1.0  # [m/s]
    pose_sigma: float = 0.0  # [m]
    remembered: int = 0  # steps that a belief can go back


def modem_rule(modem: Modem, vehicles: int, readings: int, time_step: float, *, at_will: bool = False) -> ModemRule:
    """The rule of a modem in a fleet whose sensor takes so many readings.

    Args:
        at_will: whether a vehicle may let its slots pass, so that what waits to be sent may grow older than a cycle.
    Raises:
        ValueError: for more vehicles than a cycle has slots, a packet too small for one measurement.
    """
    if isinstance(modem, InstantModem):
        return ModemRule(calls=True, flights=1, loss=modem.loss, pose_sigma=modem.pose_sigma)
    if not isinstance(modem, TdmaModem):
        return ModemRule(shares=modem.shares)
    slots, capacity = modem.cycle_slots(vehicles), modem.capacity(readings)
    cycle, travel = slots * modem.slot, modem.largest_range / modem.sound_speed
    oldest = math.ceil(modem.memory / time_step)  # steps; nothing comes later than a cycle after it was measured
    if not at_will:
        oldest = min(oldest, math.ceil((cycle + travel) / time_step) + 2)
    return ModemRule(
        talks=True,
        slot=modem.slot,
        slots=slots,
        capacity=capacity,
        letters=capacity * max(1, math.ceil(time_step / cycle - SAME_TIME)),
        flights=int((travel + time_step) / max(cycle, time_step)) + 2,
        largest_range=modem.largest_range,
        loss=modem.loss,
        loss_at_range=modem.loss_at_range,
        sound_speed=modem.sound_speed,
        pose_sigma=modem.pose_sigma,
        remembered=oldest + 1,
    )


@inner
def open_radio(radio, arrivals):
    """Nothing was sent yet, and nothing is on its way."""
    radio.wants = True
    radio.waiting = 0
    radio.next = 0
    radio.sent = 0
    radio.sent_now = 0
    radio.received = 0
    radio.too_late = 0
    arrivals[...] = np.inf


@inner
def send_in_turn(radios, packets, letters, arrivals, outbox, navigation, vehicles, stream, time, time_step, rule):
    """All packets of the slots that begin within [time, time + time_step); what they hold is from ``time`` and before."""
    for v in range(radios.shape[0]):
        radios[v].sent_now = 0
    n = math.ceil(time / rule.slot - SAME_TIME)
    while n * rule.slot < time + time_step - SAME_TIME:
        v = n % rule.slots
        if v < radios.shape[0] and navigation[v].active and radios[v].wants and radios[v].sent_now == 0:
            send(v, radios, packets, letters, arrivals, outbox, navigation, vehicles, stream, time, n * rule.slot, rule)
        n += 1


@inner
def send(v, radios, packets, letters, arrivals, outbox, navigation, vehicles, stream, time, departure, rule):
    """One vehicle's packet to all the others: it leaves at ``departure`` [s] with what is known at ``time``."""
    radio, own = radios[v], navigation[v]
    place = radio.next
    radio.next = (place + 1) % packets.shape[1]
    error_x, error_y = normal_pair(stream, MODEM_POSE, v)
    packet = packets[v, place]
    packet.time = time
    packet.x = own.x + rule.pose_sigma * error_x
    packet.y = own.y + rule.pose_sigma * error_y
    packet.heading = own.heading
    packet.speed = own.speed
    packet.count = radio.waiting
    for k in range(radio.waiting):
        letters[v, place, k] = outbox[v, k]
        letters[v, place, k].x += rule.pose_sigma * error_x
        letters[v, place, k].y += rule.pose_sigma * error_y
    frames = max(1, (radio.waiting + rule.capacity - 1) // rule.capacity)
    radio.sent_now = frames
    radio.sent += frames
    radio.waiting = 0
    for w in range(radios.shape[0]):
        arrivals[v, place, w] = np.inf
        if w != v:
            dx, dy = vehicles[w].x - vehicles[v].x, vehicles[w].y - vehicles[v].y
            distance = math.sqrt(dx * dx + dy * dy)
            chance, _ = uniform_pair(stream, MODEM, place_of(v, w))
            if distance <= rule.largest_range and chance >= chance_of_loss(distance, rule):
                arrivals[v, place, w] = departure + distance / rule.sound_speed


@inner
def call_out(mail, packets, navigation, stream, rule):
    """Every vehicle that takes part tells all the others where it is; ``mail[w, v]`` is 1 where w has heard v, else 0."""
    for v in range(packets.shape[0]):
        error_x, error_y = normal_pair(stream, MODEM_POSE, v)
        packets[v, 0].x = navigation[v].x + rule.pose_sigma * error_x
        packets[v, 0].y = navigation[v].y + rule.pose_sigma * error_y
        packets[v, 0].heading = navigation[v].heading
        packets[v, 0].speed = navigation[v].speed
        for w in range(packets.shape[0]):
            chance, _ = uniform_pair(stream, MODEM, place_of(v, w))
            mail[w, v] = w != v and navigation[v].active and navigation[w].active and chance >= rule.loss


@inner
def chance_of_loss(distance, rule):
    """Chance that a packet is lost on its way over a distance [m] within the largest range."""
    share = distance / rule.largest_range
    return rule.loss + (rule.loss_at_range - rule.loss) * share * share


@inner
def deliver(mail, arrivals, navigation, time):
    """``mail[w, v]`` is one more than the place of the packet of v that w has got by ``time``, 0 where it got none."""
    vehicles, flights = arrivals.shape[0], arrivals.shape[1]
    for w in range(vehicles):
        for v in range(vehicles):
            mail[w, v] = 0
            for place in range(flights):
                if arrivals[v, place, w] <= time + SAME_TIME:
                    arrivals[v, place, w] = np.inf
                    if navigation[w].active:
                        mail[w, v] = place + 1
