"""What every twin of a paper's experiment gives back: rows that set a printed value beside ours, and pictures."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True)
class Row:
    """One printed value beside ours.

    The paper did its experiment once, the twin many times: ours is the median of those repetitions, and ``low`` to ``high`` their
    middle 95 %. A printed value within could be one of them.
    """

    paper: str
    table: str
    row: str
    column: str
    paper_value: float  # NaN where the paper prints no number
    ours: float
    low: float
    high: float
    unit: str
    note: str  # what is assumed, and why order or size differ where they do
    repeated: bool = True  # False: field data, whose interval says how sure ours is, not how the paper's might have come out

    def to_json(self) -> dict[str, Any]:
        """Plain values; null for a figure that is not finite."""
        plain = dataclasses.asdict(self)
        return {key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in plain.items()}


@dataclass(frozen=True, kw_only=True)
class Size:
    """How often experiments are repeated. The defaults are the full size."""

    recorded: int = 20  # missions recorded, over each of which filters run offline
    trials: int = 100  # of each filter over each recorded mission (Clark et al. 2013, section 7)
    moving: int = 60  # missions after a moving tag
    moving_seconds: int = 98 * 60  # [s] of each: auv2Track took 1 h 38 (Clark et al. 2013, Table IV)
    stationary: int = 400  # missions to a resting tag
    sharks: int = 60  # missions after a shark, of each length
    records: int = 200  # records of arrivals
    offline: int = 20  # trials of each combination of measurements over each recorded mission (Lin et al. 2013, V.E)
    astray: int = 400  # missions in which all particles are moved away
    particles: int = 1000
    settings: int = 30  # iterations of each setting of Fig. 3C (Masmitja et al. 2020, "AOTT simulations")
    settings_seconds: int = 60 * 60  # [s] of each; not printed
    tracked: int = 50  # iterations of Fig. 3D
    area_particles: int = 10_000  # of their filter


QUICK = Size(
    recorded=2, trials=4, moving=3, moving_seconds=600, stationary=8, sharks=2, records=4, offline=3, astray=40, particles=200,
    settings=3, settings_seconds=1800, tracked=4, area_particles=500,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What an experiment is given."""

    size: Size = Size()
    seed: int = 0
    threads: int = 1
    data: Path | None = None  # folder of the field data, for what is not simulated
    advance: Callable[[int], None] = field(default=lambda steps: None)  # told of the steps just done


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What an experiment gives back."""

    rows: Sequence[Row]
    figures: Mapping[str, Figure] = field(default_factory=dict)  # by file name, without its ending


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """The twin of one table or figure of a paper."""

    paper: str
    table: str
    run: Callable[[Setting], Findings]
    steps: Callable[[Size], int]  # how many it will report to ``Setting.advance``


def make_row(
    repetitions: ArrayLike,
    *,
    paper: str,
    table: str,
    row: str,
    column: str,
    paper_value: float = math.nan,
    unit: str,
    note: str,
) -> Row:
    """A row from one value for each repetition of the experiment (R,); without a printed value ours stands alone."""
    low, ours, high = np.quantile(np.asarray(repetitions, dtype=np.float64), (0.025, 0.5, 0.975)).tolist()
    return Row(
        paper=paper,
        table=table,
        row=row,
        column=column,
        paper_value=float(paper_value),
        ours=ours,
        low=low,
        high=high,
        unit=unit,
        note=note,
    )
