"""All clocks at once: polynomials by segment and their offsets, from all receptions of the sync tags (steps iii and iv).

Masmitja et al. 2020 fit each pair of receivers for itself. Here one least squares problem holds them all: a reception is the
transmission time of its ping, plus what sound takes, plus the receiver's clock,

    t = e_ping + tau_{tag, receiver} + C_receiver(t) + noise,

with C = 0 for the reference. C is a polynomial by segment whose pieces join smoothly (a spline with knots at the limits of
segments). Transmission times are many and are not solved for: taking the mean of each ping off its equations removes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, PPoly
from scipy.sparse import coo_array, csr_array, hstack

from tagtrack.eval.field.static_array.detections import Codes
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.static_array.outliers import is_regular
from tagtrack.eval.field.static_array.travel import TravelTimes

DAY = 86400.0
POINTS_FOR_COEFFICIENT = 5  # fewer in a segment join it to the next one; fewer in all lower the degree
SMALLEST_CUT = 1e-3  # no reception is an outlier that fits this well [s]
MOST_ROUNDS = 20  # of leaving outliers out
NEGLIGIBLE = 1e-9  # eigenvalue of the scaled normal matrix, as a share of the largest


@dataclass(frozen=True, kw_only=True)
class Receptions:
    """N receptions of sync tags that were matched to pings of at least two receivers."""

    ping: NDArray[np.intp]  # (N,) from 0, without gaps
    receiver: Codes  # (N,)
    tag: Codes  # (N,)
    time: Floats  # (N,) on the receiver's clock [s]
    coarse: Floats  # (N,) on the reference's, roughly [s]

    def ping_mean(self, value: Floats, used: NDArray[np.bool_]) -> Floats:
        """Mean of the used values (N,) of each reception's ping (N,); NaN where none is used."""
        number = np.bincount(self.ping, used)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.bincount(self.ping, np.where(used, value, 0.0)) / number
        return np.asarray(mean[self.ping])

    def ping_median(self, value: Floats) -> Floats:
        """Median of the values (N,) of each reception's ping (N,)."""
        order = np.lexsort((value, self.ping))
        count = np.bincount(self.ping)
        start = np.cumsum(count) - count
        ranked = value[order]
        return np.asarray((ranked[start + (count - 1) // 2] + ranked[start + count // 2])[self.ping] / 2)


@dataclass(frozen=True, kw_only=True)
class Spline:
    """The clock of one receiver: a line plus a spline of ``degree``, over days since its first point."""

    line: Floats  # (2,) offset at the first point [s], and drift [s/day]
    begin: float  # first point [s, own clock]
    knots: Floats  # with the multiple ones at both ends [day]
    degree: int

    @property
    def columns(self) -> int:
        """How many coefficients it has."""
        return len(self.knots) - self.degree - 1

    def design(self, time: Floats) -> csr_array:
        """(N, columns) of times between the ends."""
        days = np.clip((time - self.begin) / DAY, self.knots[0], self.knots[-1])
        return csr_array(BSpline.design_matrix(days, self.knots, self.degree))

    def pieces(self, solution: Floats) -> tuple[Floats, Floats]:
        """Limits (S + 1,) [s, own clock] and coefficients (S, N + 1) of rising powers [s^(1-n)], as ``ClockModel`` takes them."""
        pieces = PPoly.from_spline((self.knots, solution, self.degree))
        real = np.flatnonzero(np.diff(pieces.x) > 0)
        limits = np.append(pieces.x[real], pieces.x[-1])
        rising = np.zeros((real.size, max(self.degree, 1) + 1))
        rising[:, : self.degree + 1] = pieces.c[::-1, real].T
        rising[:, 0] += self.line[0] + self.line[1] * limits[:-1]
        rising[:, 1] += self.line[1]
        return self.begin + limits * DAY, rising / DAY ** np.arange(rising.shape[1])


@dataclass(frozen=True, kw_only=True)
class Fit:
    """What the least squares fit found."""

    limits: dict[int, Floats]  # by receiver, as in ``ClockModel``
    coefficients: dict[int, Floats]
    residual: Floats  # (N,) [s]; of outliers too
    used: NDArray[np.bool_]  # (N,): not an outlier
    unknowns: int  # that the receptions determine: coefficients of clocks, travel times
    freedom: int  # used receptions less what was fitted
    undetermined: tuple[int, ...]  # receivers whose clock the data leave open


class Solution(NamedTuple):
    """Of a least squares problem of P unknowns."""

    value: Floats  # (P,), of least norm where unknowns are open
    rank: int
    open: NDArray[np.bool_]  # (P,): left open by the data


def spline_of(time: Floats, ahead: Floats, degree: int, segment: float | None) -> Spline:
    """A spline for a receiver's points (N,) [s], ``ahead`` (N,) [s] of the reference, with a knot each ``segment`` [s].

    A segment with too few points is joined to its neighbour, and too few points in all lower the degree.
    """
    begin, end = float(time.min()), float(time.max())
    degree = min(degree, max(time.size // POINTS_FOR_COEFFICIENT - 1, 0))
    days = (time - begin) / DAY
    length = max((end - begin) / DAY, 1e-6)
    inner: list[float] = []
    if segment is not None and np.isfinite(segment) and degree:
        least = POINTS_FOR_COEFFICIENT * (degree + 1)
        for limit in np.arange(segment / DAY, length, segment / DAY).tolist():
            last = inner[-1] if inner else 0.0
            if np.sum((days >= last) & (days < limit)) >= least and np.sum(days >= limit) >= least:
                inner.append(limit)
    knots = np.concatenate([np.zeros(degree + 1), inner, np.full(degree + 1, length)])
    slope, level = np.polyfit(days, ahead, 1) if degree else (0.0, float(np.mean(ahead)))
    return Spline(line=np.array([level, slope]), begin=begin, knots=knots, degree=degree)


def fit_clocks(
    receptions: Receptions, travel: TravelTimes, reference: int, *, degree: int = 3, segment: float | None = None
) -> Fit:
    """Fit all clocks, leave out what lies far off, and repeat until nothing changes.

    What is far off shows against the median of its ping. Of a ping of two receivers that disagree none can be told from the
    other; both are left out.

    Args:
        reference: the receiver whose clock is the time. degree: of the polynomials. segment: their length [s]; None for one.
    """
    splines, reduced = _reduce(receptions, travel, reference, degree, segment)
    design = _design(receptions, travel, splines)
    used = np.ones(reduced.size, dtype=np.bool_)
    for _ in range(MOST_ROUNDS):
        found = _solve(design, reduced, receptions.ping, used)
        misfit = reduced - design @ found.value
        kept = _regular(receptions, misfit - receptions.ping_median(misfit))
        if np.array_equal(kept, used):
            break
        used = kept
    mean = receptions.ping_mean(misfit, used)
    residual = misfit - np.where(np.isfinite(mean), mean, receptions.ping_median(misfit))
    limits, coefficients, undetermined, column = {}, {}, [], 0
    for receiver, spline in splines.items():
        own = slice(column, column + spline.columns)
        limits[receiver], coefficients[receiver] = spline.pieces(found.value[own])
        undetermined += [receiver] if found.open[own].any() else []
        column += spline.columns
    pings = np.unique(receptions.ping[used]).size
    return Fit(
        limits=limits,
        coefficients=coefficients,
        residual=residual,
        used=used,
        unknowns=found.rank,
        freedom=int(used.sum()) - pings - found.rank,
        undetermined=tuple(undetermined),
    )


def _reduce(
    receptions: Receptions, travel: TravelTimes, reference: int, degree: int, segment: float | None
) -> tuple[dict[int, Spline], Floats]:
    """A spline for each receiver but the reference, and times (N,) less its line, the known travel time and the mean of the ping.

    What is left is small: milliseconds beside 1.6e9 s would lose their digits.
    """
    splines = {}
    reduced = receptions.time.copy()
    for receiver in np.unique(receptions.receiver).tolist():
        rows = receptions.receiver == receiver
        if receiver != reference:
            time = receptions.time[rows]
            splines[receiver] = spline = spline_of(time, time - receptions.coarse[rows], degree, segment)
            reduced[rows] -= spline.line[0] + spline.line[1] * (time - spline.begin) / DAY
    reduced -= receptions.ping_mean(reduced, np.ones(reduced.size, dtype=np.bool_))
    return splines, reduced - travel.known[receptions.tag, receptions.receiver]


def _regular(receptions: Receptions, from_median: Floats) -> NDArray[np.bool_]:
    """Which receptions (N,) are no outliers among those of their receiver: a clock that no polynomial follows keeps its own."""
    kept = np.ones(from_median.size, dtype=np.bool_)
    for receiver in np.unique(receptions.receiver):
        rows = receptions.receiver == receiver
        kept[rows] = is_regular(from_median[rows], SMALLEST_CUT)
    return kept


def _design(receptions: Receptions, travel: TravelTimes, splines: dict[int, Spline]) -> csr_array:
    """(N, P): the coefficients of each receiver's spline, then the unknown travel times."""
    blocks = []
    for receiver, spline in splines.items():
        rows = np.flatnonzero(receptions.receiver == receiver)
        local = spline.design(receptions.time[rows]).tocoo()
        blocks.append(coo_array((local.data, (rows[local.row], local.col)), shape=(receptions.time.size, spline.columns)))
    number = travel.unknown[receptions.tag, receptions.receiver]
    rows = np.flatnonzero(number >= 0)
    blocks.append(coo_array((np.ones(rows.size), (rows, number[rows])), shape=(number.size, travel.count)))
    return csr_array(hstack(blocks))


def _solve(design: csr_array, value: Floats, ping: NDArray[np.intp], used: NDArray[np.bool_]) -> Solution:
    """Least squares over the used rows (N,) with a free level for each ping."""
    rows = np.flatnonzero(used)
    matrix, right, member = design[rows], value[rows], ping[rows]
    count = np.maximum(np.bincount(member), 1)
    sums = csr_array((np.ones(rows.size), (member, np.arange(rows.size))), shape=(count.size, rows.size))
    by_ping = sums @ matrix
    normal = (matrix.T @ matrix - by_ping.T @ by_ping.multiply(1 / count[:, None]).tocsr()).toarray()
    target = matrix.T @ right - by_ping.T @ ((sums @ right) / count)
    scale = np.sqrt(np.where(normal.diagonal() > 0, normal.diagonal(), 1.0))
    eigenvalue, vector = np.linalg.eigh(normal / np.outer(scale, scale))
    clear = eigenvalue > NEGLIGIBLE * max(float(eigenvalue.max(initial=0.0)), 1e-300)
    inverse = np.where(clear, 1 / np.where(clear, eigenvalue, 1.0), 0.0)
    solution = vector @ (inverse * (vector.T @ (target / scale))) / scale
    return Solution(solution, int(clear.sum()), np.any(np.abs(vector[:, ~clear]) > 1e-3, axis=1))
