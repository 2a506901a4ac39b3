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
LAST_BELIEF = (12, 148, 142)  # of the last of several vehicles' own beliefs; those between shade from BELIEF to it
MESSAGE = (168, 138, 200)
MOST_LINES = 3  # of readings

# Outlines [pixels], x ahead, y to port.
VEHICLE_SHAPE = np.array([(13, 0), (6, 5), (-9, 5), (-13, 0), (-9, -5), (6, -5)])
FISH_SHAPE = np.array([(11, 0), (5, 4), (-2, 4), (-7, 1), (-12, 5), (-12, -5), (-7, -1), (-2, -4), (5, -4)])
CROSS = np.array([(8, 2), (2, 2), (2, 8), (-2, 8), (-2, 2), (-8, 2), (-8, -2), (-2, -2), (-2, -8), (2, -8), (2, -2), (8, -2)])


def shade(belief: int, beliefs: int) -> tuple[int, int, int]:
    """The colour of one of so many beliefs."""
    share = belief / max(beliefs - 1, 1)
    red, green, blue = (round(first + share * (last - first)) for first, last in zip(BELIEF, LAST_BELIEF, strict=True))
    return red, green, blue


def paint_shape(surface: Any, shape: np.ndarray, place: Any, colour: Any, size: int, heading: float = 0.0) -> None:
    """An outline of fixed size, nose along the heading [rad], about a pixel of a pygame surface; hollow without a colour."""
    from pygame import draw

    ahead = np.array((math.cos(heading), -math.sin(heading)))
    port = np.array((-math.sin(heading), -math.cos(heading)))
    outline = (np.asarray(place) + size * (shape[:, :1] * ahead + shape[:, 1:] * port)).tolist()
    if colour is None:
        draw.polygon(surface, FAINT, outline, size)
        return
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
        """Of a fleet the mean error, the nearest fish and the latest detection; of those that take part, while any does."""
        simulation, world = self._simulation, self._world
        active = simulation.worlds.navigation["active"][world]
        part = active if active.any() else np.ones_like(active)
        error, silence = simulation.error[world], simulation.listeners["silence"][world, part]
        error = error[part] if len(error) == len(part) else error
        seconds = int(simulation.worlds.clock["step"][world] * simulation.scenario.time_step)
        numbers = {
            "time": [f"{seconds // 60:02d}:{seconds % 60:02d}"],
            "range": [f"{simulation.range[world, part].min():.0f} m"],
            "last heard": [f"{silence.min():.0f} s ago" if readings else "not yet"],
            "reading": self._wrap(readings, PANEL - 115 - 12) or ["none"],
        }
        self.write(panel, "error of the estimate", (20, 22), FAINT)
        panel.blit(self._headline.render(f"{error.mean():.1f} m", True, INK), (20, 42))
        for k, (name, lines) in enumerate(numbers.items()):
            self.write(panel, name, (20, 96 + 24 * k), FAINT)
            for below, line in enumerate(lines):
                self.write(panel, line, (115, 96 + 24 * k + 19 * below))

    def _fit(self, text: str, width: int) -> str:
        """A text, or as much of it as is no wider than so many pixels."""
        kept = text
        while self._text.size(kept)[0] > width:
            kept = kept.rstrip(".")[:-1].rstrip() + "..."
        return kept

    def _wrap(self, words: list[str], width: int) -> list[str]:
        """Words in lines no wider than so many pixels; of too many the last line tells how many are left out."""
        lines: list[str] = []
        told = 0
        for word in words:
            more = f"{lines[-1]}  {word}" if lines else word
            if lines and self._text.size(more)[0] <= width:
                lines[-1] = more
            elif len(lines) < MOST_LINES:
                lines.append(word)
            else:
                break
            told += 1
        if told < len(words):
            kept = lines[-1].split("  ")
            while len(kept) > 1 and self._text.size("  ".join(kept) + f"  +{len(words) - told}")[0] > width:
                kept.pop()
                told -= 1
            lines[-1] = "  ".join(kept) + f"  +{len(words) - told}"
        return lines

    def _explain_shapes(self, panel: Any, glimpse: Glimpse) -> None:
        scenario, x = self._simulation.scenario, 34
        draws = {
            "vehicle and track": lambda y: paint_shape(panel, VEHICLE_SHAPE, (x, y), VEHICLE, 1),
            "fish and track": lambda y: paint_shape(panel, FISH_SHAPE, (x, y), FISH, 1),
            "particles": lambda y: _explain_particles(panel, x, y),
            "95 % of the belief": lambda y: _explain_ellipse(panel, x, y),
            "estimate, error": lambda y: paint_shape(panel, CROSS, (x, y), BELIEF, 1),
            scenario.belief.receiver.legend: lambda y: _explain_glimpse(panel, x, y, glimpse),
        }
        if scenario.reward.perimeter > 0:
            draws["perimeter"] = lambda y: _explain_circle(panel, x, y, FISH)
        if scenario.modem.talks and scenario.vehicles > 1:
            draws["message that arrives"] = lambda y: _explain_message(panel, x, y)
        if scenario.vehicle.battery > 0:
            draws["battery empty"] = lambda y: paint_shape(panel, VEHICLE_SHAPE, (x, y), None, 1)
        if scenario.vehicle.arena > 0:
            draws["arena"] = lambda y: _explain_circle(panel, x, y, FAINT)
        for k, (words, paint) in enumerate(draws.items()):
            paint(250 + 34 * k)
            self.write(panel, self._fit(words, PANEL - 62 - 8), (62, 243 + 34 * k))


def _explain_particles(panel: Any, x: int, y: int) -> None:
    from pygame import draw

    for right, down in ((-9, -3), (-3, 4), (1, -5), (3, 2), (8, -1), (-5, -2)):
        draw.rect(panel, BELIEF, (x + right, y + down, 2, 2))


def _explain_ellipse(panel: Any, x: int, y: int) -> None:
    from pygame import draw

    draw.ellipse(panel, BELIEF, (x - 13, y - 7, 26, 14), 2)


def _explain_glimpse(panel: Any, x: int, y: int, glimpse: Glimpse) -> None:
    from pygame import draw

    if glimpse.fan is not None:
        draw.polygon(panel, FAN, [(x - 13, y), (x + 13, y - 8), (x + 13, y + 8)])
    if glimpse.fan is None or math.isfinite(glimpse.radius):
        draw.circle(panel, FAN, (x, y), 11, 3)


def _explain_circle(panel: Any, x: int, y: int, colour: Any) -> None:
    from pygame import draw

    draw.circle(panel, colour, (x, y), 10, 1)


def _explain_message(panel: Any, x: int, y: int) -> None:
    from pygame import draw

    draw.line(panel, MESSAGE, (x - 13, y + 4), (x + 13, y - 4), 2)
