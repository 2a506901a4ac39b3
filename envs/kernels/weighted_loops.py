"""The loops of ``summary_loops.py`` for a row of particles that carry weights; means are divided by the sum of the weights."""

from __future__ import annotations

import numpy as np

from tagtrack.envs.kernels.compiling import inner

f32 = np.float32


@inner
def weighted_mean_about(x, y, weight, own_x, own_y, ahead_x, ahead_y):
    """Mean offset from a place (x, y) [m], the weight to the left of a direction there, and all weight."""
    sum_x = f32(0.0)
    sum_y = f32(0.0)
    left = f32(0.0)
    total = f32(0.0)
    for i in range(x.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        sum_x += weight[i] * dx
        sum_y += weight[i] * dy
        left += weight[i] if ahead_x * dy - ahead_y * dx > f32(0.0) else f32(0.0)
        total += weight[i]
    return sum_x / total, sum_y / total, min(left, total), total


@inner
def weighted_share_to_port(x, y, weight, own_x, own_y, ahead_x, ahead_y):
    """Share of the weight to port of a vehicle; ``ahead`` is the unit vector of its heading."""
    port = f32(0.0)
    total = f32(0.0)
    for i in range(x.shape[0]):
        port += weight[i] if ahead_x * (y[i] - own_y) - ahead_y * (x[i] - own_x) > f32(0.0) else f32(0.0)
        total += weight[i]
    return min(port / total, f32(1.0))


@inner
def weighted_spread_about(x, y, weight, mean_x, mean_y):
    """Second moments (xx, yy, xy) [m^2] about a mean."""
    xx = f32(0.0)
    yy = f32(0.0)
    xy = f32(0.0)
    total = f32(0.0)
    for i in range(x.shape[0]):
        dx = x[i] - mean_x
        dy = y[i] - mean_y
        weighted_x = weight[i] * dx
        xx += weighted_x * dx
        yy += weight[i] * dy * dy
        xy += weighted_x * dy
        total += weight[i]
    return xx / total, yy / total, xy / total


@inner
def weighted_mean_of(row, weight):
    """Mean of a row, and all weight."""
    moment = f32(0.0)
    total = f32(0.0)
    for i in range(row.shape[0]):
        moment += weight[i] * row[i]
        total += weight[i]
    return moment / total, total


@inner
def weighted_squares_about(row, weight, mean):
    """Sum of the weighted squares of a row about a mean."""
    moment = f32(0.0)
    for i in range(row.shape[0]):
        miss = row[i] - mean
        moment += weight[i] * miss * miss
    return moment
