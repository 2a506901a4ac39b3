"""`python -m eval array`: one command each for what is done with moored receivers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from tagtrack.eval.array.simulate import Simulate

Step = Annotated[Simulate, tyro.conf.subcommand("simulate")]


@dataclass(frozen=True, kw_only=True)
class Array:
    """Locate tags by moored receivers."""

    step: Step
    """What to do."""

    def run(self) -> None:
        """Run it."""
        self.step.run()
