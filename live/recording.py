"""An episode of the simulator written down as a vehicle would have logged it, for ``tagtrack live replay``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.envs.measurement import Status
from tagtrack.envs.simulation import Simulation
from tagtrack.live.mission_log import write_navigation, write_readings
from tagtrack.policies.files import replace_file

NAVIGATION_FILE, READINGS_FILE, REFERENCE_FILE, MISSION_FILE = "navigation.csv", "readings.csv", "reference.csv", "mission.json"
# What logs call a sensor's readings.
COLUMN_OF = {"units": "bearing_units", "slant_range": "range"}


class Recorder:
    """Writes down what the first vehicle of one world believes of itself and hears, and where the fish truly are.

    Args:
        simulation: of one vehicle; ``world`` is the one of its worlds that is recorded.
    """

    def __init__(self, simulation: Simulation, world: int = 0) -> None:
        if simulation.scenario.vehicles != 1:
            raise ValueError(f"missions of one vehicle are recorded, got vehicles={simulation.scenario.vehicles}")
        self.simulation, self.world = simulation, world
        self._navigation: list[list[float]] = []
        self._readings: list[dict[str, Any]] = []
        self._reference: list[list[Any]] = []
        self.names = tuple(COLUMN_OF.get(name, name) for name in simulation.scenario.receiver.readings)

    def note(self) -> None:
        """Write down where things stand: after the reset, and after each step."""
        worlds, b = self.simulation.worlds, self.world
        t = float(worlds.clock["step"][b]) * self.simulation.scenario.time_step
        own = worlds.navigation[b, 0]
        self._navigation.append([t, *(float(own[name]) for name in ("x", "y", "heading", "speed"))])
        for tag in range(self.simulation.scenario.targets):
            self._reference.append([t, str(tag), *map(float, self.simulation.fish_position[b, tag])])
            told = worlds.measurements[b, 0, tag]
            if told["status"] in (int(Status.HEARD), int(Status.MISSED)):
                self._readings.append(self._reading(told, tag))

    def _reading(self, told: Any, tag: int) -> dict[str, Any]:
        heard = told["status"] == int(Status.HEARD)
        row: dict[str, Any] = {"t": float(told["time"]), "tag": str(tag), "depth": float(told["depth"]), "heard": int(heard)}
        if heard:
            row["arrival"] = float(told["arrival"])
            values = told["readings"]
            row |= {name: float(values[k]) for k, name in enumerate(self.names) if np.isfinite(values[k])}
        return row

    def write(self, folder: Path, *, env_id: str, seed: int, preset: str | None, overrides: Mapping[str, Any]) -> None:
        """navigation.csv, readings.csv, reference.csv (where the fish was) and mission.json (what replay needs to repeat it)."""
        folder.mkdir(parents=True, exist_ok=True)
        write_navigation(folder / NAVIGATION_FILE, self._navigation, {"headings": "mathematical"})
        write_readings(folder / READINGS_FILE, self._readings, self.names)
        with replace_file(folder / REFERENCE_FILE) as path:
            lines = ["t,tag,x,y", *(f"{t!r},{tag},{x!r},{y!r}" for t, tag, x, y in self._reference)]
            path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        depths = self.simulation.worlds.targets["depth"][self.world]
        mission = {
            "env": env_id,
            "preset": preset,
            "overrides": dict(overrides),
            "tags": [str(tag) for tag in range(self.simulation.scenario.targets)],
            "depths": {str(tag): float(depth) for tag, depth in enumerate(depths)},
            "particles": self.simulation.scenario.belief.particles,
            "seed": seed,
            "episode": int(self.simulation.worlds.clock["episode"][self.world]),
        }
        with replace_file(folder / MISSION_FILE) as path:
            path.write_text(json.dumps(mission, indent=2) + "\n", encoding="utf-8")
