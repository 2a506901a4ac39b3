"""The particle filter on time differences as Masmitja et al. 2020 print it, to compare with (``pf`` is ours).

Printed: 6,000 particles of position and velocity "spread on the area", moved by Eqs. 8 and 9, weighted by Eq. 3 over the full set
of differences, each with an independent error of the simulated sigma, normalized and resampled at every ping. Not printed, and
chosen here: the area is the array's box, grown on every side by its longest side; first velocities are normal; Q is that of white
acceleration, as for all that have a motion model; resampling is systematic; the position is the mean of the weighted particles.
Weights are kept as logarithms: where all would underflow, as with an arrival far off, the likeliest particle takes all.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.eval.field.static_array.likelihood import check_pings
from tagtrack.eval.field.static_array.model import (
    ArraySetting,
    Floats,
    Pings,
    Positions,
    arrival_information,
    check_receivers,
    full_pairs,
)
from tagtrack.eval.field.static_array.particle_track import SHORTEST_INTERVAL, Misfit, grown_box
from tagtrack.eval.field.static_array.stages import normalized, resample

PARTICLES = 6000


def printed_particle_filter(
    pings: Pings,
    receivers: ArrayLike,
    setting: ArraySetting,
    *,
    information: Floats | None = None,
    particles: int = PARTICLES,
    seed: int = 0,
) -> Positions:
    """Mean and covariance of the particles after each ping, before they are resampled.

    Args:
        pings: K pings in order of time. receivers: (R, n) [m].
        setting: ``sigma`` is taken for that of a time difference.
        information: (K, R, R) [1/s^2] in place of Eq. 3's.
        seed: of the random numbers; the same seed gives the same track.
    Returns:
        position (K, n) and covariance (K, n, n); NaN before the first ping that n + 1 receivers heard.
    Raises:
        ValueError: if the shapes disagree, receivers cannot locate or times are out of order.
    """
    places = check_receivers(receivers)
    check_pings(pings, places)
    if information is None:
        information = arrival_information(pings.heard, setting.sigma, full_pairs(len(places)))
    count = places.shape[1]
    position = np.full((len(pings.time), count), np.nan)
    covariance = np.full((len(pings.time), count, count), np.nan)
    rng = np.random.default_rng(seed)
    state: Floats | None = None  # (2n, N): places, then velocities
    for k in range(len(pings.time)):
        if state is None:
            if pings.heard[k].sum() <= count:
                continue
            state = _spread(places, setting, particles, rng)
        else:
            state = _move(state, max(float(pings.time[k] - pings.time[k - 1]), SHORTEST_INTERVAL), setting, rng)
        misfit = Misfit(pings.arrival[k], information[k], places, setting.sound_speed)
        log_weight = -misfit(state[:count])
        weight = normalized(log_weight)
        position[k] = state[:count] @ weight
        offset = state[:count] - position[k][:, None]
        covariance[k] = (offset * weight) @ offset.T
        state = state[:, resample(log_weight, rng)]
    return Positions(position=position, covariance=covariance)


def _spread(places: Floats, setting: ArraySetting, particles: int, rng: np.random.Generator) -> Floats:
    """First states (2n, N)."""
    low, high = grown_box(places)
    where = rng.uniform(low, high, (len(low), particles))
    return np.concatenate([where, setting.first_speed_sigma * rng.standard_normal(where.shape)])


def _move(state: Floats, interval: float, setting: ArraySetting, rng: np.random.Generator) -> Floats:
    """States (2n, N) an interval [s] later: Eqs. 8 and 9."""
    count = len(state) // 2
    root = np.linalg.cholesky([[interval**3 / 3, interval**2 / 2], [interval**2 / 2, interval]])  # of Q / sigma^2, an axis
    noise = setting.acceleration_sigma * np.einsum("ij,jnp->inp", root, rng.standard_normal((2, count, state.shape[1])))
    way, change = noise
    return np.concatenate([state[:count] + interval * state[count:] + way, state[count:] + change])
