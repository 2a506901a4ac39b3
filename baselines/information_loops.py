"""The compiled loop of the ``information`` planner: what the next pings are expected to tell about the particles.

It knows no model of its own: what a reading says of a bearing, and how far sound carries, come in tables. It must not call
compiled functions of ``tagtrack.envs``: outside that package numba's cache would not notice that they have changed.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.compiling import compiled

f32 = np.float32


@compiled
def add_up_information(
    x, y, own_x, own_y, ahead_x, ahead_y, depth, offset, chance, likelihood, entropy, by_distance, mixture, information
):
    """Sum over pings of the mutual information between a reading and the particles, times the chance of hearing it.

    The mutual information is H(E[p(z|x)]) - E[H(p(z|x))] over the readings z of a heard ping, the expectations being over
    particles x that would be heard.

    Args:
        x, y: (B, M) float32 particles [m].
        own_x, own_y, ahead_x, ahead_y: (B, K, P) float32 place [m] of the vehicle and unit vector of its heading at each ping
            of each candidate.
        depth: (B,) float32 of the tag below the vehicle [m]. offset: (B,) float32 added to distances before look-up [m].
        chance: (R,) float32 chance that a ping is usable, by distance in metres; the last entry counts for all beyond.
        likelihood: (A, Z) float32 p(z|x), by the cosine of the bearing to a particle, in A equal bins from -1 to 1, or
            ``by_distance`` in whole metres, where the last row counts for all beyond.
        entropy: (A,) float32 entropy of each row of ``likelihood`` [nats].
        mixture: (Z,) float32, room to work in. information: (B, K) float32, filled [nats].
    """
    rows, count = x.shape
    readings = likelihood.shape[1]
    half_bins = f32(0.5 * likelihood.shape[0])
    last_bin = likelihood.shape[0] - 1
    last_metre = chance.shape[0] - 1
    for b in range(rows):
        for k in range(own_x.shape[1]):
            total = f32(0.0)
            for p in range(own_x.shape[2]):
                mixture[:] = f32(0.0)
                heard = f32(0.0)
                expected_entropy = f32(0.0)
                for i in range(count):
                    dx = x[b, i] - own_x[b, k, p]
                    dy = y[b, i] - own_y[b, k, p]
                    distance = np.sqrt(dx * dx + dy * dy + depth[b] * depth[b] + f32(1e-6))
                    cosine = (dx * ahead_x[b, k, p] + dy * ahead_y[b, k, p]) / distance
                    place = distance + offset[b] if by_distance else (cosine + f32(1.0)) * half_bins
                    row = min(max(int(place), 0), last_bin)
                    weight = chance[min(int(distance), last_metre)]
                    heard += weight
                    expected_entropy += weight * entropy[row]
                    for z in range(readings):
                        mixture[z] += weight * likelihood[row, z]
                entropy_of_mixture = f32(0.0)
                for z in range(readings):
                    share = mixture[z] / heard
                    if share > f32(1e-9):
                        entropy_of_mixture -= share * math.log(share)
                total += heard / f32(count) * entropy_of_mixture - expected_entropy / f32(count)
            information[b, k] = total
