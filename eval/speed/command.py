"""`tagtrack eval speed`: env steps and particle updates a second, beside the readable numpy + filterpy filter."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import gymnasium
import numpy as np
import tyro

import tagtrack  # noqa: F401  registers the ids
from tagtrack.envs.frame import Frame
from tagtrack.envs.layout import action_names
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.comparison import describe_fleet
from tagtrack.eval.options import TaskOptions
from tagtrack.eval.report import as_console_table, show, write_json
from tagtrack.eval.results_folder import require_writable_file
from tagtrack.eval.speed.filter_bank import FilterBank, ReferenceBank
from tagtrack.eval.speed.timing import Step, time_in_turn
from tagtrack.eval.versions import collect_versions

OWN_ID = "TagTrack/LeopardShark-v0"  # of ours, by which Gymnasium makes an environment of any task
KINDS = {
    "filter": "the filter alone, a correction at every step, as the reference does",
    "env": "Simulation.step: vehicle, fish, channel, filter, observation and reward; restarts included",
    "vector": "gymnasium.make_vec",
    "gym": "gymnasium.make with its default wrappers",
}


@dataclass(frozen=True, kw_only=True)
class Speed:
    """Time the simulation, beside the readable reference filter (numpy and filterpy, one thread).

    Reference and subject are timed in turn, and medians are reported, so that other work on the machine cancels. Close other
    programs all the same.
    """

    task: TaskOptions = field(default_factory=TaskOptions)
    num_worlds: Annotated[tuple[int, ...], tyro.conf.arg(metavar="B ...")] = (1, 64, 256)
    """Numbers of worlds that are stepped together."""
    threads: Annotated[tuple[int, ...], tyro.conf.arg(metavar="T ...")] = (1, 2)
    """Numbers of threads; more threads than worlds are left out."""
    seed: int = 0
    """Of the first world."""
    rounds: int = 7
    """Times that reference and subject take turns, for each row."""
    seconds: float = 0.2
    """Length of a turn [s]."""
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(none)")] = None
    """JSON file to write."""

    def run(self) -> None:
        """Run it."""
        task = self.task.build()
        for name in ("num_worlds", "threads"):
            values = getattr(self, name)
            if not values or min(values) < 1:
                raise ValueError(f"--{name.replace('_', '-')} must be whole numbers of at least 1, got {values}")
        if self.rounds < 1 or not 0 < self.seconds < 3600:
            raise ValueError(f"--rounds must be at least 1 and --seconds positive, got {self.rounds} and {self.seconds}")
        require_writable_file(self.json)
        rows = [self.measure(task, *subject) for subject in self.subjects(task)]
        document = {
            "env": self.task.env_id,
            **({"fleet": describe_fleet(task.scenario)} if is_fleet(task) else {}),
            "machine": describe_machine(),
            "versions": collect_versions(),
            "reference_particle_updates_per_s": float(np.median([row.pop("reference") for row in rows])),
            "rows": rows,
        }
        print_speed(document)
        if self.json is not None:
            write_json(self.json, document)
            print(f"written: {self.json}")

    def subjects(self, task: Task) -> Iterator[tuple[str, int, int]]:
        """Kind, worlds and threads of each row."""
        for kind in ("filter", "env"):
            yield from ((kind, b, threads) for b in self.num_worlds for threads in self.threads if threads <= b)
        if not is_fleet(task):  # these show one vehicle
            yield "vector", max(self.num_worlds), 1
            yield "gym", 1, 1

    def measure(self, task: Task, kind: str, num_worlds: int, threads: int) -> dict[str, Any]:
        """Time one row."""
        particles = task.scenario.belief.particles
        beliefs = task.scenario.owners * task.scenario.targets if kind == "env" else 1
        with self._subject(task, kind, num_worlds, threads) as step:
            pace = time_in_turn(step, ReferenceBank(particles).step, rounds=self.rounds, seconds=self.seconds)
        return {
            "env": self.task.env_id,
            "kind": kind,
            "num_worlds": num_worlds,
            "particles": particles,
            "threads": threads,
            "env_steps_per_s": pace.steps_per_s * num_worlds,
            **({"beliefs": beliefs} if is_fleet(task) else {}),
            "particle_updates_per_s": pace.steps_per_s * num_worlds * beliefs * particles,
            "ratio_to_reference": pace.ratio * num_worlds * beliefs,
            "reference": pace.reference_steps_per_s * particles,
        }

    @contextmanager
    def _subject(self, task: Task, kind: str, num_worlds: int, threads: int) -> Iterator[Step]:
        if kind == "filter":
            bank = FilterBank(task.scenario.belief, num_worlds, threads)
            yield bank.step
            bank.close()
        elif kind == "env":
            simulation = Simulation(task.scenario, num_worlds, threads=threads, tracks=task.tracks)
            yield step_simulation(simulation, self.seed)
            simulation.close()
        elif kind == "vector":
            worlds = gymnasium.make_vec(OWN_ID, num_worlds, "vector_entry_point", env_id=task)
            worlds.reset(seed=self.seed)
            actions = np.tile(pursuit_action(task), (num_worlds, 1))
            yield lambda: worlds.step(actions)
            worlds.close()
        else:
            env = gymnasium.make(OWN_ID, env_id=task)
            yield step_env(env, pursuit_action(task), self.seed)
            env.close()


def is_fleet(task: Task) -> bool:
    """Whether there are several vehicles or tags."""
    return task.scenario.vehicles > 1 or task.scenario.targets > 1


def pursuit_action(task: Task) -> np.ndarray:
    """Straight at the mean of the belief, at full speed; where courses are relative to the heading, round on the spot."""
    ahead, port = (0.0, 1.0) if task.scenario.frame == Frame.HEADING else (1.0, 0.0)
    return np.array([{"ahead": ahead, "port": port}.get(name, 1.0) for name in action_names(task.scenario)], np.float32)


def step_simulation(simulation: Simulation, seed: int) -> Step:
    """A function that steps all worlds by one action and begins new episodes when the old ones are over."""
    task = Task(simulation.scenario, None)
    actions = np.tile(pursuit_action(task), (simulation.num_worlds, simulation.scenario.vehicles, 1))
    simulation.reset(seed)
    clock = simulation.worlds.clock

    def step() -> None:
        if clock[0]["step"] >= simulation.scenario.episode_steps:
            simulation.reset()
        simulation.step(actions)

    return step


def step_env(env: gymnasium.Env[Any, Any], action: np.ndarray, seed: int) -> Step:
    """The same for a Gymnasium environment."""
    env.reset(seed=seed)

    def step() -> None:
        _, _, _, truncated, _ = env.step(action)
        if truncated:
            env.reset()

    return step


def describe_machine() -> dict[str, Any]:
    """Processor, its number of cores, and operating system."""
    processor = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").is_file():
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        processor = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), processor)
    return {"processor": processor, "cores": os.cpu_count(), "system": platform.platform()}


def print_speed(document: dict[str, Any]) -> None:
    """The rows as a table."""
    fleet = document.get("fleet")
    steps = "joint\nsteps/s" if fleet else "env\nsteps/s"
    header = ["kind", "worlds", "threads", *(["beliefs"] if fleet else []), "particles", steps]
    header += ["particle\nupdates/s", "ratio to\nreference"]
    rows = [
        [
            row["kind"],
            str(row["num_worlds"]),
            str(row["threads"]),
            *([str(row["beliefs"])] if fleet else []),
            str(row["particles"]),
            f"{row['env_steps_per_s']:,.0f}",
            f"{row['particle_updates_per_s'] / 1e6:.1f} M",
            f"{row['ratio_to_reference']:.1f}",
        ]
        for row in document["rows"]
    ]
    shown = {row["kind"] for row in document["rows"]}
    kinds = "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS.items() if kind in shown)
    who = f", {fleet['vehicles']} x {fleet['tags']} (vehicles x tags), modem {fleet['modem']}," if fleet else ""
    note = (
        f"{document['env']}{who} on {document['machine']['processor']}, {document['machine']['cores']} cores. Reference: "
        f"{document['reference_particle_updates_per_s'] / 1e6:.2f} M particle updates/s. {kinds}."
    )
    if fleet:
        note += " A joint step is one of all vehicles of a world; beliefs are those of one world."
    show(as_console_table(header, rows, note))
