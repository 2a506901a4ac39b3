"""Weighted particles meet a likelihood far narrower than they stand: by stages, with moves (Del Moral et al. 2006).

Each stage lets in as much of it as leaves a quarter of the particles effective, resamples, and moves the copies apart by
Metropolis steps that leave the distribution of the stage as it is. Where the likelihood is wide, one stage without moves is all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.model import Floats

FEWEST_EFFECTIVE = 60  # particles that one update may leave: they know a mean to an eighth of its deviation
STAGE_SHARE = 0.25  # effective share that a stage leaves
MOVES = 2  # Metropolis moves after a stage
SMALLEST_MOVE, LARGEST_MOVE = 0.05, 2.0  # of the particles' own spread, drawn log-uniform: modes of any width are explored

Misfit = Callable[[Floats], Floats]
Prior = Callable[[Floats, Floats], Floats]


def condition(
    position: Floats,
    ancestor: Floats,
    log_weight: Floats,
    misfit: Misfit,
    prior: Prior,
    rng: np.random.Generator,
    least_evidence: float = -np.inf,
) -> tuple[Floats, Floats, Floats] | None:
    """Let a likelihood in, by stages where it would leave too few particles.

    Args:
        position: (n, N) drawn from the prior. ancestor: (d, N), what the prior of each is conditioned on, carried along.
        misfit, prior: minus the log of likelihood and prior density.
    Returns:
        position, ancestor and log weight after it; None as soon as the log of the mean likelihood falls below the least.
    """
    let_in, cost, evidence = 0.0, misfit(position), 0.0
    fewest = min(FEWEST_EFFECTIVE / log_weight.size, STAGE_SHARE)
    while True:
        step = 1 - let_in
        last = effective_share(log_weight - step * cost) >= fewest
        if not last:
            step = _next_stage(log_weight, cost, step)
        weighed = log_weight - step * cost
        evidence += _log_sum(weighed) - _log_sum(log_weight)
        if evidence < least_evidence:
            return None
        if last:
            return position, ancestor, weighed
        let_in += step
        chosen = resample(weighed, rng)
        position, ancestor, cost = position[:, chosen], ancestor[:, chosen], cost[chosen]
        log_weight = np.zeros_like(log_weight)
        for _ in range(MOVES):
            position, cost = _move(position, ancestor, cost, let_in, misfit, prior, rng)


def _move(
    position: Floats, ancestor: Floats, cost: Floats, let_in: float, misfit: Misfit, prior: Prior, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """One Metropolis move of every particle. Returns position and misfit."""
    covariance = np.cov(position)
    floor = 1e-12 * max(float(np.trace(covariance)), 1e-6)
    shape = np.linalg.cholesky(covariance + floor * np.eye(len(position)))
    size = np.exp(rng.uniform(np.log(SMALLEST_MOVE), np.log(LARGEST_MOVE), position.shape[1]))
    proposed = position + size * (shape @ rng.standard_normal(position.shape))
    new_cost = misfit(proposed)
    gain = prior(position, ancestor) - prior(proposed, ancestor) + let_in * (cost - new_cost)
    accepted = rng.standard_exponential(gain.size) > -gain
    return np.where(accepted, proposed, position), np.where(accepted, new_cost, cost)


def _next_stage(log_weight: Floats, cost: Floats, most: float) -> float:
    """The share of the likelihood, below ``most``, that leaves ``STAGE_SHARE`` of the particles effective; by bisection."""
    low, high = np.log(most) - 40.0, np.log(most)
    for _ in range(10):
        middle = 0.5 * (low + high)
        if effective_share(log_weight - np.exp(middle) * cost) < STAGE_SHARE:
            high = middle
        else:
            low = middle
    return float(np.exp(high))


def _log_sum(log_weight: Floats) -> float:
    most = log_weight.max()
    return float(most + np.log(np.exp(log_weight - most).sum()))


def normalized(log_weight: Floats) -> Floats:
    """Weights that sum to one."""
    weight = np.exp(log_weight - log_weight.max())
    return weight / weight.sum()


def effective_share(log_weight: Floats) -> float:
    """Between 1 / N, where one weight counts, and 1, where all are alike."""
    weight = np.exp(log_weight - log_weight.max())
    return float(weight.sum() ** 2 / (weight @ weight)) / weight.size


def resample(log_weight: Floats, rng: np.random.Generator) -> NDArray[np.intp]:
    """Ancestors (N,) by systematic resampling."""
    total = np.cumsum(normalized(log_weight))
    passed = np.ceil(total / total[-1] * total.size - rng.random()).astype(np.intp)  # pointers below the end of each share
    return np.repeat(np.arange(total.size), np.diff(passed, prepend=0))
