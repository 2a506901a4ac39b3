"""What a command's parts run on, as options of a command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from tagtrack.eval.whole_number import OptionalWholeNumber

if TYPE_CHECKING:
    from tagtrack.eval.cells.engine import Engine


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """What the parts of the work run on. The results are the same bits, whatever it is; those of a command that was cut off
    are kept, and the same command goes on from them."""

    engine: Literal["local", "ray"] = "local"
    """Processes of this machine, or tasks of a Ray cluster, each on one core (extra: ray)."""
    processes: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(local: 1; ray: all cores)")] = None
    """Parts that run at once."""
    address: Annotated[
        str | None, tyro.conf.arg(metavar="HOST:PORT", help_behavior_hint="(RAY_ADDRESS, else this machine alone)")
    ] = None
    """Of the Ray cluster; auto for the one that runs on this machine."""

    def check(self) -> None:
        """Raise ValueError for what does not go together, ImportError where Ray is missing (as ``EpisodeOptions.check``)."""
        if self.processes is not None and self.processes < 1:
            raise ValueError(f"--processes must be at least 1, got {self.processes}")
        if self.engine == "local" and self.address is not None:
            raise ValueError(f"--address {self.address} goes with --engine ray; add that, or leave it out")
        if self.engine == "ray":
            from tagtrack.eval.cells.on_ray import import_ray

            import_ray()

    def require_default(self) -> None:
        """Raise ValueError where one is chosen and there is but one piece of work."""
        if self != EngineOptions():
            raise ValueError("--engine, --processes and --address go with --seeds: one run is one process")

    @contextmanager
    def open(self) -> Iterator[Engine]:
        """The engine, which keeps the results of finished cells for the next command like this one, until the block is done."""
        from tagtrack.eval.cells.engine import Engine
        from tagtrack.eval.cells.kept import Kept

        kept = Kept()
        yield Engine(kind=self.engine, processes=self.processes, address=self.address, kept=kept)
        kept.forget()
