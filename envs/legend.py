"""Colours and shapes of the picture, and the legend beside the map: the step's numbers and what the shapes mean."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tagtrack.envs.sensors.sensor import Glimpse
from tagtrack.envs.simulation import Simulation

PANEL = 250  # width [pixels]

WATER = (228, 238, 244)
GRID = (208, 222, 231)
PAPER = (250, 252, 253)
INK = (38, 50, 62)
FAINT = (104, 120, 134)
VEHICLE = (232, 165, 20)
FISH = (204, 50, 60)
BELIEF = (26, 92, 168)
FAN = (243, 218, 158)

# Outlines [pixels], x ahead, y to port.
VEHICLE_SHAPE = np.array([(13, 0), (6, 5), (-9, 5), (-13, 0), (-9, -5), (6, -5)])
FISH_SHAPE = np.array([(11, 0), (5, 4), (-2, 4), (-7, 1), (-12, 5), (-12, -5), (-7, -1), (-2, -4), (5, -4)])
CROSS = np.array([(8, 2), (2, 2), (2, 8), (-2, 8), (-2, 2), (-8, 2), (-8, -2), (-2, -2), (-2, -8), (2, -8), (2, -2), (8, -2)])

def paint_shape(surface: Any, shape: np.ndarray, place: Any, colour: Any, size: int, heading: float = 0.0) -> None:
    """An outline of fixed size, nose along the heading [rad], about a pixel of a pygame surface."""
    from pygame import draw

    ahead = np.array((math.cos(heading), -math.sin(heading)))
    port = np.array((-math.sin(heading), -math.cos(heading)))
    outline = (np.asarray(place) + size * (shape[:, :1] * ahead + shape[:, 1:] * port)).tolist()
    draw.polygon(surface, colour, outline)
    draw.polygon(surface, PAPER if shape is CROSS else INK, outline, size)


class Legend:
    """Writes about one world of a simulation."""

    def __init__(self, simulation: Simulation, world: int) -> None:
        from pygame import font

        font.init()
        self._text = font.Font(None, 21)
        self._headline = font.Font(None, 44)
        self._simulation = simulation
        self._world = world

    def write(self, surface: Any, text: str, place: tuple[int, int], colour: Any = INK) -> None:
        """A word in the legend's letters, its upper left corner at a pixel."""
        surface.blit(self._text.render(text, True, colour), place)

    def paint(self, height: int, readings: list[str], glimpse: Glimpse) -> Any:
        """A surface (PANEL, height); ``readings`` are the last ones in words, ``glimpse`` shows how such a one is drawn."""
        from pygame import Surface

        panel = Surface((PANEL, height))
        panel.fill(PAPER)
        self._write_numbers(panel, readings)
        self._explain_shapes(panel, glimpse)
        return panel

    def _write_numbers(self, panel: Any, readings: list[str]) -> None:
        """Of a fleet the mean error, the nearest fish and the latest detection."""
        simulation, world = self._simulation, self._world
        silence = simulation.listeners["silence"][world]
        seconds = int(simulation.worlds.clock["step"][world] * simulation.scenario.time_step)
        numbers = {
            "time": f"{seconds // 60:02d}:{seconds % 60:02d}",
            "range": f"{simulation.range[world].min():.0f} m",
            "last heard": f"{silence.min():.0f} s ago" if readings else "not yet",
            "reading": " ".join(readings[:4]) or "none",
        }
        self.write(panel, "error of the estimate", (20, 22), FAINT)
        panel.blit(self._headline.render(f"{simulation.error[world].mean():.1f} m", True, INK), (20, 42))
        for k, (name, value) in enumerate(numbers.items()):
            self.write(panel, name, (20, 96 + 24 * k), FAINT)
            self.write(panel, value, (115, 96 + 24 * k))

    def _explain_shapes(self, panel: Any, glimpse: Glimpse) -> None:
        from pygame import draw

        x, rows = 34, [250 + 34 * k for k in range(7)]
        words = ["vehicle and track", "fish and track", "particles", "95 % of the belief", "estimate, error"]
        paint_shape(panel, VEHICLE_SHAPE, (x, rows[0]), VEHICLE, 1)
        paint_shape(panel, FISH_SHAPE, (x, rows[1]), FISH, 1)
        for right, down in ((-9, -3), (-3, 4), (1, -5), (3, 2), (8, -1), (-5, -2)):
            draw.rect(panel, BELIEF, (x + right, rows[2] + down, 2, 2))
        draw.ellipse(panel, BELIEF, (x - 13, rows[3] - 7, 26, 14), 2)
        paint_shape(panel, CROSS, (x, rows[4]), BELIEF, 1)
        words += [self._simulation.scenario.belief.receiver.legend]
        if glimpse.fan is not None:
            draw.polygon(panel, FAN, [(x - 13, rows[5]), (x + 13, rows[5] - 8), (x + 13, rows[5] + 8)])
        if glimpse.fan is None or math.isfinite(glimpse.radius):
            draw.circle(panel, FAN, (x, rows[5]), 11, 3)
        if self._simulation.scenario.reward.perimeter > 0:
            words.append("perimeter")
            draw.circle(panel, FISH, (x, rows[6]), 10, 1)
        for y, text in zip(rows, words, strict=False):
            self.write(panel, text, (62, y - 7))
