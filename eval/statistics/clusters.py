"""Which episodes tell the same: those whose fish swim the same stretch of a recorded track.

512 episodes of ten minutes out of one track of an hour are at most six that have nothing in common. Episodes are drawn anew by
windows of a stretch as long as an episode; as neighbouring windows still share steps, intervals are widened by what they share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from tagtrack.eval.statistics.estimate import Floats

FEWEST = 10  # windows without which there is no interval
MOST_COMPARED = 2048  # episodes whose overlaps are reckoned


@dataclass(frozen=True, kw_only=True)
class Clusters:
    """E episodes in C clusters."""

    label: NDArray[np.int64]  # (E,) from 0 to C - 1
    windows: float  # episodes without a common step that fit into the stretches, a fraction at each stretch's end
    widening: float  # variance of a mean over that of independent clusters: what neighbouring ones share
    animals: int

    @property
    def count(self) -> int:
        """C."""
        return int(self.label.max()) + 1

    @property
    def suffices(self) -> bool:
        """Whether there are enough for an interval."""
        return min(self.count, self.windows) >= FEWEST

    def reach(self, level: float) -> float:
        """By how much wider an interval is than that of a normal distribution over so many independent clusters."""
        few = stats.t.ppf(0.5 + level / 2, self.count - 1) / stats.norm.ppf(0.5 + level / 2)
        return float(few * math.sqrt(self.widening * self.count / (self.count - 1)))


def cluster_windows(start: NDArray[np.int64], last: NDArray[np.int64], steps: int, animals: int) -> Clusters:
    """Clusters of episodes that begin at rows of a table in which stretches follow each other.

    Args:
        start: (E, T) row at which each episode begins, for each of T tags; the first tag's window names the cluster.
        last: (G,) the row with which each stretch ends.
        steps: K, rows that an episode moves on; ``start`` leaves room for them.
    """
    first = np.concatenate([[0], last[:-1] + 1])
    stretch = np.searchsorted(last, start)
    cell = np.stack([stretch[:, 0], (start[:, 0] - first[stretch[:, 0]]) // steps])
    _, label = np.unique(cell, axis=1, return_inverse=True)
    label = label.reshape(-1)
    rows = last - first + 1
    return Clusters(
        label=label,
        windows=float((rows / steps).sum()),
        widening=_shared(start[:MOST_COMPARED], stretch[:MOST_COMPARED], label[:MOST_COMPARED], steps),
        animals=animals,
    )


def _shared(start: NDArray[np.int64], stretch: NDArray[np.int64], label: NDArray[np.int64], steps: int) -> float:
    """What all pairs of episodes share over what pairs of one cluster do."""
    shared: Floats = np.zeros((len(start), len(start)))
    for mine in range(start.shape[1]):
        for other in range(start.shape[1]):
            apart = np.abs(start[:, mine, None] - start[None, :, other]) / steps
            same = stretch[:, mine, None] == stretch[None, :, other]
            np.maximum(shared, np.where(same, 1.0 - apart, 0.0), out=shared)
    return float(shared.sum() / shared[label[:, None] == label[None]].sum())
