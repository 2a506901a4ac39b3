"""Arrivals weighed by how well they agree with the others: Student's t in place of the Gaussian, by reweighting.

Multipath makes a few arrivals late by milliseconds to seconds (Masmitja et al. 2020, "5 % of outliers" in Fig. 2D). The paper
simulates them and has no such weights. They are wrong for errors without tails, as those of a clock that rounds: least squares,
then, is better.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tagtrack.eval.field.static_array.likelihood import Likelihood
from tagtrack.eval.field.static_array.model import Floats

DEGREES_OF_FREEDOM = 4.0  # of Student's t: 5 % more spread than least squares where errors are Gaussian


def reweigh(nominal: Likelihood, current: Likelihood, variance: Floats, position: Floats) -> tuple[Likelihood, Floats]:
    """One step of iteratively reweighted least squares.

    An arrival with residual z standard deviations from what the others predict gets the variance that a Gaussian would need for
    the same pull on the position as Student's t, z^2 / nu more than its own.

    Args:
        nominal: without weights. current: with those of the last step.
        variance: (K, R) [s^2] that the last step added to each arrival.
        position: (K, n) [m], the last estimate; where NaN, weights stay as they are.
    Returns:
        The likelihood with new weights, and the variance (K, R) now added.
    """
    own = np.diagonal(current.information, axis1=1, axis2=2)
    pull = np.einsum("kab,kb->ka", current.information, current.errors(position))
    with np.errstate(divide="ignore", invalid="ignore"):
        # From what the others predict an arrival is off by pull / own, with variance 1 / own when it carries none in excess.
        plain = 1.0 / own - variance
        squared = (pull / own) ** 2 / plain
        nominal_variance = 1.0 / np.diagonal(nominal.information, axis1=1, axis2=2)
        weight = np.minimum((DEGREES_OF_FREEDOM + 1) / (DEGREES_OF_FREEDOM + squared), 1.0)
        added = nominal_variance * (1.0 / weight - 1.0)
    added = np.where(np.isfinite(added), added, variance)
    return replace(nominal, information=add_variance(nominal.information, added)), added


def add_variance(information: Floats, variance: Floats) -> Floats:
    """Information (K, R, R) [1/s^2] when each arrival gets an independent error of variance (K, R) [s^2] in addition.

    (M^+ + V)^+ in the space of differences, by Woodbury's identity: rows still sum to zero.
    """
    root = np.sqrt(variance)
    scaled = root[:, :, None] * information
    core = np.eye(information.shape[1]) + scaled * root[:, None, :]
    value = information - scaled.swapaxes(1, 2) @ np.linalg.solve(core, scaled)
    return 0.5 * (value + value.swapaxes(1, 2))
