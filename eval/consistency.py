"""Is a belief as sure as it may be? Its covariance set against the error that it really made.

Three views of the same arrays: the normalized estimation error squared (Bar-Shalom et al. 2001, 5.4), which averages 2
for an honest belief in the plane; the share of time the truth lies inside the 50, 90 and 99 % ellipses; and the
proportions of Clark et al. 2013, Table II, which compare errors with standard deviations axis by axis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2

from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.estimate import Floats, Interval

PROBABILITIES = (0.5, 0.9, 0.99)

# No belief is taken at its word below this standard deviation [m]. After a resampling all particles may sit on one
# spot; a centimetre is far below any acoustic fix, so it changes nothing where the covariance is regular.
SMALLEST_SIGMA = 0.01

# Clark et al. 2013, Table II, as fractions; "the two AUV experiments", that is to say a tagged vehicle in the lagoon.
TABLE_II: Mapping[str, float] = MappingProxyType(
    {
        "ex_below_mean_sigma_x": 0.36,
        "ey_below_mean_sigma_y": 0.42,
        "ex_below_sigma_x": 0.22,
        "ey_below_sigma_y": 0.26,
        "e_below_sigma": 0.42,
    }
)


def normalized_error_squared(
    error: ArrayLike, covariance: ArrayLike, *, smallest_sigma: float = SMALLEST_SIGMA
) -> Floats:
    """Squared error in units of the belief's own uncertainty, e' P^-1 e.

    A singular covariance has no inverse, so the error is taken along the principal axes and no axis is believed to be
    shorter than `smallest_sigma`. Chi-square with two degrees of freedom (mean 2) if the belief is Gaussian and honest.

    Args:
        error: (..., 2) estimate minus truth [m].
        covariance: (..., 2, 2) of the belief [m^2]; only its lower triangle is read.
        smallest_sigma: lower bound on the standard deviation along either axis [m].
    Returns:
        (...,) without unit; NaN where the error or the covariance is.
    """
    error, covariance = np.asarray(error, dtype=np.float64), np.asarray(covariance, dtype=np.float64)
    if error.shape[-1:] != (2,) or covariance.shape[-2:] != (2, 2):
        raise ValueError(f"expected shapes (..., 2) and (..., 2, 2), got {error.shape} and {covariance.shape}")
    var_x, var_y, cov_xy = covariance[..., 0, 0], covariance[..., 1, 1], covariance[..., 1, 0]
    centre, radius = (var_x + var_y) / 2, np.hypot((var_x - var_y) / 2, cov_xy)  # of Mohr's circle
    angle = np.arctan2(2 * cov_xy, var_x - var_y) / 2  # from the x axis to the longer principal axis
    along = error[..., 0] * np.cos(angle) + error[..., 1] * np.sin(angle)
    across = error[..., 1] * np.cos(angle) - error[..., 0] * np.sin(angle)
    floor = smallest_sigma**2
    return along**2 / np.maximum(centre + radius, floor) + across**2 / np.maximum(centre - radius, floor)


def share_inside_ellipses(normalized: ArrayLike, probabilities: Sequence[float] = PROBABILITIES) -> Floats:
    """Share of steps on which the truth lies inside each ellipse.

    Args:
        normalized: (..., K) normalized error squared; NaN steps are left out.
    Returns:
        (..., P) one share per probability; NaN where there is no step at all.
    """
    normalized = np.asarray(normalized, dtype=np.float64)
    inside = normalized[..., None, :] <= chi2.ppf(probabilities, df=2)[:, None]
    steps = (~np.isnan(normalized)).sum(axis=-1)[..., None]
    return np.divide(inside.sum(axis=-1), steps, out=np.full(inside.shape[:-1], math.nan), where=steps > 0)


def table_ii_proportions(error: ArrayLike, covariance: ArrayLike) -> dict[str, Floats]:
    """How often the error was the smaller one (Clark et al. 2013, Table II).

    The paper leaves three things open. Errors are taken as absolute values; sigma_avg as the mean over the mission,
    which is here an episode; sigma as sqrt(sigma_x^2 + sigma_y^2), the spread of a position as e is the length of an
    error. With that reading e < sigma needs e_x < sigma_x or e_y < sigma_y, and the printed 42 % is indeed below
    22 % + 26 %.

    Args:
        error: (..., K, 2) estimate minus truth [m].
        covariance: (..., K, 2, 2) [m^2].
    Returns:
        The keys of `TABLE_II`, each (...,), as fractions of the steps that are not NaN.
    """
    error, covariance = np.abs(np.asarray(error, dtype=np.float64)), np.asarray(covariance, dtype=np.float64)
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    known = ~np.isnan(error).any(axis=-1) & ~np.isnan(variance).any(axis=-1)
    sigma = np.sqrt(np.where(known[..., None], variance, 0.0))
    steps = known.sum(axis=-1)
    distance, spread = np.hypot(error[..., 0], error[..., 1]), np.hypot(sigma[..., 0], sigma[..., 1])
    with np.errstate(invalid="ignore"):  # without any step a proportion is 0/0, NaN
        mean_sigma = sigma.sum(axis=-2, keepdims=True) / steps[..., None, None]
        below_mean, below = error < mean_sigma, error < sigma
        smaller = (below_mean[..., 0], below_mean[..., 1], below[..., 0], below[..., 1], distance < spread)
        shares = [(one & known).sum(axis=-1) / steps for one in smaller]
    return dict(zip(TABLE_II, shares, strict=True))


def summarize_consistency(
    error: ArrayLike, covariance: ArrayLike, *, bootstrap: Bootstrap | None = None
) -> dict[str, Interval]:
    """All of the above over E episodes, with intervals over episodes.

    Args:
        error: (E, K, 2) estimate minus truth [m]; NaN where an episode is over.
        covariance: (E, K, 2, 2) [m^2].
    Returns:
        `normalized_error_squared` (mean; 2 is honest, more is overconfident), `median_normalized_error_squared` (of
        each episode, averaged; 1.39 is honest, and a few lost minutes do not move it), `inside_50`, `inside_90`,
        `inside_99` and the keys of `TABLE_II`.
    """
    bootstrap = bootstrap or Bootstrap()
    normalized = normalized_error_squared(error, covariance)
    if normalized.ndim != 2:
        raise ValueError(f"expected errors of shape (episodes, steps, 2), got {np.shape(error)}")
    empty = np.flatnonzero(np.isnan(normalized).all(axis=1))
    if empty.size:
        raise ValueError(f"episode {empty[0]} has no step with both an error and a covariance")
    shares = share_inside_ellipses(normalized)
    per_episode = {
        "normalized_error_squared": np.nanmean(normalized, axis=1),
        "median_normalized_error_squared": np.nanmedian(normalized, axis=1),
        **{f"inside_{100 * p:.0f}": shares[:, column] for column, p in enumerate(PROBABILITIES)},
        **table_ii_proportions(error, covariance),
    }
    return {name: bootstrap.mean(values) for name, values in per_episode.items()}
