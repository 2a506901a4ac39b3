"""What is reported of a belief: mean, spread and estimate of its particles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tagtrack.envs.belief.assumptions import Estimate
from tagtrack.envs.belief.renewal import summarize_estimated
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.summary_loops import mean_about, spread_about
from tagtrack.envs.kernels.weighted_loops import weighted_mean_about, weighted_spread_about

f32 = np.float32


@compiled
def summarize(particles, carried, belief, about_x, about_y, heading, rule):
    """Mean, spread and estimate of a row; returns the share of particles to the left of a heading at (about_x, about_y).

    Each by the weights that the particles carry, ``carried`` (N,), where they carry any.
    Sums are taken about that place, lest float32 lose its digits: it must lie near the particles, as a vehicle does.
    """
    x = particles[0]
    y = particles[1]
    own_x = f32(about_x)
    own_y = f32(about_y)
    ahead_x = f32(math.cos(heading))
    ahead_y = f32(math.sin(heading))
    if carried.shape[0] > 0:
        offset_x, offset_y, left, total = weighted_mean_about(x, y, carried, own_x, own_y, ahead_x, ahead_y)
        xx, yy, xy = weighted_spread_about(x, y, carried, own_x + offset_x, own_y + offset_y)
    else:
        total = f32(x.shape[0])
        offset_x, offset_y, left = mean_about(x, y, own_x, own_y, ahead_x, ahead_y)
        xx, yy, xy = spread_about(x, y, own_x + offset_x, own_y + offset_y)
    belief.mean_x = np.float64(own_x) + np.float64(offset_x)
    belief.mean_y = np.float64(own_y) + np.float64(offset_y)
    belief.xx = xx
    belief.yy = yy
    belief.xy = xy
    belief.estimated = rule.middle
    belief.estimated_spread = 0.0
    if particles.shape[0] > 4:
        summarize_estimated(particles[4], carried, belief)
    if rule.estimate == Estimate.BEST:
        belief.estimate_x = x[belief.best]
        belief.estimate_y = y[belief.best]
    else:
        belief.estimate_x = belief.mean_x
        belief.estimate_y = belief.mean_y
    return left / total  # here, after the branches: beside other divisions by N it would become a product, and round otherwise


def covariance(belief: Any) -> np.ndarray:
    """(..., 2, 2) covariance [m^2] of a structured array of ``BELIEF``."""
    flat = np.stack([belief["xx"], belief["xy"], belief["xy"], belief["yy"]], axis=-1)
    return flat.reshape(*flat.shape[:-1], 2, 2)
