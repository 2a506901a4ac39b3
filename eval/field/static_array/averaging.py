"""Several pings of a tag that hardly moves as one: what rounded arrival times need before they make a position.

The arrivals of the pings of a block differ by a shift each and by noise. The best common arrivals under each ping's information
matrix are a weighted mean, and their information is the sum; receivers may be missing from any ping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.model import Floats, Pings, arrival_information
from tagtrack.eval.field.static_array.robust import add_variance

REFUSED_BEYOND = 9.0  # median absolute residuals: six standard deviations of a Gaussian
PASSES = 4


@dataclass(frozen=True, kw_only=True)
class Blocks:
    """B rows that stand for several pings each: ``pings`` at their mean time, NaN for receivers without a difference;
    ``information`` (B, R, R) [1/s^2]; ``count`` (B,) of the pings that made them."""

    pings: Pings
    information: Floats
    count: NDArray[np.int64]


def number_by_count(pings: Pings, count: int, least_receivers: int) -> NDArray[np.int64]:
    """Block (K,) of each ping: as few blocks as hold no more than ``count`` pings heard by at least ``least_receivers``.

    They share those evenly, so that none is left with a few. Pings heard by fewer go with those around them: they sharpen a
    block, but would not make one.
    """
    if count < 1:
        raise ValueError(f"a block takes at least one ping, got {count}")
    full = pings.heard.sum(axis=1) >= least_receivers
    total = int(full.sum())
    blocks = max(-(-total // count), 1)
    return np.minimum((np.cumsum(full) - full) * blocks // max(total, 1), blocks - 1)


def number_by_time(pings: Pings, seconds: float) -> NDArray[np.int64]:
    """Block (K,) of each ping, one for each whole interval of ``seconds`` since the epoch, as days begin at midnight UTC."""
    if not seconds > 0:
        raise ValueError(f"the time of a block must be positive, got {seconds} s")
    return np.floor(pings.time / seconds).astype(np.int64)


def average_pings(pings: Pings, block: NDArray[np.int64], sigma: float, systematic: float = 0.0) -> Blocks:
    """One row for each block of pings.

    Arrivals that lie far from what their block agrees on (multipath) are left out, at most one of a ping in each pass. Pings
    heard by a single receiver tell no difference and are left out.

    Args:
        pings: of one tag. block: (K,) rising, as ``number_by_count`` and ``number_by_time`` give it.
        sigma: of one arrival time [s].
        systematic: standard deviation of what averaging does not remove, for each receiver [s]: the rest of its clock's drift,
            an error of its place over the speed of sound.
    """
    several = pings.heard.sum(axis=1) >= 2
    time, arrival = pings.time[several], pings.arrival[several]
    relative = arrival - time[:, None]
    _, first, member, count = np.unique(block[several], return_index=True, return_inverse=True, return_counts=True)
    heard = np.isfinite(relative)
    common, information = _agree(relative, heard, sigma, first)
    for _ in range(PASSES):
        wrong = _far_off(relative, heard, common[member])
        if not wrong.any():
            break
        heard &= ~wrong
        common, information = _agree(relative, heard, sigma, first)
    touched = np.diagonal(information, axis1=1, axis2=2) > 0
    if systematic:
        information = add_variance(information, np.where(touched, systematic**2, 0.0))
    begin = time[0] if time.size else 0.0
    middle = begin + (np.add.reduceat(time - begin, first) / count if time.size else time)
    earliest = np.min(common, axis=1, keepdims=True, where=touched, initial=np.inf)
    arrival = middle[:, None] + np.where(touched, common - np.where(np.isfinite(earliest), earliest, 0.0), np.nan)
    height = None
    if pings.height is not None:
        height = np.add.reduceat(pings.height[several], first) / count if time.size else time
    return Blocks(pings=Pings(time=middle, arrival=arrival, height=height), information=information, count=count)


def _agree(relative: Floats, heard: NDArray[np.bool_], sigma: float, first: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Best common arrivals (B, R) [s], up to a shift, and their information (B, R, R), of blocks that begin at rows ``first``."""
    if not len(first):
        return np.empty((0, heard.shape[1])), np.empty((0, heard.shape[1], heard.shape[1]))
    each = arrival_information(heard, sigma)
    information = np.add.reduceat(each, first, axis=0)
    pull = np.add.reduceat(np.einsum("kab,kb->ka", each, np.where(heard, relative, 0.0)), first, axis=0)
    inverse = np.linalg.pinv(information, rcond=1e-9, hermitian=True)
    return np.einsum("kab,kb->ka", inverse, pull), information


def _far_off(relative: Floats, heard: NDArray[np.bool_], common: Floats) -> NDArray[np.bool_]:
    """Which arrivals (K, R) to leave out: of each ping the worst, if it is far from what its block agrees on."""
    residual = np.where(heard, relative - common, np.nan)
    several = heard.sum(axis=1) >= 2
    wrong = np.zeros_like(heard)
    if not several.any():
        return wrong
    residual[several] -= np.nanmedian(residual[several], axis=1, keepdims=True)
    usual = np.nanmedian(np.abs(residual[several]))
    size = np.where(np.isfinite(residual), np.abs(residual), 0.0)
    worst = size.argmax(axis=1)
    rows = np.flatnonzero(several & (size.max(axis=1) > REFUSED_BEYOND * max(usual, 1e-9)))
    wrong[rows, worst[rows]] = True
    return wrong
