"""Runs cells, wherever that is, and gives back what they found in the order in which they were named."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from tagtrack.eval.cells.cell import Cell, Done, Parcel, pack
from tagtrack.eval.cells.kept import Kept
from tagtrack.eval.cells.local import run_here, run_in_processes
from tagtrack.eval.cells.on_ray import run_on_ray

Advance = Callable[[str, int], None]  # name of a cell, units just done


@dataclass(frozen=True, kw_only=True)
class Engine:
    """What cells run on.

    Args:
        kind: processes of this machine (``local``), or tasks of Ray.
        processes: how many cells run at once; None: one, in this process, or as many as a cluster has cores.
        address: of a Ray cluster; None: that of ``RAY_ADDRESS``, or one of this machine alone.
        kept: where results are kept until all are there.
        patient: on Ctrl-C processes are waited for, which heed it themselves.
    """

    kind: Literal["local", "ray"] = "local"
    processes: int | None = None
    address: str | None = None
    kept: Kept | None = None
    patient: bool = False

    def run(
        self, cells: Sequence[Cell], advance: Advance | None = None, take: Callable[[int, Done], None] | None = None
    ) -> list[Done]:
        """What each cell gave back.

        Args:
            advance: is told of what is being done. take: is given the number of each cell and its result as soon as it is there.
        Raises:
            ValueError: for a cell that cannot travel, where it has to. OSError: where processes or nodes are lost again and
            again. ConnectionError: where no cluster answers. Whatever a cell raises; the others are then given up.
        """
        shown = _Shown(cells, advance)
        parcels = self._pack(cells)
        found = self._find(parcels)
        for number in found:
            shown.report(number, cells[number].units)
        if found and len(found) < len(cells):
            print(f"{len(found)} of {len(cells)} parts were done before: going on from there", file=sys.stderr)
        for number, done in self._run({k: cells[k] for k in range(len(cells)) if k not in found}, parcels, shown.report):
            found[number] = done
            if take is not None:
                take(number, done)
            shown.report(number, cells[number].units)
            if self.kept is not None and number in parcels:
                self.kept.keep(parcels[number], done)
        return [found[number] for number in range(len(cells))]

    @property
    def alone(self) -> bool:
        """Whether cells run in this process."""
        return self.kind == "local" and (self.processes or 1) == 1

    def _pack(self, cells: Sequence[Cell]) -> dict[int, Parcel]:
        """Those that must travel or may be kept."""
        parcels: dict[int, Parcel] = {}
        for number, cell in enumerate(cells if self.kept is not None or not self.alone else ()):
            try:
                parcels[number] = pack(cell)
            except ValueError:
                if not self.alone:
                    raise
        return parcels

    def _find(self, parcels: Mapping[int, Parcel]) -> dict[int, Done]:
        """What an earlier command left."""
        if self.kept is None:
            return {}
        found = {number: self.kept.find(parcel) for number, parcel in parcels.items()}
        return {number: done for number, done in found.items() if done is not None}

    def _run(
        self, cells: Mapping[int, Cell], parcels: Mapping[int, Parcel], report: Callable[[int, int], None]
    ) -> Iterator[tuple[int, Done]]:
        if not cells:
            return iter(())
        if self.alone:
            return run_here(cells, report)
        chosen = {number: parcels[number] for number in cells}
        if self.kind == "ray":
            return run_on_ray(chosen, self.address, self.processes, report)
        return run_in_processes(chosen, self.processes or 1, report, patient=self.patient)


class _Shown:
    """Turns what cells have done in all, some of it twice, into what a progress bar is told."""

    def __init__(self, cells: Sequence[Cell], advance: Advance | None) -> None:
        self.cells, self.advance = cells, advance
        self.done = [0] * len(cells)

    def report(self, number: int, total: int) -> None:
        units = min(total, self.cells[number].units) - self.done[number]
        if units > 0 and self.advance is not None:
            self.done[number] += units
            self.advance(self.cells[number].name, units)
