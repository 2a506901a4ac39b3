"""Loops that condense a row of particles: means about a place near by, spreads about the mean (float32 keeps its digits so)."""

from __future__ import annotations

import numpy as np

from tagtrack.envs.kernels.compiling import inner

f32 = np.float32


@inner
def mean_about(x, y, own_x, own_y, ahead_x, ahead_y):
    """Mean offset from a place (x, y) [m], and how many particles are to the left of a direction there: one pass for both."""
    sum_x = f32(0.0)
    sum_y = f32(0.0)
    left = f32(0.0)
    for i in range(x.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        sum_x += dx
        sum_y += dy
        left += f32(1.0) if ahead_x * dy - ahead_y * dx > f32(0.0) else f32(0.0)
    count = f32(x.shape[0])
    return sum_x / count, sum_y / count, left


@inner
def share_to_port(x, y, own_x, own_y, ahead_x, ahead_y):
    """Share of particles to port of a vehicle; ``ahead`` is the unit vector of its heading."""
    port = f32(0.0)
    for i in range(x.shape[0]):
        port += f32(1.0) if ahead_x * (y[i] - own_y) - ahead_y * (x[i] - own_x) > f32(0.0) else f32(0.0)
    return port / f32(x.shape[0])


@inner
def spread_about(x, y, mean_x, mean_y):
    """Second moments (xx, yy, xy) [m^2] about a mean."""
    xx = f32(0.0)
    yy = f32(0.0)
    xy = f32(0.0)
    for i in range(x.shape[0]):
        dx = x[i] - mean_x
        dy = y[i] - mean_y
        xx += dx * dx
        yy += dy * dy
        xy += dx * dy
    count = f32(x.shape[0])
    return xx / count, yy / count, xy / count


@inner
def mean_of(row):
    """Mean of a row."""
    total = f32(0.0)
    for i in range(row.shape[0]):
        total += row[i]
    return total / f32(row.shape[0])


@inner
def squares_about(row, mean):
    """Sum of the squares of a row about a mean."""
    total = f32(0.0)
    for i in range(row.shape[0]):
        miss = row[i] - mean
        total += miss * miss
    return total
