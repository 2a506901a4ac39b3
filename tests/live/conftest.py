"""Missions that the simulator plays, and what a tracker is told of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.measurement import Status
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.live import Conventions, Tracker
from tagtrack.live.cli import main

Event = tuple[str, tuple[Any, ...], dict[str, Any]]
MATHEMATICAL = Conventions(headings="mathematical")


def sail(task: Task, policy: str, seed: int, steps: int) -> Iterator[tuple[int, Simulation, np.ndarray]]:
    """Steps of an episode: number, simulation as it stands, action that is taken next."""
    simulation = Simulation(task.scenario, tracks=task.tracks)
    steersman, memory = make_baseline(policy, simulation), None
    simulation.reset(seed)
    for step in range(steps + 1):
        action, memory = steersman.predict(simulation.observation[:, 0], memory, np.array([step == 0]))
        yield step, simulation, action
        simulation.step(action[:, None])


def events_of(simulation: Simulation, step: int) -> list[Event]:
    """What a vehicle would have said at the end of a step, and what its receiver heard in it."""
    t, own = step * simulation.scenario.time_step, simulation.worlds.navigation[0, 0]
    events: list[Event] = [("navigate", (t, *(float(own[name]) for name in ("x", "y", "heading", "speed"))), {})]
    names = simulation.scenario.receiver.readings
    for tag, told in enumerate(simulation.worlds.measurements[0, 0]):
        if told["status"] == int(Status.HEARD):
            values = {name: float(told["readings"][k]) for k, name in enumerate(names)}
            events.append(("hear", (t, tag), {"arrival": float(told["arrival"]), **values}))
        elif told["status"] == int(Status.MISSED):
            events.append(("hear", (t, tag), {"heard": False}))
    return events


def depths_of(simulation: Simulation) -> dict[int, float]:
    return {tag: float(depth) for tag, depth in enumerate(simulation.worlds.targets["depth"][0])}


def feed(tracker: Tracker, events: list[Event]) -> None:
    for name, arguments, options in events:
        getattr(tracker, name)(*arguments, **options)


@pytest.fixture
def live(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a command line of `tagtrack live`; exit status, standard output and error (without the word about compiling)."""

    def run(*arguments: object) -> tuple[int, str, str]:
        status = main([str(argument) for argument in arguments])
        shown = capsys.readouterr()
        errors = [line for line in shown.err.splitlines(keepends=True) if not line.startswith("TagTrack compiles")]
        return status, shown.out, "".join(errors)

    return run
