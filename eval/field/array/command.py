"""`tagtrack eval array`: one command each for what is done with moored receivers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from tagtrack.eval.field.array.locate import Locate
from tagtrack.eval.field.array.simulate import Simulate
from tagtrack.eval.field.array.survey import Survey
from tagtrack.eval.field.array.sync import Sync
from tagtrack.eval.field.array.tracks import Tracks

Step = (
    Annotated[Simulate, tyro.conf.subcommand("simulate")]
    | Annotated[Sync, tyro.conf.subcommand("sync")]
    | Annotated[Survey, tyro.conf.subcommand("survey")]
    | Annotated[Locate, tyro.conf.subcommand("locate")]
    | Annotated[Tracks, tyro.conf.subcommand("tracks")]
)


@dataclass(frozen=True, kw_only=True)
class Array:
    """Locate tags by moored receivers."""

    step: Step
    """What to do."""

    def run(self) -> None:
        """Run it."""
        self.step.run()
