"""How finely the clocks bend: the length of the segments that get a polynomial each, chosen by the data (step iii).

One polynomial over all the time is halved again and again; of these the fit with the smallest Bayesian information criterion
(Schwarz 1978) is taken. All are judged by the receptions that the finest one takes for regular: a stiff clock calls many outliers
that only show how it bends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.clock_fit import Fit, Receptions, fit_clocks
from tagtrack.eval.field.static_array.travel import TravelTimes

SHORTEST_SEGMENT = 86400.0  # [s]; what goes and comes within a day is the water rather than a clock
MOST_UNKNOWNS = 1000  # of all clocks together: solving takes their cube
WHOLE = float("inf")  # one segment


def fit_by_segments(receptions: Receptions, travel: TravelTimes, reference: int, *, degree: int) -> tuple[float, Fit]:
    """The length of segments [s] that the data ask for, ``WHOLE`` for one polynomial, and the fit with it."""
    lengths = candidate_lengths(receptions, degree)
    fits = [fit_clocks(receptions, travel, reference, degree=degree, segment=length) for length in lengths]
    judged = fits[-1].used
    best = int(np.argmin([_criterion(receptions, fit, judged) for fit in fits]))
    return lengths[best], fits[best]


def candidate_lengths(receptions: Receptions, degree: int) -> list[float]:
    """Lengths of segments [s] to try, the whole first, each then half the one before."""
    span = float(np.ptp(receptions.coarse))
    clocks = np.unique(receptions.receiver).size - 1
    lengths, pieces = [WHOLE], 2
    while span / pieces >= SHORTEST_SEGMENT and clocks * (pieces + degree) <= MOST_UNKNOWNS:
        lengths.append(span / pieces)
        pieces *= 2
    return lengths


def _criterion(receptions: Receptions, fit: Fit, judged: NDArray[np.bool_]) -> float:
    """Of the receptions ``judged`` (N,), whose pings' transmission times cost nothing, since every fit has them."""
    free = int(judged.sum()) - np.unique(receptions.ping[judged]).size
    square = float(np.sum(fit.residual[judged] ** 2))
    return free * np.log(max(square, 1e-300) / max(free, 1)) + fit.unknowns * np.log(max(free, 2))
