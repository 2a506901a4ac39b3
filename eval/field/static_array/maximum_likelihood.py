"""Maximum likelihood by damped Newton steps, alone or from the closed form (Masmitja et al. 2020, Eqs. 4-6), all pings at once.

The cost has kinks at the receivers and, outside the array, valleys that end at one: the paper's ML, from one start, gets caught
there. Here it starts from several places and keeps the best; ``starts=1`` is the paper's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from tagtrack.eval.field.static_array.closed_form import solve_in_closed_form
from tagtrack.eval.field.static_array.likelihood import Derivatives, Likelihood, make_likelihood, pings_last
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions
from tagtrack.eval.field.static_array.robust import reweigh

MOST_STEPS = 60
SHORTEST_STEP = 1e-6  # [m]
FIRST_DAMPING = 1e-4  # relative to the mean curvature, after a step that did not improve
FARTHEST = 20.0  # spans of the array from its centre: beyond, wavefronts are plane and tell a direction only
IMPLAUSIBLE = 0.05  # probability of a worse fit, below which WLS-ML also tries the other starts
AT_ONCE = 20_000  # descents: more do not fit in a processor's cache
REWEIGHTINGS = 10


def maximum_likelihood(
    pings: Pings,
    receivers: ArrayLike,
    setting: ArraySetting,
    *,
    information: Floats | None = None,
    starts: int | None = None,
) -> Positions:
    """Positions of least cost, with the bound at each as its covariance.

    Args:
        pings: arrivals (K, R) [s].
        receivers: (R, n) [m].
        information: (K, R, R) [1/s^2]; by default independent arrival errors of ``setting.sigma``.
        starts: how many of the 2n + 1 places to start from, the centre of the array first; by default all.
    Returns:
        NaN where fewer than n differences are known, and where the cost falls out to more than 20 spans of the array. Where n are
        known and two positions fit alike, the one nearer the centre.
    Raises:
        ValueError: if the shapes disagree or there are not as many starts.
    """
    likelihood = make_likelihood(pings, receivers, setting, information)
    most = 2 * likelihood.dimensions + 1
    if starts is not None and not 1 <= starts <= most:
        raise ValueError(f"starts must be within 1 and {most}, got {starts}")
    return likelihood.positions(_search(likelihood, starts or most))


def wls_ml(
    pings: Pings,
    receivers: ArrayLike,
    setting: ArraySetting,
    *,
    information: Floats | None = None,
    robust: bool = False,
) -> Positions:
    """Maximum likelihood from the closed form, and from the starts of ``maximum_likelihood`` where that fails or fits badly.

    Args, Returns, Raises: as ``maximum_likelihood``.
        robust: weigh arrivals that disagree with the others less (Student's t). It takes more receivers than a position does:
            with n + 2, an arrival that is wrong still fits a wrong position.
    """
    likelihood = make_likelihood(pings, receivers, setting, information)
    estimate = _refine(likelihood, solve_in_closed_form(likelihood, setting.sigma))
    if robust:
        nominal, variance = likelihood, np.zeros_like(likelihood.arrival)
        for _ in range(REWEIGHTINGS):
            likelihood, variance = reweigh(nominal, likelihood, variance, estimate)
            estimate = descend(likelihood, estimate)
    return likelihood.positions(estimate)


def start_places(likelihood: Likelihood) -> Floats:
    """Where descents start (2n + 1, n) [m]: the centre of the array, and a span away from it both ways along each axis."""
    away = likelihood.span * np.eye(likelihood.dimensions)
    return likelihood.centre + np.concatenate([np.zeros((1, likelihood.dimensions)), away, -away])


def _refine(likelihood: Likelihood, start: Floats) -> Floats:
    """Descents from given positions (K, n), and a search where there is none or the fit is one that noise hardly gives."""
    estimate = descend(likelihood, start)
    spare = likelihood.known_differences - likelihood.dimensions
    worst = np.where(spare > 0, 0.5 * chdtri(np.maximum(spare, 1), IMPLAUSIBLE), 1e-6)
    poor = np.flatnonzero((spare >= 0) & ~(likelihood.cost(estimate) <= worst))
    part = likelihood.take(poor)
    searched = _search(part, 2 * likelihood.dimensions + 1)
    if poor.size:
        estimate[poor] = part.choose(np.stack([estimate[poor], searched]))
    return estimate


def _search(likelihood: Likelihood, starts: int) -> Floats:
    """The best of descents (K, n) from the first start places."""
    found = [descend(likelihood, np.tile(place, (len(likelihood), 1))) for place in start_places(likelihood)[:starts]]
    return likelihood.choose(np.stack(found))


def descend(likelihood: Likelihood, start: Floats, most_steps: int = MOST_STEPS) -> Floats:
    """Minima of the cost (K, n) from starts (K, n); NaN from NaN, where too little is known, and where they run away.

    With few steps, how far descents came.
    """
    estimate = np.full_like(start, np.nan)
    able = np.isfinite(start).all(axis=1) & (likelihood.known_differences >= likelihood.dimensions)
    rows = np.flatnonzero(able)
    for first in range(0, len(rows), AT_ONCE):
        some = rows[first : first + AT_ONCE]
        estimate[some] = _newton(likelihood.take(some), start[some], most_steps)
    estimate[np.linalg.norm(estimate - likelihood.centre, axis=1) > FARTHEST * likelihood.span] = np.nan
    return estimate


def _newton(likelihood: Likelihood, start: Floats, most_steps: int) -> Floats:
    """Damped Newton descents (K, n); those that arrive leave the batch."""
    result = start.copy()
    active = np.arange(len(start))
    position, damping = start, np.zeros(len(start))
    now = likelihood.derivatives(position)
    for _ in range(most_steps):
        step = _step(now, damping, likelihood.span)
        trial = position + step
        new = likelihood.derivatives(trial)
        better = new.cost <= now.cost
        position = np.where(better[:, None], trial, position)
        now = Derivatives(*(np.where(better.reshape(-1, *[1] * (old.ndim - 1)), a, old) for a, old in zip(new, now, strict=True)))
        damping = np.where(better, np.where(damping > FIRST_DAMPING, damping / 10, 0.0), np.fmax(damping * 10, FIRST_DAMPING))
        result[active] = position
        away = np.linalg.norm(position - likelihood.centre, axis=1) > FARTHEST * likelihood.span
        going = ~(np.linalg.norm(step, axis=1) <= SHORTEST_STEP) & ~away
        if not going.any():
            break
        if not going.all():
            active, position, damping = active[going], position[going], damping[going]
            likelihood, now = likelihood.take(going), Derivatives(*(value[going] for value in now))
    return result


def _step(now: Derivatives, damping: Floats, longest: float) -> Floats:
    """Newton steps (N, n) where the Hessian is positive definite, else Gauss-Newton; none longer than ``longest`` [m]."""
    gradient, information = pings_last(now.gradient), pings_last(now.information)
    count = len(gradient)
    ridge = ((damping + 1e-9) * np.trace(information) / count + 1e-30) * np.eye(count)[..., None]
    newton, positive = _solve(information + pings_last(now.bending) + ridge, gradient)
    step = -np.where(positive, newton, _solve(information + ridge, gradient)[0])
    return (step * np.minimum(1.0, longest / np.maximum(np.linalg.norm(step, axis=0), 1e-30))).T


def _solve(matrix: Floats, vector: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Solutions (n, N) of symmetric systems (n, n, N), pings last, and which matrices are positive definite (N,).

    Elimination without pivoting: sound where a matrix is positive definite, and worthless elsewhere.
    """
    left, right = matrix.copy(), vector.copy()
    count = len(right)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for row in range(count):
            for below in range(row + 1, count):
                factor = left[below, row] / left[row, row]
                left[below] -= factor * left[row]
                right[below] -= factor * right[row]
        for row in reversed(range(count)):
            right[row] = (right[row] - np.einsum("mk,mk->k", left[row, row + 1 :], right[row + 1 :])) / left[row, row]
    return right, (np.einsum("mmk->mk", left) > 0).all(axis=0)
