"""Who of several vehicles takes which of several tags: in turn, or jointly by the Hungarian method."""

from __future__ import annotations

import numpy as np

from tagtrack.baselines.surroundings import Surroundings

TAKEN = 1e6  # [m]: what a tag is worth less for each vehicle that has taken it


def rate_tags(around: Surroundings, per_metre: float) -> np.ndarray:
    """What each tag is worth to each vehicle, (B, V, T): its spread less ``per_metre`` times the way [m]; NaN where unknown."""
    away = around.tags[:, None] - around.places[:, :, None]
    return around.spread[:, None] - per_metre * np.hypot(away[..., 0], away[..., 1])


def choose_in_turn(value: np.ndarray, own: np.ndarray) -> np.ndarray:
    """The tag (B,) of vehicle ``own`` (B,) where vehicles choose by their number, each the best that the fewest have taken.

    Args:
        value: (B, V, T) [m], NaN for vehicles of which nothing is known, who take none.
    """
    taken = np.zeros((len(value), value.shape[2]))
    choice = np.zeros(len(value), np.int64)
    rows = np.arange(len(value))
    for v in range(value.shape[1]):
        known = ~np.isnan(value[:, v]).any(axis=1)
        best = np.where(known[:, None], value[:, v] - TAKEN * taken, 0.0).argmax(axis=1)
        taken[rows[known], best[known]] += 1.0
        choice = np.where(own == v, best, choice)
    return choice


def assign_jointly(value: np.ndarray, own: np.ndarray) -> np.ndarray:
    """The tag (B,) of vehicle ``own`` (B,) where the sum over all vehicles is the largest (Hungarian method).

    Where vehicles outnumber tags, each tag is given to as few as can be.

    Args:
        value: (B, V, T) [m], NaN for vehicles of which nothing is known, who get none.
    """
    from scipy.optimize import linear_sum_assignment  # here, for a vehicle that needs none of it may lack it

    choice = np.zeros(len(value), np.int64)
    for row, worth in enumerate(value):
        known = np.flatnonzero(~np.isnan(worth).any(axis=1))
        rounds = -(-len(known) // worth.shape[1])
        offer = np.concatenate([worth[known] - TAKEN * k for k in range(rounds)], axis=1)
        vehicles, tags = linear_sum_assignment(offer, maximize=True)
        choice[row] = tags[known[vehicles] == own[row]][0] % worth.shape[1]
    return choice
