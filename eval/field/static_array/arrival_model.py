"""The joint density of a track, its transmission times and the arrivals, for YAPS (Baktoft et al. 2017): sparse in a narrow band.

A row is a ping that was heard or, of a regular tag, one that was missed between two heard ones. Its state is the position and
c times the transmission time, so that all of it is metres; rows in order make every matrix banded: 2(n+1) below the diagonal for
a regular tag, n+1 for one of random intervals. Transmission times of the latter get no prior: YAPS bounds its intervals from
below and above, which to arrivals known within milliseconds tells nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.special import gammaln

from tagtrack.eval.field.static_array.model import Floats, Pings

LONGEST_GAP = 200  # intervals of a regular tag; past it the phase counts as lost and the times start anew
DIFFUSE = 1e5  # [m], deviation of the prior that keeps a state determined on which no arrival bears
OUTLIERS, TAIL_SCALE, TAIL_DEGREES = 0.05, 10.0, 3.0  # of the robust errors: share, width in sigma, and Student's nu
MOST_STEPS, MOST_HALVINGS = 60, 12
SHORTEST_INTERVAL = 1e-3  # [s]; two rows of one time still have a motion between them
CONVERGED = 1e-2  # minus the log density that a last step would still gain


@dataclass(frozen=True, kw_only=True)
class Scales:
    """What YAPS estimates beside the track."""

    diffusivity: float  # D_xy [m^2/s]
    sigma: float  # of an arrival [s]
    interval_sigma: float  # sigma_bt, of the change from one interval to the next [s]


@dataclass(frozen=True, kw_only=True)
class Rows:
    """N rows: heard pings in their places, missed pings between them."""

    time: Floats  # (N,) about when, from the first [s]; where transmission times are counted from
    arrival: Floats  # (N, R) likewise, NaN where not heard
    heard_row: NDArray[np.intp]  # (K,) the row of each ping
    chained: NDArray[np.bool_]  # (N,) interval before a row and interval before that are alike; never for random intervals
    rise: Floats | None = None  # (N, R) of the tag above each receiver, where it is known and positions are horizontal [m]


def lay_out(pings: Pings, interval: float | None, rise: Floats | None = None) -> Rows:
    """Rows of the pings; for a regular tag of that interval [s], also those it missed. ``rise`` (K, R) [m] as of ``Rows``."""
    time = pings.time - pings.time[0]
    arrival = pings.arrival - pings.time[0]
    if interval is None:
        none = np.zeros(len(time), dtype=bool)
        return Rows(time=time, arrival=arrival, heard_row=np.arange(len(time)), chained=none, rise=rise)
    steps = np.maximum(np.round(np.diff(time) / interval), 1).astype(np.intp)
    lost = steps > LONGEST_GAP
    steps[lost] = 1
    heard_row = np.concatenate([[0], np.cumsum(steps)])
    count = heard_row[-1] + 1
    spread = np.full((count, arrival.shape[1]), np.nan)
    spread[heard_row] = arrival
    chained = np.arange(count) >= 2
    for row in heard_row[1:][lost]:  # an interval of unknown length ends here
        chained[row : row + 2] = False
    if rise is not None:
        row = np.arange(count)
        rise = np.stack([np.interp(row, heard_row, column) for column in rise.T], axis=1)
    sent = np.interp(np.arange(count), heard_row, time)
    return Rows(time=sent, arrival=spread, heard_row=heard_row, chained=chained, rise=rise)


class ArrivalModel:
    """Minus the log of the joint density of states (N, n+1) and arrivals, and its Gauss-Newton curvature."""

    def __init__(self, rows: Rows, places: Floats, sound_speed: float, *, robust: bool) -> None:
        self.rows, self.places, self.sound_speed, self.robust = rows, places, sound_speed, robust
        self.heard = np.isfinite(rows.arrival)
        self.range_sum = np.where(self.heard, sound_speed * (rows.arrival - rows.time[:, None]), 0.0)  # [m]
        self.block = places.shape[1] + 1
        self.band = self.block * (2 if rows.chained.any() else 1)
        self.interval = np.maximum(np.diff(rows.time), SHORTEST_INTERVAL)
        self.second_row = np.flatnonzero(rows.chained)
        self.curve_of_time = sound_speed * np.diff(rows.time, 2)[self.second_row - 2]  # [m], of the rows' own times
        self.middle = places.mean(axis=0)

    def cost(self, state: Floats, scales: Scales) -> float:
        """Minus the log density, with all that depends on the scales."""
        residual = self._residuals(state)[0] / (self.sound_speed * scales.sigma)
        value = float(np.sum(self._loss(residual)[0][self.heard])) + self.heard.sum() * np.log(scales.sigma)
        variance = 2 * scales.diffusivity * self.interval
        step = np.diff(state[:, :-1], axis=0)
        value += 0.5 * float(np.sum(step**2 / variance[:, None]))
        value += 0.5 * (self.block - 1) * float(np.sum(np.log(2 * np.pi * variance)))
        change = self._interval_changes(state) / (self.sound_speed * scales.interval_sigma)
        value += 0.5 * float(change @ change) + len(change) * np.log(np.sqrt(2 * np.pi) * scales.interval_sigma)
        offset = np.concatenate([state[:, :-1] - self.middle, state[:, -1:]], axis=1) / DIFFUSE
        return value + 0.5 * float(np.sum(offset**2))

    def curvature(self, state: Floats, scales: Scales) -> tuple[Floats, Floats]:
        """Gradient (N (n+1),) and lower band of the curvature (band + 1, N (n+1)), outliers by their weight."""
        residual, towards = self._residuals(state)
        unit = self.sound_speed * scales.sigma
        weight = np.where(self.heard, self._loss(residual / unit)[1], 0.0) / unit**2
        block, count = self.block, len(state)
        own = np.einsum("kr,kra,krb->kab", weight, towards, towards)
        gradient = -np.einsum("kr,kr,kra->ka", weight, residual, towards)
        gradient += np.concatenate([state[:, :-1] - self.middle, state[:, -1:]], axis=1) / DIFFUSE**2
        banded = np.zeros((self.band + 1, count, block))
        for a in range(block):
            for b in range(a + 1):
                banded[a - b, :, b] = own[:, a, b]
        banded[0] += 1 / DIFFUSE**2
        tie = (1 / (2 * scales.diffusivity * self.interval))[:, None]
        pull = tie * np.diff(state[:, :-1], axis=0)
        for rows, sign in ((slice(1, None), 1), (slice(None, -1), -1)):
            banded[0, rows, :-1] += tie
            gradient[rows, :-1] += sign * pull
        banded[block, :-1, :-1] -= tie
        if self.second_row.size:
            self._add_interval_changes(state, scales, gradient, banded)
        return gradient.reshape(-1), banded.reshape(self.band + 1, -1)

    def minimize(self, state: Floats, scales: Scales) -> tuple[Floats, float, Floats]:
        """The most likely states from a start, minus their log density, and the Cholesky band of the curvature there."""
        cost = self.cost(state, scales)
        for _ in range(MOST_STEPS):
            gradient, banded = self.curvature(state, scales)
            factor = _factorize(banded)
            step = cho_solve_banded((factor, True), gradient, check_finite=False)
            expected = 0.5 * float(gradient @ step)
            step = step.reshape(state.shape)
            if expected < CONVERGED:
                return state - step, cost - expected, factor
            for halving in range(MOST_HALVINGS):
                candidate = state - 0.5**halving * step
                new_cost = self.cost(candidate, scales)
                if new_cost <= cost:
                    break
            else:
                break
            state, cost = candidate, new_cost
        return state, cost, factor

    def start(self, position: Floats) -> Floats:
        """States at given positions (N, n), each transmission time where the median of its arrivals puts it."""
        distance = self._distances(position[:, None] - self.places)
        sent = np.full(len(position), np.nan)
        heard = self.heard.any(axis=1)
        sent[heard] = np.nanmedian(np.where(self.heard, self.range_sum - distance, np.nan)[heard], axis=1)
        row = np.arange(len(position))
        return np.concatenate([position, np.interp(row, row[heard], sent[heard])[:, None]], axis=1)

    def _residuals(self, state: Floats) -> tuple[Floats, Floats]:
        """(N, R) [m], and what a state's change adds to the predicted (N, R, n+1)."""
        offset = state[:, None, :-1] - self.places
        distance = self._distances(offset)
        residual = np.where(self.heard, self.range_sum - state[:, -1:] - distance, 0.0)
        towards = np.ones((*distance.shape, self.block))
        towards[..., :-1] = offset / np.maximum(distance, 1e-6)[..., None]
        return residual, towards

    def _distances(self, offset: Floats) -> Floats:
        """(N, R) [m] for offsets (N, R, n) from the receivers."""
        square = np.einsum("kra,kra->kr", offset, offset)
        return np.asarray(np.sqrt(square if self.rows.rise is None else square + self.rows.rise**2))

    def _loss(self, z: Floats) -> tuple[Floats, Floats]:
        """Minus the log density of an error of z sigma, and its slope over z."""
        square = z**2
        gauss = -0.5 * square - 0.5 * np.log(2 * np.pi)
        if not self.robust:
            return -gauss, np.ones_like(z)
        nu = TAIL_DEGREES
        peak = gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * np.log(nu * np.pi) - np.log(TAIL_SCALE)
        tail = peak - (nu + 1) / 2 * np.log1p(square / (nu * TAIL_SCALE**2)) + np.log(OUTLIERS)
        core = gauss + np.log1p(-OUTLIERS)
        both = np.logaddexp(core, tail)
        in_tail = np.exp(tail - both)
        return -both, 1 - in_tail + in_tail * (nu + 1) / (nu * TAIL_SCALE**2 + square)

    def _interval_changes(self, state: Floats) -> Floats:
        sent = state[:, -1]
        row = self.second_row
        return self.curve_of_time + sent[row] - 2 * sent[row - 1] + sent[row - 2]

    def _add_interval_changes(self, state: Floats, scales: Scales, gradient: Floats, banded: Floats) -> None:
        tie = 1 / (self.sound_speed * scales.interval_sigma) ** 2
        change = tie * self._interval_changes(state)
        for back, factor in ((0, 1), (1, -2), (2, 1)):  # each row is there once: += on an index array adds all
            rows = self.second_row - back
            gradient[rows, -1] += factor * change
            banded[0, rows, -1] += factor**2 * tie
        for later, earlier, factor in ((0, 1, -2), (1, 2, -2), (0, 2, 1)):
            banded[(earlier - later) * self.block, self.second_row - earlier, -1] += factor * tie


def _factorize(banded: Floats) -> Floats:
    try:
        return cholesky_banded(banded, lower=True, check_finite=False)
    except LinAlgError:  # rounding, where a scale is extreme
        raised = banded.copy()
        raised[0] *= 1 + 1e-8
        return cholesky_banded(raised, lower=True, check_finite=False)


def invert_blocks(factor: Floats, block: int) -> Floats:
    """Diagonal blocks (N, block, block) of a banded matrix's inverse, from its lower Cholesky band (Takahashi et al. 1973)."""
    band, size = factor.shape[0] - 1, factor.shape[1]
    window = np.zeros((band + 1, band + 1))  # of the inverse, from the running row on
    blocks = np.empty((size // block, block, block))
    below = factor[1:] / factor[0]
    for row in range(size - 1, -1, -1):
        window[1:, 1:] = window[:-1, :-1]
        side = -window[1:, 1:] @ below[:, row]
        window[0, 1:] = window[1:, 0] = side
        window[0, 0] = 1 / factor[0, row] ** 2 - below[:, row] @ side
        if row % block == 0:
            blocks[row // block] = window[:block, :block]
    return blocks
