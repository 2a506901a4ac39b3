"""Arrays and pings that the tests of the estimators share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tagtrack.eval.field.static_array.model import ArraySetting, Pings

Floats = NDArray[np.float64]

SETTING = ArraySetting()  # 1500 m/s, 1 ms
SQUARE = 100.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])  # baseline of 200 m, as in Fig. 2
SPACE = 100.0 * np.array([(-1, -1, 0.0), (1, -1, 0.3), (1, 1, -0.2), (-1, 1, 0.5), (0.2, -0.1, 1.5), (-0.5, 0.3, -1.0)])
EPOCH = 1.56e9  # 2019 [s]


def hear(
    position: ArrayLike, receivers: Floats, sigma: float = 0.0, seed: int = 0, time: ArrayLike = EPOCH, speed: float = 1500.0
) -> Pings:
    """Pings sent at ``time`` from positions (K, n), every one heard by every receiver, with Gaussian errors of ``sigma`` [s]."""
    where = np.asarray(position, dtype=np.float64)
    sent = np.broadcast_to(np.asarray(time, dtype=np.float64), where.shape[:1])
    arrival = sent[:, None] + np.linalg.norm(where[:, None] - receivers, axis=2) / speed
    arrival = arrival + np.random.default_rng(seed).normal(0.0, sigma, arrival.shape)
    return Pings(time=sent, arrival=arrival)


def deafen(pings: Pings, receivers: list[int]) -> Pings:
    """The same, not heard by some receivers."""
    arrival = pings.arrival.copy()
    arrival[:, receivers] = np.nan
    return Pings(time=pings.time, arrival=arrival)


def rmse(estimate: Floats, truth: ArrayLike) -> float:
    """Root-mean-square distance [m]."""
    return float(np.sqrt(np.mean(np.sum((estimate - np.asarray(truth)) ** 2, axis=-1))))
