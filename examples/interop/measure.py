"""Runs one script and tells, in a last line of JSON, how many steps of worlds it made and how long they and learning took."""

from __future__ import annotations

import json
import runpy
import sys
import time

import numpy as np

from tagtrack.envs.simulation import Simulation


class Stopwatch:
    """Counts what every simulation of this process steps, from its first step on."""

    def __init__(self) -> None:
        self.steps = 0
        self.begun: float | None = None
        self._step = Simulation.step

    def step(self, simulation: Simulation, actions: np.ndarray) -> None:
        if self.begun is None:
            self.begun = time.perf_counter()
        self._step(simulation, actions)
        self.steps += simulation.num_worlds


def main() -> None:
    watch = Stopwatch()
    Simulation.step = lambda simulation, actions: watch.step(simulation, actions)  # type: ignore[method-assign]
    runpy.run_path(sys.argv[1], run_name="__main__")
    seconds = time.perf_counter() - (watch.begun or time.perf_counter())
    print(json.dumps({"steps": watch.steps, "seconds": round(seconds, 3)}), flush=True)


if __name__ == "__main__":
    main()
