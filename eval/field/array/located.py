"""Where a tag was: what `array locate` and `tracks` tell of its pings, and what a person should know of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.model import Floats, Pings, Positions


@dataclass(frozen=True, kw_only=True)
class Located:
    """One tag: K rows of positions, each of one ping or of several averaged."""

    tag: str
    heard: int  # pings, by at least one receiver
    pings: Pings  # K rows with their arrivals
    count: NDArray[np.int64]  # (K,) pings in each row
    positions: Positions  # NaN where not located
    sigma: float  # of an arrival [s]
    removed: int  # arrivals that no place explains, or that disagree with the others
    misfit: Floats  # (K,) root of the cost per spare arrival, 1 as expected; NaN where none is to spare
    other: Floats  # (K, n) another place that explains the ping as well [m]; NaN where there is none
    other_covariance: Floats  # (K, n, n) of that [m^2]
    without_height: int = 0  # pings left out, where heights are known of some
    interval: float | None = None  # that the tag waits between two pings [s]
    crossing: float = 0.0  # longest time sound takes from one receiver to another [s]

    @property
    def known(self) -> NDArray[np.bool_]:
        """(K,) bool: which rows have a position."""
        return np.asarray(np.isfinite(self.positions.position).all(axis=1))

    @property
    def ambiguous(self) -> NDArray[np.bool_]:
        """(K,) bool: which rows have another place."""
        return np.asarray(np.isfinite(self.other).all(axis=1))

    @property
    def sd(self) -> Floats:
        """(K, n) standard deviations [m] along x and y, and z where it is estimated."""
        return np.sqrt(np.diagonal(self.positions.covariance, axis1=1, axis2=2))

    @property
    def overlapping(self) -> bool:
        """Whether the tag pings again before all receivers can have heard its ping, so that pings may be mixed up."""
        return self.interval is not None and self.interval < self.crossing

    @property
    def remarks(self) -> list[str]:
        """Sentences for the user; none where all is as it should be."""
        remarks = []
        if self.overlapping:
            remarks.append(
                f"{self.tag} pings each {self.interval:.2f} s, sooner than sound crosses the array ({self.crossing:.2f} s): "
                "receptions of several pings may be taken for one; give --receivers of one part of the array at a time, less wide"
            )
        if self.without_height:
            left_out = f"{self.without_height} pings of {self.tag} are left out"
            remarks.append(f"{left_out}: no depth was read within ten minutes of them")
        return remarks

    @property
    def height(self) -> Floats | None:
        """(K,) of the tag [m], estimated or known; None where positions are in a plane."""
        if self.positions.position.shape[1] == 3:
            return self.positions.position[:, 2]
        return self.pings.height
