"""How exact arrivals are, from the pings themselves: what a position leaves unexplained where more was heard than it takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from tagtrack.eval.field.static_array.likelihood import make_likelihood
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings

LEAST_PINGS = 20  # with a spare arrival, to tell anything
MOST_PINGS = 4000


def estimate_sigma(pings: Pings, receivers: ArrayLike, setting: ArraySetting, information: Floats | None = None) -> float | None:
    """Standard deviation of an arrival time [s], robust against multipath; None where too few pings say anything.

    From the median of the least cost of pings with at least one difference more than a position takes: at the right sigma it is
    half the median of chi-square.

    Args:
        pings, receivers, setting, information: as the estimators take them; the sigma of ``setting`` is where it begins, and with
            ``information`` the result is by how much that is out, times ``setting.sigma``.
    """
    likelihood = make_likelihood(pings, receivers, setting, information)
    spare = likelihood.known_differences - likelihood.dimensions
    rows = np.flatnonzero(spare > 0)
    if rows.size < LEAST_PINGS:
        return None
    rows = rows[:: -(-rows.size // MOST_PINGS)]
    part = pings.take(rows)
    position = wls_ml(part, receivers, setting, information=None if information is None else information[rows]).position
    cost = likelihood.take(rows).cost(position)
    ratio = 2.0 * cost / chdtri(spare[rows], 0.5)
    known = ratio[np.isfinite(ratio)]
    if known.size < LEAST_PINGS:
        return None
    return float(setting.sigma * np.sqrt(max(np.median(known), 1e-6)))
