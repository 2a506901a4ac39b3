"""What a policy sees: the belief condensed to numbers near one, in the vehicle's own frame. No truth enters here.

An observation is made of blocks: one for each tag, in their order, and the vehicle's own. Names, bounds and places of the flat
layout, which policy files are checked against, follow from the blocks. The features are scaled by hand (``Scale`` of the
scenario), so that a saved policy needs no normalizer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.feature import Feature
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.geometry import wrap_angle
from tagtrack.envs.kernels.summary_loops import share_to_port
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sensors.sensor import observe_at

SILENCE_SCALE = 2.0

# What the observation remembers of one vehicle and one tag: averages of the estimate's bearing relative to the heading, and the
# share of particles to port.
OUTLOOK = np.dtype([(name, np.float64) for name in ("cos_lately", "sin_lately", "port")])


@dataclass(frozen=True, kw_only=True)
class Block:
    """What is seen of one entity: the vehicle itself or a tag."""

    entity: str  # "own", "tag_0", "tag_1" ...
    first: int  # place of its first feature in the flat observation
    features: tuple[Feature, ...]

    @property
    def places(self) -> slice:
        """Where it stands in the flat observation."""
        return slice(self.first, self.first + len(self.features))


OWN_FEATURES = (
    Feature("heading_cos", "of the compass heading", -1.0, 1.0),
    Feature("heading_sin", "the same", -1.0, 1.0),
    Feature("speed", "through the water / largest speed", 0.0, 1.0),
)
OWN_COUNT = len(OWN_FEATURES)


def tag_features(scenario: Scenario) -> tuple[Feature, ...]:
    """What is seen of one tag."""
    scale, step, memory = scenario.scale, scenario.time_step, scenario.belief.velocity_memory
    average = f"average over some {memory:g} s" if step < memory else "over the last step"
    phase = "time since the tag last pinged / its period; -1 before it was heard"
    if scenario.tag.random_delay > 0:
        phase = "1 minus the time until the next ping has come for certain / longest interval"
    return (
        Feature("distance", f"to the estimate / {scale.length:g} m", 0.0, 10.0),
        Feature("log_distance", f"ln((distance + 1 m) / {scale.near:g} m)", -3.0, 4.0),
        Feature("bearing_cos", "of the estimate's bearing relative to the heading", -1.0, 1.0),
        Feature("bearing_sin", "the same; positive to port", -1.0, 1.0),
        Feature("log_spread_along", f"ln(standard deviation along the line of sight / {scale.spread:g} m)", -4.0, 5.0),
        Feature("log_spread_across", "the same across it", -4.0, 5.0),
        Feature("spread_correlation", "between along and across", -1.0, 1.0),
        Feature("port_balance", "share of particles to port minus share to starboard", -1.0, 1.0),
        Feature("silence", "ln(1 + time since the last detection / 1 s) / 2", 0.0, 5.0),
        *scenario.belief.receiver.features(scale),
        Feature("heard_lately", "share of pings heard, average over some 5 pings", 0.0, 1.0),
        Feature("heard_long", "the same over some 33 pings", 0.0, 1.0),
        Feature("velocity_along", f"of the belief along the line of sight, {average} / 0.25 m/s", -8.0, 8.0),
        Feature("velocity_across", "the same across it, positive to the left of the line", -8.0, 8.0),
        Feature("bearing_cos_lately", f"bearing_cos, average over some {scale.memory:g} s", -1.0, 1.0),
        Feature("bearing_sin_lately", f"bearing_sin, average over some {scale.memory:g} s", -1.0, 1.0),
        Feature("ping_phase", phase, 0.0 if scenario.tag.random_delay > 0 else -1.0, 1.0),
    )


SHARED_FEATURES = 16  # of a tag, beside the sensor's own


def blocks(scenario: Scenario) -> tuple[Block, ...]:
    """The blocks of one vehicle's observation, in order."""
    of_tag = tag_features(scenario)
    tags = tuple(Block(entity=f"tag_{t}", first=t * len(of_tag), features=of_tag) for t in range(scenario.targets))
    return (*tags, Block(entity="own", first=scenario.targets * len(of_tag), features=OWN_FEATURES))


def features(scenario: Scenario) -> tuple[Feature, ...]:
    """All features of one vehicle's observation, in order; with several tags each name carries its tag's."""
    if scenario.targets == 1:
        return tag_features(scenario) + OWN_FEATURES
    return tuple(
        feature if block.entity == "own" else feature._replace(name=f"{block.entity}.{feature.name}")
        for block in blocks(scenario)
        for feature in block.features
    )


def feature_names(scenario: Scenario) -> tuple[str, ...]:
    """The layout that a policy file is checked against."""
    return tuple(feature.name for feature in features(scenario))


def action_names(scenario: Scenario) -> tuple[str, ...]:
    """Names of the action's components."""
    return ("ahead", "port", "speed") if scenario.speed_control else ("ahead", "port")


def split_observation(observation: np.ndarray, scenario: Scenario) -> Mapping[str, np.ndarray]:
    """A flat observation (..., D) by its entities, for networks that take them as sets.

    Returns:
        ``own`` (..., F), ``tags`` (..., T, F) and ``tag_mask`` (..., T), True where a tag is there.
    """
    *tags, own = blocks(scenario)
    stacked = np.stack([observation[..., block.places] for block in tags], axis=-2)
    return {"own": observation[..., own.places], "tags": stacked, "tag_mask": np.ones(stacked.shape[:-1], bool)}


@compiled
def decode_action(action, navigation, belief, max_speed, speed_control, by_heading):
    """Course [rad] and speed [m/s] of an action.

    (ahead, port) points relative to the line from the vehicle to the estimate: (1, 0) is pursuit, (0, 1) keeps the fish abeam to
    starboard; or, ``by_heading``, relative to the vehicle's own heading. The zero vector means straight on, too. The third
    component, where there is one, runs from rest (-1) to full speed (1).
    """
    ahead = min(max(np.float64(action[0]), -1.0), 1.0)
    port = min(max(np.float64(action[1]), -1.0), 1.0)
    line = navigation.heading
    if not by_heading:
        line = math.atan2(belief.estimate_y - navigation.y, belief.estimate_x - navigation.x)
    course = wrap_angle(line + (math.atan2(port, ahead) if ahead != 0.0 or port != 0.0 else 0.0))
    speed = max_speed
    if speed_control:
        speed *= 0.5 * (1.0 + min(max(np.float64(action[2]), -1.0), 1.0))
    return course, speed


@compiled
def begin_outlook(outlook):
    """Before the first step."""
    outlook.cos_lately = 0.0
    outlook.sin_lately = 0.0
    outlook.port = 0.5


@compiled
def look_to_port(outlook, particles, navigation):
    """The share of particles to port, for a vehicle about whom the belief was not summarized."""
    ahead_x = np.float32(math.cos(navigation.heading))
    ahead_y = np.float32(math.sin(navigation.heading))
    own_x, own_y = np.float32(navigation.x), np.float32(navigation.y)
    outlook.port = share_to_port(particles[0], particles[1], own_x, own_y, ahead_x, ahead_y)


@compiled
def look(outlook, belief, navigation, memory, time_step):
    """Update the averages that the observation remembers."""
    line = math.atan2(belief.estimate_y - navigation.y, belief.estimate_x - navigation.x)
    share = min(1.0, time_step / memory)
    outlook.cos_lately += share * (math.cos(line - navigation.heading) - outlook.cos_lately)
    outlook.sin_lately += share * (math.sin(line - navigation.heading) - outlook.sin_lately)


@compiled
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


@compiled
def observe_own(out, navigation, max_speed):
    """Write the features of the vehicle itself, in the order of ``OWN_FEATURES``."""
    out[0] = math.cos(navigation.heading)
    out[1] = math.sin(navigation.heading)
    out[2] = min(max(navigation.speed / max_speed, 0.0), 1.0)
