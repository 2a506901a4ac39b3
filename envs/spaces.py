"""The spaces of observation and action, which follow from the scenario."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box

from tagtrack.envs.layout import action_names, features
from tagtrack.envs.scenario import Scenario


def observation_space(scenario: Scenario) -> Box:
    """Of one vehicle: finite bounds, one for each of ``features``."""
    layout = features(scenario)
    return Box(np.array([f.low for f in layout], np.float32), np.array([f.high for f in layout], np.float32))


def action_space(scenario: Scenario) -> Box:
    """Of one vehicle: as many numbers in [-1, 1] as ``action_names`` has names."""
    return Box(-1.0, 1.0, (len(action_names(scenario)),), np.float32)


def team_space(own: Box, vehicles: int) -> Box:
    """Of all vehicles of a world together: the space of one, or (V, ...) of several."""
    return own if vehicles == 1 else Box(np.stack([own.low] * vehicles), np.stack([own.high] * vehicles))
