"""Worlds of all ids and of fleets are stepped for long, on two threads: finite, within their spaces, and as on one thread.

    python -m tests.harness.soak [SECONDS] [SEED] [--steps 1e9] [--worlds B] [--particles N] [--again SHARE]

Rounds over all tasks, each with its share of a round's time, until the time is over or so many steps are made. A segment of
steps begins from the state where the last one ended; a share of the segments is made once more, from the same state and with the
same actions, by a simulation of one thread, and both must end in the same bits. Memory may not grow: within a task, nor with the
rounds.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

import numpy as np

from tagtrack.envs.layout import feature_names
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.spaces import observation_space
from tagtrack.envs.task import build_task

# Few particles: a world's own steps are what is tried here, and the particles' loops are the same for any number.
WORLDS, PARTICLES, SEGMENT, AGAIN = 1024, 32, 50, 0.125
TASKS: dict[str, dict[str, Any]] = {
    **{env_id: {"env_id": env_id} for env_id in SCENARIOS},
    "fleet, one belief": {"env_id": "LeopardShark-v0", "vehicles": 3, "tags": 2},
    "fleet, none": {"env_id": "LeopardShark-v0", "vehicles": 2, "tags": 3, "modem": "none"},
    "fleet, tdma": {"env_id": "RangeOnly-v0", "vehicles": 3, "tags": 2, "modem": "tdma"},
    "fleet, instant": {"env_id": "TimeOfFlight-v0", "vehicles": 2, "tags": 2, "modem": "instant"},
    "battery, arena": {"env_id": "LeopardShark-v0", "overrides": {"vehicle.battery": 5.0, "vehicle.arena": 100.0}},
}
ROUND = 280.0  # [s] of all tasks together, so that a run that is ended early has tried them all
SETTLED = 0.2  # of a task's time, after which its memory should not grow
GROWTH = 8 << 20  # [B] allowed all the same: pages that the allocator keeps (and the states that were copied last)


def soak(
    name: str, seconds: float, seed: int, *, worlds: int = WORLDS, particles: int = PARTICLES, again: float = AGAIN
) -> tuple[int, int]:
    """Steps of all worlds on two threads in a task's time, and how many of them on one as well.

    Raises AssertionError for whatever is not as it should be.
    """
    asked = dict(TASKS[name])
    task = build_task(asked.pop("env_id"), particles=particles, **asked)
    one, two = (Simulation(task.scenario, worlds, threads=threads) for threads in (1, 2))
    for each in (one, two):
        each.reset(seed)
    segments, twice, settled, begun = 0, 0, 0, time.monotonic()
    while time.monotonic() - begun < seconds:
        where = f"{name}, segment {segments} of seed {seed}"
        repeated = segments == 0 or np.random.default_rng((seed, segments, 1)).random() < again
        if repeated:
            one.load_state(two.save_state())
        play(two, (seed, segments), where)
        if repeated:
            play(one, (seed, segments), where)
            compare(one, two, where)
            twice += 1
        segments += 1
        if not settled and time.monotonic() - begun > SETTLED * seconds:
            settled = memory()
    grown = memory() - (settled or memory())
    allowed = GROWTH + 2 * sum(array.nbytes for array in two.save_state())
    assert seconds < 5 or grown < allowed, f"{name}: memory grew by {grown:,} B"
    for each in (one, two):
        each.close()
    return segments * SEGMENT * worlds, twice * SEGMENT * worlds


def play(simulation: Simulation, seed: tuple[int, int], where: str) -> None:
    """A segment of steps with actions of a seed, some beyond the bounds; worlds end at all lengths and begin anew."""
    generator = np.random.default_rng(seed)
    space = observation_space(simulation.scenario)
    for step in range(SEGMENT):
        actions = generator.random(simulation._actions.shape, np.float32)
        simulation.step(2.4 * actions - 1.2)
        observed = simulation.observation
        assert ((observed >= space.low) & (observed <= space.high)).all(), (
            f"{where}, step {step}: {find_outside(simulation, space)}"
        )
        finite = np.isfinite(simulation.reward).all() and np.isfinite(simulation.error).all()
        assert finite, f"{where}, step {step}: not finite"
        if generator.random() < 0.1:
            lengths = generator.integers(1, simulation.scenario.episode_steps, simulation.num_worlds)
            ended = simulation.worlds.clock["step"] >= lengths
            if ended.any():
                simulation.reset(mask=ended)


def find_outside(simulation: Simulation, space: Any) -> list[str]:
    """Names of the features that have left their space."""
    wrong = ~((simulation.observation >= space.low) & (simulation.observation <= space.high)).reshape(-1, space.shape[-1])
    return [name for name, out in zip(feature_names(simulation.scenario), wrong.any(axis=0), strict=True) if out]


def compare(one: Simulation, two: Simulation, where: str) -> None:
    """Raise AssertionError unless two simulations are in the same state, bit for bit."""
    for first, second in zip(one.save_state(), two.save_state(), strict=True):
        assert first.tobytes() == second.tobytes(), f"{where}: two threads come to something else than one"


def memory() -> int:
    """What this process holds in memory [B]."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:  # no Linux: the most that it ever held
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.harness.soak", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("seconds", nargs="?", type=float, default=60.0, help="of all rounds (60)")
    parser.add_argument("seed", nargs="?", type=int, default=time.time_ns() % 2**31, help="(the clock's)")
    parser.add_argument("--steps", type=float, default=np.inf, help="after which no other round begins")
    parser.add_argument("--worlds", type=int, default=WORLDS, help=f"of a batch ({WORLDS})")
    parser.add_argument("--particles", type=int, default=PARTICLES, help=f"of a belief ({PARTICLES})")
    parser.add_argument("--again", type=float, default=AGAIN, help=f"share of the segments made on one thread, too ({AGAIN})")
    asked = parser.parse_args()
    sizes = {"worlds": asked.worlds, "particles": asked.particles, "again": asked.again}
    rounds = max(1, round(asked.seconds / ROUND))
    counts, held = {name: np.zeros(2, np.int64) for name in TASKS}, []
    for number in range(rounds):
        for name in TASKS:
            counts[name] += soak(name, asked.seconds / rounds / len(TASKS), asked.seed + number, **sizes)
        held.append(memory())
        total, twice = sum(counts.values())
        print(f"round {number + 1} of {rounds}: {total:,} steps, {twice:,} on one thread, too; {held[-1] >> 20} MiB", flush=True)
        if total >= asked.steps:
            break
    for name, (total, twice) in counts.items():
        print(f"{name:<36} {total:>15,} steps on two threads, {twice:>15,} of them on one, too")
    total, twice = sum(counts.values())
    settled = held[min(1, len(held) - 1)]  # the first round fills what is kept for good
    assert held[-1] - settled < 4 * GROWTH, f"memory grew from {settled:,} to {held[-1]:,} B"
    print(f"{total:,} steps (seeds from {asked.seed}): finite, in their spaces; {twice:,} of them the same bits on one thread")


if __name__ == "__main__":
    main()
