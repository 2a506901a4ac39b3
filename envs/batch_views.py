"""What callers see of single worlds of a batch: their pictures, and an object for each that answers as an environment would."""

from __future__ import annotations

from typing import Any

import numpy as np

from tagtrack.envs.rendering import FRAMES_PER_SECOND, Picture
from tagtrack.envs.simulation import Simulation

MOST_PICTURES = 64  # worlds: each keeps a canvas of 6.5 MB, and a picture of all is 110 MB
RENDERING: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": FRAMES_PER_SECOND}  # for the metadata of a batch


class Pictures:
    """A picture of every world of a batch, or of none without a render mode. Call ``follow`` after each reset and step.

    Raises:
        ValueError: for an unknown render mode, or more worlds than anybody can look at.
        ImportError: without pygame-ce.
    """

    def __init__(self, simulation: Simulation, render_mode: str | None) -> None:
        if render_mode not in (None, *RENDERING["render_modes"]):
            raise ValueError(f"render_mode must be None or 'rgb_array', got {render_mode!r}")
        if render_mode is not None and simulation.num_worlds > MOST_PICTURES:
            raise ValueError(f"pictures are of at most {MOST_PICTURES} worlds, got {simulation.num_worlds}; make fewer to render")
        worlds = range(simulation.num_worlds) if render_mode else ()
        self._pictures = [Picture(simulation, world) for world in worlds]

    def follow(self) -> None:
        """Note where everything is now."""
        for picture in self._pictures:
            picture.follow()

    def paint(self, world: int) -> np.ndarray | None:
        """The picture of one world (H, W, 3) uint8; None without a render mode."""
        return self._pictures[world].paint() if self._pictures else None


class WorldView:
    """One world of a batch for those who ask an environment for something by its name (``call``, ``get_attr``, ``env_method``).

    It has what is its world's own; every other attribute is the batch's, which all worlds share. To reset or step one world is
    refused: the batch does so, for all.
    """

    def __init__(self, batch: Any, world: int, **own: Any) -> None:
        self._batch = batch
        self.world = world
        self.__dict__.update(own)

    @property
    def unwrapped(self) -> WorldView:
        """Itself."""
        return self

    def get_wrapper_attr(self, name: str) -> Any:
        """An attribute by its name."""
        return getattr(self, name)

    def has_wrapper_attr(self, name: str) -> bool:
        """Whether there is such an attribute."""
        return hasattr(self, name)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("_batch", "world"):
            raise AttributeError(name)
        found = getattr(self._batch, name)
        if callable(found):
            raise AttributeError(f"worlds of a batch are not asked to {name} one by one; call it of the batch")
        return found
