"""What a policy sees: the belief condensed to numbers near one, in the vehicle's own frame. No truth enters here.

The names of these numbers are in ``layout.py``; a test holds the two together.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.frame import Frame
from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.geometry import wrap_angle
from tagtrack.envs.kernels.summary_loops import share_to_port
from tagtrack.envs.kernels.weighted_loops import weighted_share_to_port
from tagtrack.envs.sensors.sensor import observe_at

SILENCE_SCALE = 2.0
SHARED_FEATURES = 16  # of a tag, beside the sensor's own and what is seen of teammates
FARTHEST = 4.0  # the largest logarithm of a distance
HEADING, CHOSEN = int(Frame.HEADING), int(Frame.CHOSEN)

# What the observation remembers of one vehicle and one tag: averages of the estimate's bearing relative to the heading, and the
# share of particles to port.
OUTLOOK = np.dtype([(name, np.float64) for name in ("cos_lately", "sin_lately", "port")])


@inner
def choose_tag(action, tags, speed_control, frame):
    """The tag that an action is about: of those that it may choose the one with the largest component, else the first."""
    tag = 0
    if frame == CHOSEN:
        first = 3 if speed_control else 2
        for t in range(1, tags):
            if action[first + t] > action[first + tag]:
                tag = t
    return tag


@inner
def decode_action(action, navigation, belief, max_speed, speed_control, frame):
    """Course [rad] and speed [m/s] of an action, given what is believed of the tag that it is about.

    (ahead, port) points relative to the line from the vehicle to the estimate: (1, 0) is pursuit, (0, 1) keeps the fish abeam to
    starboard; or relative to the vehicle's own heading. The zero vector means straight on, too. A further component runs from
    rest (-1) to full speed (1).
    """
    ahead = min(max(np.float64(action[0]), -1.0), 1.0)
    port = min(max(np.float64(action[1]), -1.0), 1.0)
    line = navigation.heading
    if frame != HEADING:
        line = math.atan2(belief.estimate_y - navigation.y, belief.estimate_x - navigation.x)
    course = wrap_angle(line + (math.atan2(port, ahead) if ahead != 0.0 or port != 0.0 else 0.0))
    speed = max_speed
    if speed_control:
        speed *= 0.5 * (1.0 + min(max(np.float64(action[2]), -1.0), 1.0))
    return course, speed


@inner
def begin_outlook(outlook):
    """Before the first step."""
    outlook.cos_lately = 0.0
    outlook.sin_lately = 0.0
    outlook.port = 0.5


@compiled
def look_to_port(outlook, particles, carried, navigation):
    """The share of particles, or of the weights they carry, to port of a vehicle about whom the belief was not summarized."""
    ahead_x = np.float32(math.cos(navigation.heading))
    ahead_y = np.float32(math.sin(navigation.heading))
    own_x, own_y = np.float32(navigation.x), np.float32(navigation.y)
    x, y = particles[0], particles[1]
    if carried.shape[0] > 0:
        outlook.port = weighted_share_to_port(x, y, carried, own_x, own_y, ahead_x, ahead_y)
    else:
        outlook.port = share_to_port(x, y, own_x, own_y, ahead_x, ahead_y)


@inner
def look(outlook, belief, navigation, memory, time_step):
    """Update the averages that the observation remembers."""
    line = math.atan2(belief.estimate_y - navigation.y, belief.estimate_x - navigation.x)
    share = min(1.0, time_step / memory)
    outlook.cos_lately += share * (math.cos(line - navigation.heading) - outlook.cos_lately)
    outlook.sin_lately += share * (math.sin(line - navigation.heading) - outlook.sin_lately)


@inner
def observe_tag(out, belief, listener, outlook, navigation, phase, rule, scale):
    """Write the features of one tag, in the order of ``tag_features``, each clipped to its bounds; the sensor's own first."""
    dx = belief.estimate_x - navigation.x
    dy = belief.estimate_y - navigation.y
    distance = math.sqrt(dx * dx + dy * dy)
    line = math.atan2(dy, dx)
    along_x = math.cos(line)
    along_y = math.sin(line)
    bearing = line - navigation.heading
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
    out[7] = 2.0 * outlook.port - 1.0
    out[8] = min(math.log(1.0 + listener.silence) / SILENCE_SCALE, 5.0)
    own = out.shape[0] - SHARED_FEATURES
    if rule.calls.observe != 0:
        observe_at(rule.calls.observe)(
            out[9 : 9 + own], listener, dx, dy, belief.estimated, belief.estimated_spread, scale.length, scale.spread,
            rule.model[:],
        )  # fmt: skip
    rest = out[9 + own :]
    rest[0] = listener.heard_lately
    rest[1] = listener.heard_long
    rest[2] = min(max(4.0 * (belief.velocity_x * along_x + belief.velocity_y * along_y), -8.0), 8.0)
    rest[3] = min(max(4.0 * (belief.velocity_y * along_x - belief.velocity_x * along_y), -8.0), 8.0)
    rest[4] = outlook.cos_lately
    rest[5] = outlook.sin_lately
    rest[6] = phase


@inner
def observe_teammates(out, belief, navigation, mates, v, scale):
    """How near the nearest known teammate is to a tag."""
    nearest = np.inf
    for other in range(mates.shape[0]):
        if other != v and mates[other].known:
            dx, dy = belief.estimate_x - mates[other].x, belief.estimate_y - mates[other].y
            nearest = min(nearest, math.sqrt(dx * dx + dy * dy))
    out[0] = min(max(math.log((nearest + 1.0) / scale.near), -4.0), FARTHEST) if nearest < np.inf else FARTHEST


@inner
def observe_mate(out, mate, navigation, time, max_speed, scale):
    """Write the features of one teammate, in the order of ``mate_features``."""
    out[:] = 0.0
    if not mate.known:
        return
    dx, dy = mate.x - navigation.x, mate.y - navigation.y
    distance = math.sqrt(dx * dx + dy * dy)
    bearing, turned = math.atan2(dy, dx) - navigation.heading, mate.heading - navigation.heading
    out[0] = 1.0
    out[1] = min(math.log(1.0 + max(time - mate.time, 0.0)) / SILENCE_SCALE, 5.0)
    out[2] = min(distance / scale.length, 10.0)
    out[3] = min(max(math.log((distance + 1.0) / scale.near), -4.0), FARTHEST)
    out[4] = math.cos(bearing)
    out[5] = math.sin(bearing)
    out[6] = math.cos(turned)
    out[7] = math.sin(turned)
    out[8] = min(max(mate.speed / max_speed, 0.0), 1.0)


@inner
def observe_own(out, navigation, radio, v, time, p):
    """Write the features of the vehicle itself, in the order of ``own_features``."""
    out[0] = math.cos(navigation.heading)
    out[1] = math.sin(navigation.heading)
    out[2] = min(max(navigation.speed / p.vehicle.max_speed, 0.0), 1.0)
    k = 3
    if p.layout.battery:
        out[k] = navigation.battery
        k += 1
    if p.layout.radio:
        turns = (time / p.modem.slot - v) / p.modem.slots
        out[k] = math.ceil(turns - 1e-9) - turns
        out[k + 1] = radio.waiting / p.modem.letters
        k += 2
    if p.layout.arena:
        bearing = math.atan2(-navigation.y, -navigation.x) - navigation.heading
        out[k] = min(math.hypot(navigation.x, navigation.y) / p.vehicle.arena, 2.0)
        out[k + 1] = math.cos(bearing)
        out[k + 2] = math.sin(bearing)
