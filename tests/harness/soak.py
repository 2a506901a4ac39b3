"""Worlds of all ids and of fleets are stepped for long, on two threads: finite, within their spaces, and as on one thread.

    python -m tests.harness.soak [SECONDS] [SEED]

Each task gets its share of the time. Two simulations, of one thread and of two, are compared bit for bit; memory may not grow.
"""

from __future__ import annotations

import resource
import sys
import time
from typing import Any

import numpy as np

from tagtrack.envs.layout import feature_names
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.spaces import observation_space
from tagtrack.envs.task import build_task

WORLDS, PARTICLES = 64, 100
TASKS: dict[str, dict[str, Any]] = {
    **{env_id: {"env_id": env_id} for env_id in SCENARIOS},
    "fleet, one belief": {"env_id": "LeopardShark-v0", "vehicles": 3, "tags": 2},
    "fleet, none": {"env_id": "LeopardShark-v0", "vehicles": 2, "tags": 3, "modem": "none"},
    "fleet, tdma": {"env_id": "RangeOnly-v0", "vehicles": 3, "tags": 2, "modem": "tdma"},
    "fleet, instant": {"env_id": "TimeOfFlight-v0", "vehicles": 2, "tags": 2, "modem": "instant"},
    "battery, arena": {"env_id": "LeopardShark-v0", "overrides": {"vehicle.battery": 5.0, "vehicle.arena": 100.0}},
}
SETTLED = 0.2  # of a task's time, after which its memory should not grow
GROWTH = 8 << 20  # [B] allowed all the same: pages of the allocator


def soak(name: str, seconds: float, seed: int) -> int:
    """Steps of all worlds in a task's time. Raises AssertionError for whatever is not as it should be."""
    asked = dict(TASKS[name])
    task = build_task(asked.pop("env_id"), particles=PARTICLES, **asked)
    one, two = (Simulation(task.scenario, WORLDS, threads=threads) for threads in (1, 2))
    space = observation_space(task.scenario)
    generator = np.random.default_rng(seed)
    for each in (one, two):
        each.reset(seed)
    steps, settled, begun = 0, 0, time.monotonic()
    while time.monotonic() - begun < seconds:
        actions = generator.uniform(-1.2, 1.2, one._actions.shape).astype(np.float32)
        for each in (one, two):
            each.step(actions)
        steps += WORLDS
        observed = two.observation
        assert ((observed >= space.low) & (observed <= space.high)).all(), (
            f"{name}: {find_outside(two, space)} at step {steps}"
        )
        assert np.isfinite(two.reward).all() and np.isfinite(two.error).all(), f"{name}: not finite at step {steps}"
        if generator.random() < 0.02:
            compare(one, two, f"{name} at step {steps}")
        ended = two.worlds.clock["step"] >= generator.integers(1, task.scenario.episode_steps, WORLDS)
        if ended.any() and generator.random() < 0.1:
            for each in (one, two):
                each.reset(mask=ended)
        if not settled and time.monotonic() - begun > SETTLED * seconds:
            settled = memory()
    compare(one, two, f"{name} at step {steps}")
    grown = memory() - settled
    assert seconds < 5 or grown < GROWTH, f"{name}: memory grew by {grown:,} B"
    for each in (one, two):
        each.close()
    return steps


def find_outside(simulation: Simulation, space: Any) -> list[str]:
    """Names of the features that have left their space."""
    wrong = ~((simulation.observation >= space.low) & (simulation.observation <= space.high)).reshape(
        -1, space.shape[-1]
    )
    return [name for name, out in zip(feature_names(simulation.scenario), wrong.any(axis=0), strict=True) if out]


def compare(one: Simulation, two: Simulation, where: str) -> None:
    """Raise AssertionError unless two simulations are in the same state, bit for bit."""
    for first, second in zip(one.save_state(), two.save_state(), strict=True):
        assert first.tobytes() == second.tobytes(), f"{where}: two threads come to something else than one"


def memory() -> int:
    """What this process holds in memory [B]."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * resource.getpagesize()
    except OSError:  # no Linux: the most that it ever held
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main() -> None:
    words = sys.argv[1:]
    seconds, seed = float(words[0]) if words else 60.0, int(words[1]) if len(words) > 1 else time.time_ns() % 2**31
    total = 0
    for name in TASKS:
        steps = soak(name, seconds / len(TASKS), seed)
        total += steps
        print(f"{name:<36} {steps:>12,} steps on two threads and on one", flush=True)
    print(f"{total:,} steps (seed {seed}): finite, within their spaces, the same bits, {memory() >> 20} MiB at the end")


if __name__ == "__main__":
    main()
