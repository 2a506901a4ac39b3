"""Decisions that last several steps: the course that was chosen is held, though an action is relative to a heading that turns."""

from __future__ import annotations

import numpy as np

from tagtrack.envs.frame import Frame
from tagtrack.envs.simulation import Simulation


class HeldCourse:
    """The courses that one action of each vehicle asks for, as actions of one step after another.

    Made before the first of them. Where courses are relative to the line to a tag, an action stays what it is.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._navigation = simulation.worlds.navigation
        self._turns = simulation.scenario.frame == Frame.HEADING
        self._first = self._navigation["heading"].copy()  # (B, V) [rad]

    def apply(self, actions: np.ndarray) -> np.ndarray:
        """The same courses as ``actions`` (B, V, A) meant at first, relative to the headings of now."""
        turned = self._navigation["heading"] - self._first
        if not self._turns or not turned.any():
            return actions
        ahead, port = np.moveaxis(np.clip(actions[..., :2].astype(np.float64), -1.0, 1.0) + 0.0, -1, 0)
        course = np.arctan2(port, ahead) - turned  # of (0, 0), straight on, the angle is 0
        return np.concatenate([np.stack([np.cos(course), np.sin(course)], axis=-1), actions[..., 2:]], axis=-1)
