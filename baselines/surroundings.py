"""Tags and teammates as one vehicle of a fleet believes them, read from its observation into SI units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tagtrack.envs.layout import mate_features, split_observation, tag_features
from tagtrack.envs.observation import SILENCE_SCALE
from tagtrack.envs.scenario import Scenario


class Surroundings(NamedTuple):
    """What a vehicle believes about it, in its own frame: x ahead, y to port [m]. There are B rows, V vehicles, T tags."""

    tags: np.ndarray  # (B, T, 2) the estimates
    spread: np.ndarray  # (B, T) root of the sum of the belief's two variances [m]
    places: np.ndarray  # (B, V, 2) of all vehicles by their number, itself at 0, as they last told; NaN where nothing is known
    age: np.ndarray  # (B, V) of what they told [s]
    speed: np.ndarray  # (B, V) through the water, of teammates; NaN as above [m/s]


def read_surroundings(rows: np.ndarray, scenario: Scenario) -> Surroundings:
    """Of observations (B, D), row b * V + v being that of vehicle v."""
    parts = split_observation(rows.astype(np.float64), scenario)
    tag = {feature.name: parts["tags"][..., k] for k, feature in enumerate(tag_features(scenario))}
    along, across = (scenario.scale.spread * np.exp(tag[f"log_spread_{way}"]) for way in ("along", "across"))
    places, age, speed = _place_mates(parts["mates"], parts["mate_mask"], scenario)
    return Surroundings(_place(tag, scenario), np.hypot(along, across), places, age, speed)


def _place(seen: dict[str, np.ndarray], scenario: Scenario) -> np.ndarray:
    """Relative places (..., 2) [m]."""
    distance = scenario.scale.length * seen["distance"]
    return np.stack([distance * seen["bearing_cos"], distance * seen["bearing_sin"]], axis=-1)


def _place_mates(mates: np.ndarray, known: np.ndarray, scenario: Scenario) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (B, V, 2), ages and speeds (B, V) by number, from what is seen of teammates (B, V - 1, F)."""
    rows, fleet = len(mates), scenario.vehicles
    own = np.arange(rows) % fleet
    places, age, speed = np.zeros((rows, fleet, 2)), np.zeros((rows, fleet)), np.zeros((rows, fleet))
    seen = {feature.name: np.where(known, mates[..., k], np.nan) for k, feature in enumerate(mate_features(scenario))}
    each, other = np.nonzero(np.arange(fleet) != own[:, None])  # itself is left out among its teammates
    places[each, other] = _place(seen, scenario).reshape(-1, 2)
    age[each, other] = np.expm1(SILENCE_SCALE * seen["log_age"]).ravel()
    speed[each, other] = (scenario.vehicle.max_speed * seen["speed"]).ravel()
    return places, age, speed
