"""What a policy sees: the belief condensed to numbers near one, in the vehicle's own frame. No truth enters here.

The features are scaled by hand, so that a saved policy needs no normalizer. ``TAG_FEATURES`` come once for each tag,
``OWN_FEATURES`` once; ``feature_names`` is the layout that a policy file is checked against.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.sim.geometry import wrap_angle
from tagtrack.envs.sim.receivers import ReceiverKind

SILENCE_SCALE = 2.0


@dataclass(frozen=True, kw_only=True)
class Scale:
    """What makes the features of one kind of receiver numbers near one."""

    length: float  # distances are given as shares of this [m]
    near: float  # the distance whose logarithm is 0 [m]
    spread: float  # the standard deviation whose logarithm is 0 [m]
    memory: float  # over which the belief's bearing is averaged [s]


SCALES = {
    ReceiverKind.STEREO: Scale(length=50.0, near=15.0, spread=5.0, memory=20.0),
    ReceiverKind.TIME_OF_FLIGHT: Scale(length=50.0, near=15.0, spread=5.0, memory=20.0),
    ReceiverKind.RANGE: Scale(length=200.0, near=60.0, spread=20.0, memory=200.0),
    ReceiverKind.PRESENCE: Scale(length=200.0, near=60.0, spread=20.0, memory=300.0),
}
LENGTH = SCALES[ReceiverKind.STEREO].length


class Feature(NamedTuple):
    """One number of the observation."""

    name: str
    meaning: str
    low: float
    high: float


# The two features that hold what the receiver told, by its kind.
READINGS = {
    ReceiverKind.STEREO: (
        Feature("last_units", "last bearing reading / 9 Lotek units; 0 before the first", -1.0, 1.0),
        Feature("last_strength", "last signal strength / 50; 0 before the first", -2.0, 4.0),
    ),
    ReceiverKind.TIME_OF_FLIGHT: (
        Feature("last_units", "last bearing reading / 9 Lotek units; 0 before the first", -1.0, 1.0),
        Feature("last_range", "last time-of-flight range / 50 m; 0 before the first", -1.0, 10.0),
    ),
    ReceiverKind.RANGE: (
        Feature("last_range", "last slant range / 200 m; 0 before the first", 0.0, 10.0),
        Feature("range_miss", "slant range just read minus that to the belief's mean / 20 m; 0 if none", -8.0, 8.0),
    ),
    ReceiverKind.PRESENCE: (
        Feature("max_range", "range within which the tag is believed to be heard / 200 m", 0.0, 10.0),
        Feature("max_range_spread", "its standard deviation / 50 m; 0 where it is assumed", 0.0, 4.0),
    ),
}
PHASES = {
    ReceiverKind.STEREO: "time since the tag last pinged / its period",
    ReceiverKind.TIME_OF_FLIGHT: "time since the tag last pinged / its period",
    ReceiverKind.RANGE: "time since the tag last pinged / its period",
    ReceiverKind.PRESENCE: "1 minus the time until the next ping has come for certain / longest interval",
}


def tag_features(kind: ReceiverKind = ReceiverKind.STEREO) -> tuple[Feature, ...]:
    """What is seen of one tag by a receiver of a kind."""
    scale = SCALES[kind]
    return (
        Feature("distance", f"to the mean of the belief / {scale.length:g} m", 0.0, 10.0),
        Feature("log_distance", f"ln((distance + 1 m) / {scale.near:g} m)", -3.0, 4.0),
        Feature("bearing_cos", "of the belief's bearing relative to the heading", -1.0, 1.0),
        Feature("bearing_sin", "the same; positive to port", -1.0, 1.0),
        Feature("log_spread_along", f"ln(standard deviation along the line of sight / {scale.spread:g} m)", -4.0, 5.0),
        Feature("log_spread_across", "the same across it", -4.0, 5.0),
        Feature("spread_correlation", "between along and across", -1.0, 1.0),
        Feature("port_balance", "share of particles to port minus share to starboard", -1.0, 1.0),
        Feature("silence", "ln(1 + time since the last detection / 1 s) / 2", 0.0, 5.0),
        *READINGS[kind],
        Feature("heard_lately", "share of pings heard, average over some 5 pings", 0.0, 1.0),
        Feature("heard_long", "the same over some 33 pings", 0.0, 1.0),
        Feature("velocity_along", "of the belief along the line of sight, 20 s average / 0.25 m/s", -8.0, 8.0),
        Feature("velocity_across", "the same across it, positive to the left of the line", -8.0, 8.0),
        Feature("bearing_cos_lately", f"bearing_cos, average over some {scale.memory:g} s", -1.0, 1.0),
        Feature("bearing_sin_lately", f"bearing_sin, average over some {scale.memory:g} s", -1.0, 1.0),
        Feature("ping_phase", PHASES[kind], 0.0, 1.0),
    )


TAG_FEATURES = tag_features()
OWN_FEATURES = (
    Feature("heading_cos", "of the compass heading", -1.0, 1.0),
    Feature("heading_sin", "the same", -1.0, 1.0),
    Feature("speed", "through the water / largest speed", 0.0, 1.0),
)
TAG_COUNT = len(TAG_FEATURES)
OWN_COUNT = len(OWN_FEATURES)


def features(targets: int, kind: int = ReceiverKind.STEREO) -> tuple[Feature, ...]:
    """All features of one vehicle's observation, in order; with several tags each name carries its tag's number."""
    of_tag = tag_features(ReceiverKind(kind))
    if targets == 1:
        return of_tag + OWN_FEATURES
    tagged = tuple(feature._replace(name=f"tag_{t}.{feature.name}") for t in range(targets) for feature in of_tag)
    return tagged + OWN_FEATURES


def feature_names(targets: int = 1, kind: int = ReceiverKind.STEREO) -> tuple[str, ...]:
    return tuple(feature.name for feature in features(targets, kind))


def action_names(speed_control: bool) -> tuple[str, ...]:
    """Names of the action's components."""
    return ("ahead", "port", "speed") if speed_control else ("ahead", "port")


@compiled
def decode_action(action, vehicle, belief, max_speed, speed_control):
    """Course [rad] and speed [m/s] of an action.

    (ahead, port) points relative to the line from the vehicle to the mean of the belief: (1, 0) is pursuit, (0, 1) keeps the
    fish abeam to starboard. The zero vector means pursuit, too. The third component, where there is one, runs from rest (-1) to
    full speed (1).
    """
    ahead = min(max(np.float64(action[0]), -1.0), 1.0)
    port = min(max(np.float64(action[1]), -1.0), 1.0)
    line = math.atan2(belief.mean_y - vehicle.believed_y, belief.mean_x - vehicle.believed_x)
    course = wrap_angle(line + (math.atan2(port, ahead) if ahead != 0.0 or port != 0.0 else 0.0))
    speed = max_speed
    if speed_control:
        speed *= 0.5 * (1.0 + min(max(np.float64(action[2]), -1.0), 1.0))
    return course, speed


@compiled
def follow_bearing(contact, vehicle, belief, memory, time_step):
    """Update the running averages of heading against bearing."""
    line = math.atan2(belief.mean_y - vehicle.believed_y, belief.mean_x - vehicle.believed_x)
    share = min(1.0, time_step / memory)
    contact.cos_lately += share * (math.cos(line - vehicle.compass) - contact.cos_lately)
    contact.sin_lately += share * (math.sin(line - vehicle.compass) - contact.sin_lately)


@compiled
def ping_phase(target, contact, tag, time):
    """How far the interval between two pings has run, of random intervals how far until a ping has come for certain; 0 to 1."""
    if tag.random_delay > 0.0:
        return min(max(1.0 - (contact.surely_by - time) / (tag.period + tag.random_delay), 0.0), 1.0)
    since_ping = (time - target.first_ping) / tag.period
    return since_ping - math.floor(since_ping)


@compiled
def observe_tag(out, belief, contact, vehicle, phase, scale):
    """Write the features of one tag, in the order of ``tag_features`` but for the readings, each clipped to its bounds."""
    dx = belief.mean_x - vehicle.believed_x
    dy = belief.mean_y - vehicle.believed_y
    distance = math.sqrt(dx * dx + dy * dy)
    line = math.atan2(dy, dx)
    along_x = math.cos(line)
    along_y = math.sin(line)
    bearing = line - vehicle.compass
    along = along_x * along_x * belief.xx + along_y * along_y * belief.yy + 2.0 * along_x * along_y * belief.xy
    across = along_y * along_y * belief.xx + along_x * along_x * belief.yy - 2.0 * along_x * along_y * belief.xy
    both = along_x * along_y * (belief.yy - belief.xx) + (along_x * along_x - along_y * along_y) * belief.xy
    along = max(along, 1e-4)
    across = max(across, 1e-4)
    out[0] = min(distance / scale.length, 10.0)
    out[1] = min(max(math.log((distance + 1.0) / scale.near), -3.0), 4.0)
    out[2] = math.cos(bearing)
    out[3] = math.sin(bearing)
    out[4] = min(max(0.5 * math.log(along / (scale.spread * scale.spread)), -4.0), 5.0)
    out[5] = min(max(0.5 * math.log(across / (scale.spread * scale.spread)), -4.0), 5.0)
    out[6] = min(max(both / math.sqrt(along * across), -1.0), 1.0)
    out[7] = 2.0 * contact.port - 1.0
    out[8] = min(math.log(1.0 + contact.silence) / SILENCE_SCALE, 5.0)
    out[11] = contact.heard_lately
    out[12] = contact.heard_long
    out[13] = min(max(4.0 * (belief.velocity_x * along_x + belief.velocity_y * along_y), -8.0), 8.0)
    out[14] = min(max(4.0 * (belief.velocity_y * along_x - belief.velocity_x * along_y), -8.0), 8.0)
    out[15] = contact.cos_lately
    out[16] = contact.sin_lately
    out[17] = phase


@compiled
def observe_reading(out, belief, contact, vehicle, kind, scale):
    """Write the two features of ``READINGS``."""
    out[9] = 0.0
    out[10] = 0.0
    if kind == ReceiverKind.STEREO:
        if not math.isnan(contact.units):
            out[9] = contact.units / 9.0
            out[10] = min(max(contact.strength / 50.0, -2.0), 4.0)
    elif kind == ReceiverKind.TIME_OF_FLIGHT:
        if not math.isnan(contact.units):
            out[9] = contact.units / 9.0
            out[10] = min(max(contact.slant_range / scale.length, -1.0), 10.0)
    elif kind == ReceiverKind.RANGE:
        if not math.isnan(contact.slant_range):
            out[9] = min(contact.slant_range / scale.length, 10.0)
        if contact.detected:
            dx = belief.mean_x - vehicle.believed_x
            dy = belief.mean_y - vehicle.believed_y
            expected = math.sqrt(dx * dx + dy * dy + contact.depth * contact.depth)
            out[10] = min(max((contact.slant_range - expected) / scale.spread, -8.0), 8.0)
    else:
        out[9] = min(belief.max_range / scale.length, 10.0)
        out[10] = min(belief.max_range_spread / 50.0, 4.0)


@compiled
def observe_own(out, vehicle, max_speed):
    """Write the features of the vehicle itself, in the order of ``OWN_FEATURES``."""
    out[0] = math.cos(vehicle.compass)
    out[1] = math.sin(vehicle.compass)
    out[2] = min(max(vehicle.speed / max_speed, 0.0), 1.0)
