"""What an observation is made of: blocks of named features, one for each tag, in their order, and the vehicle's own.

Names, bounds and places of the flat layout, which policy files are checked against, follow from the blocks; what fills them is in
``observation.py``. The features are scaled by hand (``Scale`` of the scenario), so that a saved policy needs no normalizer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.feature import Feature
from tagtrack.envs.scenario import Scenario


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
