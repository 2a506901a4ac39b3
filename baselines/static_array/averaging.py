"""Several pings as one, for animals that hardly move between them and clocks that tick coarsely.

Field recorders round: the arrivals of Masmitja et al. 2020 are printed to 10 ms, up to 7.6 m in one ping. The mean of many is
finer, because each ping comes at another fraction of a tick. Pings heard by different receivers add up as their information does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tagtrack.baselines.static_array.model import ArraySetting, Floats, Pings, arrival_information, full_pairs

OUTLYING = 4.0  # robust standard deviations of a difference from its median
NORMAL_MAD = 1.4826  # standard deviation of a Gaussian over its median absolute deviation


def average_pings(pings: Pings, count: int, setting: ArraySetting) -> tuple[Pings, Floats]:
    """One synthetic ping for each block of ``count`` consecutive pings, the last block possibly shorter.

    Arrivals that most of their differences call an outlier within the block are left out: differences more than 4 standard
    deviations from their median, by the spread within the block or by ``setting.sigma``, whichever is larger.

    Args:
        pings: arrivals (K, R) [s].
        count: pings in a block.
        setting: its ``sigma`` [s] is that of one arrival. Rounding counts (tick / sqrt 12): without it the ticks beside the
            median one are thrown out as outliers.
    Returns:
        Pings: ceil(K / count) of them, ``time`` the mean of the block, ``arrival`` NaN for a receiver that heard none of it with
        another; the first at ``time``. Information (ceil(K / count), R, R) [1/s^2]: the sum of that of the pings.
    Raises:
        ValueError: if ``count`` is not positive.
    """
    if count < 1:
        raise ValueError(f"count must be at least 1 ping, got {count}")
    number, receivers = pings.arrival.shape
    blocks = -(-number // count)
    padded = np.full((blocks * count, receivers), np.nan)
    padded[:number] = pings.arrival - pings.time[:, None]
    arrival = padded.reshape(blocks, count, receivers)
    arrival = np.where(_outlying(arrival, setting.sigma), np.nan, arrival)
    each = arrival_information(np.isfinite(arrival), setting.sigma)
    information = each.sum(axis=1)
    # The arrivals that fit all pings of the block best when each has its own time of transmission.
    known = np.einsum("pkab,pkb->pa", each, np.nan_to_num(arrival))
    mean = np.einsum("pab,pb->pa", np.linalg.pinv(information, rcond=1e-9, hermitian=True), known)
    mean[~(np.diagonal(information, axis1=1, axis2=2) > 0)] = np.nan
    edges = np.arange(0, number, count)
    size = np.diff(edges, append=number)
    start = pings.time[edges]
    time = start + np.add.reduceat(pings.time - start.repeat(size), edges) / size
    first = np.min(mean, axis=1, keepdims=True, where=np.isfinite(mean), initial=np.inf)
    return Pings(time=time, arrival=time[:, None] + mean - first), information


def _outlying(arrival: Floats, sigma: float) -> NDArray[np.bool_]:
    """(P, count, R): arrivals most of whose differences from the others of their ping lie far from the median of the block."""
    receivers = arrival.shape[2]
    against, present = np.zeros(arrival.shape), np.zeros(arrival.shape)
    for one, other in full_pairs(receivers):
        difference = arrival[..., one] - arrival[..., other]
        centre = _median(difference)
        deviation = np.abs(difference - centre)
        spread = np.maximum(NORMAL_MAD * _median(deviation), np.sqrt(2) * sigma)
        for receiver in (one, other):
            against[..., receiver] += deviation > OUTLYING * spread
            present[..., receiver] += np.isfinite(difference)
    return against > 0.5 * present


def _median(value: Floats) -> Floats:
    """Median (P, 1) along the pings of each block (P, count), NaN left out; NaN where there is nothing else."""
    ordered = np.sort(value, axis=1)  # NaN last
    present = np.isfinite(value).sum(axis=1, keepdims=True)
    low, high = (np.take_along_axis(ordered, np.maximum(index, 0), axis=1) for index in ((present - 1) // 2, present // 2))
    return np.where(present > 0, 0.5 * (low + np.where(present % 2 == 1, low, high)), np.nan)
