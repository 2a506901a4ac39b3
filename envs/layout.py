"""What an observation is made of: blocks of named features, one for each tag and each teammate, in order, and the vehicle's own.

Names, bounds and places of the flat layout, which policy files are checked against, follow from the blocks; what fills them is in
``observation.py``. The features are scaled by hand (``Scale`` of the scenario), so that a saved policy needs no normalizer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.feature import Feature
from tagtrack.envs.frame import Frame
from tagtrack.envs.scenario import Scenario


@dataclass(frozen=True, kw_only=True)
class Block:
    """What is seen of one entity: the vehicle itself or a tag."""

    entity: str  # "tag_0", "tag_1" ..., "mate_0", "mate_1" ..., "own"
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
BATTERY = Feature("battery", "share that is left", 0.0, 1.0)
RADIO_FEATURES = (
    Feature("slot_phase", "time until the own slot begins / length of a cycle", 0.0, 1.0),
    Feature("waiting", "measurements that wait to be sent / those that one step can send", 0.0, 1.0),
)
ARENA_FEATURES = (
    Feature("border", "distance from the middle of the arena / its radius", 0.0, 2.0),
    Feature("inward_cos", "of the bearing of the middle relative to the heading", -1.0, 1.0),
    Feature("inward_sin", "the same; positive to port", -1.0, 1.0),
)


def own_features(scenario: Scenario) -> tuple[Feature, ...]:
    """What a vehicle sees of itself: of its battery, modem and arena only where it has one."""
    battery = (BATTERY,) if scenario.vehicle.battery > 0 else ()
    radio = RADIO_FEATURES if scenario.modem.talks and scenario.vehicles > 1 else ()
    return OWN_FEATURES + battery + radio + (ARENA_FEATURES if scenario.vehicle.arena > 0 else ())


def mate_features(scenario: Scenario) -> tuple[Feature, ...]:
    """What is seen of one teammate, as it was when it last told of itself; all 0 where nothing is known."""
    scale = scenario.scale
    return (
        Feature("known", "1 where anything is known of this teammate and it takes part, else 0", 0.0, 1.0),
        Feature("log_age", "ln(1 + age of what is known / 1 s) / 2", 0.0, 5.0),
        Feature("distance", f"to the teammate / {scale.length:g} m", 0.0, 10.0),
        Feature("log_distance", f"ln((distance + 1 m) / {scale.near:g} m)", -4.0, 4.0),
        Feature("bearing_cos", "of its bearing relative to the own heading", -1.0, 1.0),
        Feature("bearing_sin", "the same; positive to port", -1.0, 1.0),
        Feature("heading_cos", "of its heading relative to the own one", -1.0, 1.0),
        Feature("heading_sin", "the same; positive to port", -1.0, 1.0),
        Feature("speed", "through the water / largest speed", 0.0, 1.0),
    )


def tag_features(scenario: Scenario) -> tuple[Feature, ...]:
    """What is seen of one tag."""
    apart = f"ln((distance from the estimate to the nearest known teammate + 1 m) / {scenario.scale.near:g} m); 4 where none is"
    mates = (Feature("mate_log_distance", apart, -4.0, 4.0),) if scenario.vehicles > 1 else ()
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
        *mates,
    )


def blocks(scenario: Scenario) -> tuple[Block, ...]:
    """The blocks of one vehicle's observation, in order; its teammates by their number, itself left out."""
    parts = [(f"tag_{t}", tag_features(scenario)) for t in range(scenario.targets)]
    parts += [(f"mate_{v}", mate_features(scenario)) for v in range(scenario.vehicles - 1)]
    parts += [("own", own_features(scenario))]
    found, first = [], 0
    for entity, own in parts:
        found.append(Block(entity=entity, first=first, features=own))
        first += len(own)
    return tuple(found)


def features(scenario: Scenario) -> tuple[Feature, ...]:
    """All features of one vehicle's observation, in order; those of several tags, and of teammates, carry their names."""
    plain = {"own"} if scenario.targets > 1 else {"own", "tag_0"}
    return tuple(
        feature if block.entity in plain else feature._replace(name=f"{block.entity}.{feature.name}")
        for block in blocks(scenario)
        for feature in block.features
    )


@dataclass(frozen=True, kw_only=True)
class LayoutRule:
    """Sizes of the blocks, as compiled code reads them."""

    tag: int
    mate: int
    battery: bool
    radio: bool
    arena: bool


def layout_rule(scenario: Scenario) -> LayoutRule:
    names = {feature.name for feature in own_features(scenario)}
    return LayoutRule(
        tag=len(tag_features(scenario)),
        mate=len(mate_features(scenario)),
        battery="battery" in names,
        radio="slot_phase" in names,
        arena="border" in names,
    )


def feature_names(scenario: Scenario) -> tuple[str, ...]:
    """The layout that a policy file is checked against."""
    return tuple(feature.name for feature in features(scenario))


def action_names(scenario: Scenario) -> tuple[str, ...]:
    """Names of the action's components."""
    speed = ("speed",) if scenario.speed_control else ()
    choices = tuple(f"tag_{t}" for t in range(scenario.targets)) if scenario.frame == Frame.CHOSEN else ()
    return ("ahead", "port", *speed, *choices, *(("message",) if scenario.message_control else ()))


def split_observation(observation: np.ndarray, scenario: Scenario) -> Mapping[str, np.ndarray]:
    """A flat observation (..., D) by its entities, for networks that take them as sets.

    Returns:
        ``own`` (..., F), ``tags`` (..., T, F), ``tag_mask`` (..., T), ``mates`` (..., V - 1, F) and ``mate_mask`` (..., V - 1),
        each mask True where there is such an entity to be seen.
    """
    *others, own = blocks(scenario)
    tags = [observation[..., block.places] for block in others[: scenario.targets]]
    mates = [observation[..., block.places] for block in others[scenario.targets :]]
    nobody = np.zeros((*observation.shape[:-1], 0, len(mate_features(scenario))), observation.dtype)
    stacked = np.stack(mates, axis=-2) if mates else nobody
    return {
        "own": observation[..., own.places],
        "tags": np.stack(tags, axis=-2),
        "tag_mask": np.ones((*observation.shape[:-1], len(tags)), bool),
        "mates": stacked,
        "mate_mask": stacked[..., 0] > 0.5,
    }
