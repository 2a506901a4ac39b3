"""From located pings to a track: a correlated random walk, its parameters by maximum likelihood, its states by the RTS smoother.

The velocity of an animal is an Ornstein-Uhlenbeck process on each axis (Johnson et al. 2008, the model of the package crawl):
it has a standard deviation and a memory. A short memory is the random walk of YAPS, a long one the constant velocity of
Masmitja et al. 2020, Eqs. 8-9. Pings that the walk cannot explain are left out, and counted.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

SPEEDS = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0)  # standard deviations of each axis to choose from [m/s]
MEMORIES = (30.0, 300.0, 3000.0, 30000.0)  # [s]
GATE = {2: 13.8, 3: 16.3}  # squared Mahalanobis distance that one ping in a thousand exceeds, chi-square by dimensions
MOST_COST = 50.0  # squared distance that a ping left out counts as: outliers cost all walks the same, a lost animal costs one
PART, MOST_PARTS = 200, 10  # pings from which the parameters are chosen
FIRST = 10  # pings whose median starts the walk


@dataclass(frozen=True, kw_only=True)
class Walk:
    """A correlated random walk: standard deviation of the velocity of each axis [m/s] and its memory [s]."""

    speed: float
    memory: float

    def transition(self, step: float, dimensions: int = 2) -> tuple[Floats, Floats]:
        """Phi and Q (2n, 2n) of the state [x, v_x, y, v_y, ...] over ``step`` [s]."""
        matrix, noise = _transitions(np.array([self.speed]), np.array([self.memory]), np.array([step]), dimensions)
        return matrix[0], noise[0]


@dataclass(frozen=True, kw_only=True)
class SmoothTrack:
    """One stretch of a track, K rows: ``time`` (K,) [s], ``position`` (K, n) [m], ``covariance`` (K, n, n) [m^2].

    ``refused`` (P,) says which of the P pings of the stretch were left out; ``walk`` what was assumed of the animal.
    """

    time: Floats
    position: Floats
    covariance: Floats
    refused: NDArray[np.bool_]
    walk: Walk


def choose_walk(time: Floats, position: Floats, covariance: Floats) -> Walk:
    """The walk among SPEEDS x MEMORIES under which located pings are most likely.

    A long record is judged by MOST_PARTS parts of PART pings, evenly spread over it.

    Args:
        time: (K,) [s], rising. position: (K, n) [m], n = 2 or 3. covariance: (K, n, n) [m^2].
    """
    size = position.shape[1]
    speed, memory = (grid.ravel() for grid in np.meshgrid(SPEEDS, MEMORIES, indexing="ij"))
    length = min(PART, time.size)
    first = np.unique(np.linspace(0, time.size - length, MOST_PARTS).astype(int))
    walks, parts = (index.ravel() for index in np.meshgrid(np.arange(speed.size), np.arange(first.size), indexing="ij"))
    rows = first[parts]
    begun = [_begin(position[row : row + length], covariance[row : row + length], speed) for row in first]
    state = np.stack([each[0] for each in begun], axis=1).reshape(-1, 2 * size)
    spread = np.stack([each[1] for each in begun], axis=1).reshape(-1, 2 * size, 2 * size)
    score = np.zeros(walks.size)
    for k in range(length):
        if k:
            matrix, noise = _transitions(speed[walks], memory[walks], time[rows + k] - time[rows + k - 1], size)
            state = np.einsum("gij,gj->gi", matrix, state)
            spread = matrix @ spread @ matrix.transpose(0, 2, 1) + noise
        innovation = spread[:, ::2, ::2] + covariance[rows + k]
        miss = position[rows + k] - state[:, ::2]
        inverse = np.linalg.inv(innovation)
        distance = np.einsum("gi,gij,gj->g", miss, inverse, miss)
        score -= 0.5 * np.minimum(distance, MOST_COST) + 0.5 * np.log(np.linalg.det(innovation))
        gain = np.where((distance < GATE[size])[:, None, None], spread[:, :, ::2] @ inverse, 0.0)
        state = state + np.einsum("gij,gj->gi", gain, miss)
        spread = spread - gain @ spread[:, ::2, :]
    best = int(np.argmax(score.reshape(speed.size, first.size).sum(axis=1)))
    return Walk(speed=float(speed[best]), memory=float(memory[best]))


def smooth(time: Floats, position: Floats, covariance: Floats, walk: Walk, at: ArrayLike | None = None) -> SmoothTrack:
    """Kalman filter and RTS smoother (filterpy) over one stretch.

    Args:
        time: (K,) [s], rising. position: (K, n) [m]. covariance: (K, n, n) [m^2] of located pings.
        at: (J,) rising times [s] at which to give the track; by default those of the pings.
    """
    from filterpy.kalman import KalmanFilter

    wanted = time if at is None else np.asarray(at, dtype=np.float64)
    moment = np.union1d(time, wanted)
    ping = np.full(moment.size, -1)
    ping[np.searchsorted(moment, time)] = np.arange(time.size)
    size = position.shape[1]
    kalman = KalmanFilter(dim_x=2 * size, dim_z=size)
    kalman.H = np.eye(2 * size)[::2]
    first_state, first_spread = _begin(position, covariance, np.array([walk.speed]))
    kalman.x, kalman.P = first_state[0], first_spread[0]
    refused = np.zeros(time.size, dtype=bool)
    states, spreads, matrices, noises = [], [], [np.eye(2 * size)], [np.zeros((2 * size, 2 * size))]
    for k in range(moment.size):
        if k:
            matrix, noise = walk.transition(moment[k] - moment[k - 1], size)
            kalman.predict(F=matrix, Q=noise)
            matrices.append(matrix)
            noises.append(noise)
        index = ping[k]
        if index >= 0:
            miss = position[index] - kalman.x[::2]
            refused[index] = miss @ np.linalg.solve(kalman.P[::2, ::2] + covariance[index], miss) >= GATE[size]
            if not refused[index]:
                kalman.update(position[index], R=covariance[index])
        states.append(kalman.x.copy())
        spreads.append(kalman.P.copy())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        # The smoother takes the transition into row k + 1 from place k + 1 of the lists.
        state, spread, _, _ = kalman.rts_smoother(np.array(states), np.array(spreads), Fs=matrices, Qs=noises)
    kept = np.searchsorted(moment, wanted)
    return SmoothTrack(
        time=wanted,
        position=state[kept][:, ::2],
        covariance=spread[kept][:, ::2, ::2],
        refused=refused,
        walk=walk,
    )


def interpolate(time: Floats, position: Floats, covariance: Floats, walk: Walk, at: ArrayLike | None = None) -> SmoothTrack:
    """As ``smooth``, of positions that an estimator has smoothed over the whole track already: on straight lines between them."""
    wanted = time if at is None else np.asarray(at, dtype=np.float64)

    def between(values: Floats) -> Floats:
        flat = values.reshape(len(values), -1)
        return np.stack([np.interp(wanted, time, column) for column in flat.T], axis=1).reshape(wanted.size, *values.shape[1:])

    return SmoothTrack(
        time=wanted,
        position=between(position),
        covariance=between(covariance),
        refused=np.zeros(time.size, dtype=bool),
        walk=walk,
    )


def _begin(position: Floats, covariance: Floats, speed: Floats) -> tuple[Floats, Floats]:
    """State (G, 2n) and covariance (G, 2n, 2n) before the first ping: the median of the first ones, and how they scatter."""
    first = position[:FIRST]
    middle = np.median(first, axis=0)
    scatter = np.median(np.abs(first - middle), axis=0) + np.sqrt(np.diagonal(covariance[:FIRST].mean(axis=0)))
    size = position.shape[1]
    state = np.zeros((speed.size, 2 * size))
    state[:, ::2] = middle
    spread = np.zeros((speed.size, 2 * size, 2 * size))
    for axis in range(size):
        spread[:, 2 * axis, 2 * axis] = (2.0 * scatter[axis]) ** 2
        spread[:, 2 * axis + 1, 2 * axis + 1] = speed**2
    return state, spread


def _transitions(speed: Floats, memory: Floats, step: Floats, dimensions: int) -> tuple[Floats, Floats]:
    """Phi and Q (G, 2n, 2n) of G walks over a step (G,) [s] of each."""
    share = step / memory
    left, lost = np.exp(-share), -np.expm1(-share)
    variance = speed**2
    # 2 s - 2 l - l^2 of share and lost, whose first two orders cancel.
    wander = np.where(
        share < 1e-3, share**3 * (2 / 3 - share / 2 + 7 / 30 * share**2), 2.0 * share - 2.0 * lost - lost**2
    )
    matrix = np.zeros((speed.size, 2 * dimensions, 2 * dimensions))
    noise = np.zeros_like(matrix)
    for x in range(0, 2 * dimensions, 2):
        v = x + 1
        matrix[:, x, x] = 1.0
        matrix[:, x, v] = memory * lost
        matrix[:, v, v] = left
        noise[:, x, x] = variance * memory**2 * wander
        noise[:, x, v] = noise[:, v, x] = variance * memory * lost**2
        noise[:, v, v] = variance * lost * (1.0 + left)
    return matrix, noise
