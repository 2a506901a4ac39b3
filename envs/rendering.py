"""The picture of one world: vehicles, fish, tracks, particles, bearing fan, range ring, ellipse, messages (pygame-ce).

All that it draws it reads from a ``Simulation``; it changes nothing. Shapes are painted at twice the size and scaled
down, which smooths their edges; text is written last. The legend beside the map is in ``legend.py``.
"""

from __future__ import annotations

import math
import os
from typing import Any, NamedTuple

import numpy as np

from tagtrack.envs.legend import (
    CROSS,
    FAINT,
    FISH,
    FISH_SHAPE,
    GRID,
    INK,
    MESSAGE,
    PANEL,
    VEHICLE,
    VEHICLE_SHAPE,
    WATER,
    Legend,
    paint_shape,
    shade,
)
from tagtrack.envs.measurement import Status, measurement
from tagtrack.envs.sensors.sensor import Glimpse
from tagtrack.envs.simulation import Simulation

FRAMES_PER_SECOND = 20
MAP = 640  # side of the map [pixels]
FINE = 2  # painted at so many times the size
SIDE = MAP * FINE
NEAREST_VIEW = 70.0  # half the width of the closest view [m]
ELLIPSE = math.sqrt(-2.0 * math.log(1.0 - 0.95))  # holds 95 % of a normal distribution [standard deviations]
UNSEEN = ("dummy", "offscreen")  # what SDL falls back to where there is no screen
NO_SCREEN = "there is no screen for a window; `tagtrack eval video` makes a file, and render_mode='rgb_array' gives pictures"


class Reading(NamedTuple):
    """The last reading of a vehicle and a tag."""

    measurement: Any  # a record
    estimated: float  # the belief's number of the sensor at that time


class Picture:
    """Follows one world of a simulation and paints it. Call ``follow`` after each reset and step.

    To follow costs little and needs no pygame, for many are asked for pictures that nobody looks at: Stable-Baselines3's
    ``make_vec_env`` makes all its environments with ``render_mode="rgb_array"``.
    """

    def __init__(self, simulation: Simulation, world: int = 0) -> None:
        self._simulation = simulation
        self._world = world
        self._canvas: Any = None  # made for the first picture
        self._window: Any = None
        self._clock: Any = None
        sensor = simulation.scenario.belief.receiver
        self._example = sensor.glimpse(measurement(time=0.0, x=0.0, y=0.0, readings=[1.0] * len(sensor.readings))[0], 1.0)
        self._held: tuple[np.ndarray, np.ndarray] | None = None
        self._begin()

    def hold_view(self, low: np.ndarray, high: np.ndarray) -> None:
        """Show this rectangle from now on, both corners (2,) [m], whatever may leave it: pictures side by side want one scale."""
        self._held = np.asarray(low, float), np.asarray(high, float)

    def _begin(self) -> None:
        self._vehicle_track: list[np.ndarray] = []
        self._fish_track: list[np.ndarray] = []
        self._readings: dict[tuple[int, int], Reading] = {}
        self._low = np.full(2, -NEAREST_VIEW)  # of all that the particles have covered
        self._high = np.full(2, NEAREST_VIEW)

    def __getstate__(self) -> dict[str, Any]:
        """What a copy, or a pickle, goes on with; it paints on a canvas and in a window of its own."""
        own = {name: value for name, value in self.__dict__.items() if name not in ("_pygame", "_legend")}
        return own | {"_canvas": None, "_window": None, "_clock": None}

    def follow(self) -> None:
        """Note where everything is now; a world at step 0 begins a new picture."""
        worlds, world = self._simulation.worlds, self._world
        if worlds.clock["step"][world] == 0:
            self._begin()
        vehicles = worlds.vehicles[world]
        self._vehicle_track.append(np.stack((vehicles["x"], vehicles["y"]), axis=-1))
        self._fish_track.append(worlds.fish[world, :, :2, 0].astype(float))
        heard = worlds.measurements["status"][world] == int(Status.HEARD)
        for v, t in np.argwhere(heard).tolist() if heard.any() else ():
            self._readings[v, t] = self._read(v, t)
        particles = worlds.particles[world, ..., :2, :]
        self._low = np.minimum(self._low, particles.min(axis=-1).min(axis=(0, 1)))
        self._high = np.maximum(self._high, particles.max(axis=-1).max(axis=(0, 1)))

    def _view(self) -> tuple[np.ndarray, np.ndarray]:
        """The rectangle to show; it only widens, so that it holds still."""
        if self._held is not None:
            return self._held
        seen = np.concatenate(self._vehicle_track + self._fish_track)
        return np.minimum(self._low, seen.min(axis=0)), np.maximum(self._high, seen.max(axis=0))

    def _read(self, v: int, t: int) -> Reading:
        worlds, world = self._simulation.worlds, self._world
        estimated = float(worlds.beliefs["estimated"][world, 0 if worlds.beliefs.shape[1] == 1 else v, t])
        return Reading(worlds.measurements[world, v, t].copy(), estimated)

    def _glimpse(self, reading: Reading) -> Glimpse:
        return self._simulation.scenario.belief.receiver.glimpse(*reading)

    def _tell_readings(self) -> list[str]:
        return [self._glimpse(each).words for each in self._readings.values()]

    def _prepare(self) -> None:
        """Make what is painted on. Raises ImportError without pygame-ce."""
        try:
            import pygame
        except ImportError:
            raise ImportError('rendering needs pygame-ce: pip install "tagtrack[render]"') from None
        self._pygame: Any = pygame
        self._legend = Legend(self._simulation, self._world)
        self._canvas = pygame.Surface((SIDE, SIDE))

    def paint(self) -> np.ndarray:
        """The picture, (MAP, MAP + PANEL, 3) uint8. Raises ImportError without pygame-ce."""
        surface = self._paint_surface()
        rows = self._pygame.image.tobytes(surface, "RGB")
        return np.frombuffer(rows, np.uint8).reshape(MAP, MAP + PANEL, 3).copy()

    def show(self) -> bool:
        """Bring the picture to a window, no faster than ``FRAMES_PER_SECOND``; whether nobody has asked to close it.

        Raises:
            OSError: where there is no screen.
        """
        surface = self._paint_surface()
        pygame = self._pygame
        if self._window is None:
            try:
                pygame.display.init()
                pygame.display.set_caption("TagTrack")
                self._window = pygame.display.set_mode((MAP + PANEL, MAP))
            except pygame.error as error:
                raise OSError(f"{NO_SCREEN} ({error})") from None
            if "SDL_VIDEODRIVER" not in os.environ and pygame.display.get_driver() in UNSEEN:
                self.close()
                raise OSError(NO_SCREEN)
            self._clock = pygame.time.Clock()
        self._window.blit(surface, (0, 0))
        closed = bool(pygame.event.get(pygame.QUIT))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(FRAMES_PER_SECOND)
        return not closed

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._pygame.display.quit()
            self._window = None

    def _pixel(self, place: Any) -> np.ndarray:
        """Where on the canvas places (..., 2) [m] are."""
        offset = (np.asarray(place, float) - self._centre) * self._scale
        return offset * (1.0, -1.0) + 0.5 * SIDE

    def _paint_surface(self) -> Any:
        if self._canvas is None:
            self._prepare()
        pygame = self._pygame
        low, high = self._view()
        self._centre = 0.5 * (low + high)
        self._scale = SIDE / (1.12 * float((high - low).max()))  # pixels of the canvas per metre
        self._paint_water()
        self._paint_readings()
        self._paint_tracks()
        self._paint_messages()
        self._paint_particles()
        self._paint_beliefs()
        self._paint_bodies()
        picture = pygame.Surface((MAP + PANEL, MAP))
        picture.blit(pygame.transform.smoothscale(self._canvas, (MAP, MAP)), (0, 0))
        self._write_scale(picture)
        picture.blit(self._legend.paint(MAP, self._tell_readings(), self._example), (MAP, 0))
        return picture

    def _bar(self) -> float:
        """A round length that fills between an eighth and a quarter of the map [m]."""
        longest = 0.26 * SIDE / self._scale
        power = 10.0 ** math.floor(math.log10(longest))
        return next(digit * power for digit in (5.0, 2.0, 1.0) if digit * power <= longest)

    def _paint_water(self) -> None:
        self._canvas.fill(WATER)
        bar = self._bar()
        first = np.ceil((self._centre - 0.5 * SIDE / self._scale) / bar)
        for k in range(int(SIDE / self._scale / bar) + 1):
            x, y = self._pixel((first + k) * bar)
            self._pygame.draw.line(self._canvas, GRID, (x, 0), (x, SIDE), FINE)
            self._pygame.draw.line(self._canvas, GRID, (0, y), (SIDE, y), FINE)

    def _paint_readings(self) -> None:
        """The last reading of each vehicle and tag: its bearing, give or take sigma, on both sides, and a ring at its range."""
        layer = self._pygame.Surface((SIDE, SIDE), self._pygame.SRCALPHA)
        for (v, t), reading in self._readings.items():
            if not self._simulation.worlds.navigation["active"][self._world, v]:
                continue
            glimpse, record = self._glimpse(reading), reading.measurement
            place, compass = np.array([record["x"], record["y"]]), float(record["heading"])
            fresh = math.exp(-self._simulation.listeners["silence"][self._world, v, t] / 30.0)  # it fades
            if glimpse.fan is not None:
                self._paint_fan(layer, (*VEHICLE, 20 + 60 * fresh), place, compass, glimpse.fan)
            if math.isfinite(glimpse.radius):
                colour = (*VEHICLE, (20 + 60 * fresh) * (1 + (glimpse.fan is not None)))  # to show on the fan
                self._pygame.draw.circle(layer, colour, self._pixel(place), glimpse.radius * self._scale, 4 * FINE)
        self._canvas.blit(layer, (0, 0))

    def _paint_fan(self, layer: Any, colour: Any, place: np.ndarray, compass: float, fan: tuple[float, float]) -> None:
        for side in (1.0, -1.0):
            angles = compass + side * np.linspace(*fan, 24)
            arc = place + self._simulation.scenario.water.reach * np.stack((np.cos(angles), np.sin(angles)), axis=1)
            self._pygame.draw.polygon(layer, colour, self._pixel(np.vstack((place, arc))).tolist())

    def _paint_tracks(self) -> None:
        for track, colour in ((self._vehicle_track, VEHICLE), (self._fish_track, FISH)):
            if len(track) > 1:
                for path in np.stack(track, axis=1):
                    self._pygame.draw.lines(self._canvas, colour, False, self._pixel(path).tolist(), 2 * FINE)

    def _paint_messages(self) -> None:
        """A line from sender to receiver for each packet that has come in this step."""
        places = self._vehicle_track[-1]
        for receiver, sender in np.argwhere(self._simulation.worlds.mail[self._world] > 0).tolist():
            ends = self._pixel(places[[sender, receiver]]).tolist()
            self._pygame.draw.line(self._canvas, MESSAGE, *ends, 2 * FINE)

    def _believers(self) -> list[int]:
        """The beliefs that anybody still holds."""
        owners = self._simulation.worlds.beliefs.shape[1]
        return [o for o in range(owners) if owners == 1 or self._simulation.worlds.navigation["active"][self._world, o]]

    def _paint_particles(self) -> None:
        """Each a small square; where they are many, or weigh much, the colour is deep. Each belief has a shade of its own."""
        particles, carried = self._simulation.worlds.particles[self._world], self._simulation.worlds.carried[self._world]
        for o in self._believers():
            places = np.moveaxis(particles[o, :, :2], -2, -1).reshape(-1, 2)
            self._paint_cloud(shade(o, len(particles)), places, carried[o].ravel(), particles.shape[-1])

    def _paint_cloud(self, colour: Any, places: np.ndarray, carried: np.ndarray, count: int) -> None:
        """Particles at places (M, 2) [m], ``count`` for each tag; what they carry is empty where all weigh alike."""
        pygame = self._pygame
        stamp = np.array(list(np.ndindex(2 * FINE + 1, 2 * FINE + 1))) - FINE
        cells = (self._pixel(places).astype(int)[:, np.newaxis] + stamp).reshape(-1, 2)
        inside = ((cells >= 0) & (cells < SIDE)).all(axis=1)
        cell, which = np.unique(cells[inside] @ (SIDE, 1), return_inverse=True)
        depth = np.bincount(which, np.repeat(carried, len(stamp))[inside] if carried.size else None)
        layer = pygame.Surface((SIDE, SIDE), pygame.SRCALPHA)
        layer.fill((*colour, 0))
        alpha = pygame.surfarray.pixels_alpha(layer)
        alpha[cell // SIDE, cell % SIDE] = 215.0 * (1.0 - np.exp(-0.8 * min(1.0, (1000 / count) ** 0.5) * depth))
        del alpha  # it locks the layer
        self._canvas.blit(layer, (0, 0))

    def _paint_beliefs(self) -> None:
        """The 95 % ellipse and the estimate, with a line from it to the true fish: the error."""
        simulation, world, draw = self._simulation, self._world, self._pygame.draw
        turn = np.linspace(0.0, 2.0 * math.pi, 72)
        circle = ELLIPSE * np.stack((np.cos(turn), np.sin(turn)), axis=1)
        owners, tags = simulation.error.shape[1:]
        for o in self._believers():
            colour = shade(o, owners)
            for t in range(tags):
                values, axes = np.linalg.eigh(simulation.covariance[world, o, t])
                ellipse = simulation.mean[world, o, t] + circle * np.sqrt(np.maximum(values, 0.0)) @ axes.T
                draw.lines(self._canvas, colour, True, self._pixel(ellipse).tolist(), 2 * FINE)
                estimate = self._pixel(simulation.estimate[world, o, t])
                draw.line(self._canvas, INK, estimate, self._pixel(self._fish_track[-1][t]), FINE)
                paint_shape(self._canvas, CROSS, estimate, colour, FINE)

    def _paint_bodies(self) -> None:
        """Fish, vehicles, hollow where their part has ended, and the circles about them that somebody should keep to."""
        simulation, world = self._simulation, self._world
        perimeter, arena = simulation.scenario.reward.perimeter, simulation.scenario.vehicle.arena
        if arena > 0:
            turn = np.linspace(0.0, 2.0 * math.pi, 361)
            circle = arena * np.stack((np.cos(turn), np.sin(turn)), axis=1)
            self._pygame.draw.lines(self._canvas, FAINT, True, self._pixel(circle).tolist(), FINE)
        for place, fish in zip(self._fish_track[-1], simulation.worlds.fish[world], strict=True):
            if perimeter > 0:
                self._pygame.draw.circle(self._canvas, FISH, self._pixel(place), perimeter * self._scale, FINE)
            paint_shape(self._canvas, FISH_SHAPE, self._pixel(place), FISH, FINE, float(fish[2, 0]))
        for v, place in enumerate(self._vehicle_track[-1]):
            colour = VEHICLE if simulation.worlds.navigation["active"][world, v] else None
            heading = float(simulation.worlds.vehicles["heading"][world, v])
            paint_shape(self._canvas, VEHICLE_SHAPE, self._pixel(place), colour, FINE, heading)

    def _write_scale(self, picture: Any) -> None:
        bar = self._bar()
        right = 20 + round(bar * self._scale / FINE)
        corners = [(20, MAP - 26), (20, MAP - 18), (right, MAP - 18), (right, MAP - 26)]
        self._pygame.draw.lines(picture, INK, False, corners, 2)
        self._legend.write(picture, f"{bar:g} m", (27, MAP - 37))
