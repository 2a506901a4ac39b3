"""What a receiver's clock shows against that of a reference receiver: a polynomial by segment (Masmitja et al. 2020, Eq. 18)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.eval.field.static_array.detections import Detections
from tagtrack.eval.field.static_array.model import Floats


@dataclass(frozen=True, kw_only=True)
class ClockModel:
    """How far a receiver's clock is ahead of the reference receiver's, as a function of its own time.

    In segment s that is sum_n ``coefficients[s, n]`` (t - ``limits[s]``)^n. Before the first limit and after the last, where
    no sync tag was heard, the tangent goes on: a polynomial of third degree would soon be seconds off.
    """

    receiver: str
    reference: str
    limits: Floats  # (S + 1,) where segments begin and the last ends [s, the receiver's own clock]
    coefficients: Floats  # (S, N + 1), of rising powers [s^(1-n)]
    points: int = 0  # receptions of sync tags that it rests on
    outliers: int = 0  # those left out
    rms: float = 0.0  # of the residuals of the points [s]

    def offset(self, time: ArrayLike) -> Floats:
        """What to take off times (...) on the receiver's clock [s]."""
        own = np.asarray(time, dtype=np.float64)
        inside = np.clip(own, self.limits[0], self.limits[-1])
        segment = np.clip(np.searchsorted(self.limits, inside, side="right") - 1, 0, len(self.coefficients) - 1)
        since = inside - self.limits[segment]
        value, slope = np.zeros_like(since), np.zeros_like(since)
        for column in range(self.coefficients.shape[1] - 1, -1, -1):  # Horner's scheme, the slope along with it
            slope = slope * since + value
            value = value * since + self.coefficients[segment, column]
        return np.asarray(value + slope * (own - inside))

    def correct(self, time: ArrayLike) -> Floats:
        """Times (...) on the receiver's clock as the reference's clock shows them [s] (Clk of Eq. 18)."""
        own = np.asarray(time, dtype=np.float64)
        return own - self.offset(own)

    def beyond(self, time: ArrayLike) -> int:
        """How many of the times lie outside the limits, where the clock is extrapolated."""
        own = np.asarray(time, dtype=np.float64)
        return int(np.sum((own < self.limits[0]) | (own > self.limits[-1])))

    def to_json(self) -> dict[str, Any]:
        """As ``clocks.json`` lists it."""
        return {
            "receiver": self.receiver,
            "reference": self.reference,
            "limits_s": self.limits.tolist(),
            "coefficients": self.coefficients.tolist(),
            "points": self.points,
            "outliers": self.outliers,
            "rms_s": self.rms,
        }


def correct(detections: Detections, models: Mapping[str, ClockModel]) -> Detections:
    """Detections as the reference's clock shows them, in order of time; those of receivers without a model are left out."""
    time = detections.time.copy()
    known = np.zeros(time.size, dtype=np.bool_)
    for index, receiver in enumerate(detections.receivers):
        if receiver in models:
            rows = detections.receiver == index
            known |= rows
            time[rows] = models[receiver].correct(detections.time[rows])
    order = np.flatnonzero(known)
    order = order[np.argsort(time[order], kind="stable")]
    return Detections(
        time=time[order],
        receiver=detections.receiver[order],
        tag=detections.tag[order],
        receivers=detections.receivers,
        tags=detections.tags,
    )
