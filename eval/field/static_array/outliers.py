"""What is too far off to be a regular error: more than six standard deviations, taken from the median absolute deviation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.model import Floats

CUT = 6.0  # standard deviations
TO_SIGMA = 1.4826  # of a normal error, from its median absolute deviation


def is_regular(deviation: Floats, smallest: float) -> NDArray[np.bool_]:
    """Which deviations from a median or a fit are no outliers; those up to ``smallest`` never are, rounding among them."""
    size = np.abs(deviation)
    return np.asarray(size <= max(CUT * TO_SIGMA * float(np.median(size)), smallest))
