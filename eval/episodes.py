"""Which episodes of a task are played, and in what batches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task


@dataclass(frozen=True, kw_only=True)
class Episodes:
    """Episodes of neighbouring seeds; ``threads`` and ``batch`` change the speed, not the results."""

    count: int  # E
    seed: int  # of the first; episode e is the first one of world seed + e
    threads: int = 1
    batch: int = 128  # worlds that run at once
    on_step: Callable[[int], None] | None = None  # called with the number of env steps done at each step, for progress bars

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"episodes must be at least 1, got {self.count}")

    def begin(self, task: Task) -> Iterator[tuple[slice, Simulation]]:
        """Batch by batch the rows (of E) and their worlds, at the start of the episode."""
        for first in range(0, self.count, self.batch):
            rows = slice(first, min(first + self.batch, self.count))
            simulation = Simulation(task.scenario, rows.stop - first, threads=self.threads, tracks=task.tracks)
            simulation.reset(self.seed + first)
            yield rows, simulation
            simulation.close()

    def tell(self, steps: int) -> None:
        """Report env steps that were just done."""
        if self.on_step is not None:
            self.on_step(steps)
