"""Several vehicles on one circle: each goes a little wider, or slower where it can, when it comes too near the one ahead.

So that their angles about the centre part evenly, as those of Shinzaki et al. 2013 who, however, lay phases and radii down
beforehand. It takes no agreement: where teammates last told to be is enough.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.scenario import Scenario

NEAREST = 1e-3  # [m]
FULL = 1.0 / 3.0  # crowding from which on a vehicle gives way as much as it may


def crowding(centre: np.ndarray, places: np.ndarray, lag: np.ndarray, own: np.ndarray) -> np.ndarray:
    """How much nearer the next teammate ahead on the circle is than the next behind, (B,) in [-1, 1]; 0 for one alone.

    Vehicles go round with the centre to starboard: ahead is where the angle about the centre is smaller.

    Args:
        centre: (B, 2) [m]. places: (B, V, 2) of all vehicles, NaN where unknown or on no circle [m].
        lag: (B, V) way that each has gone since it was there [m]. own: (B,) int, its own number.
    """
    away = places - centre[:, None]
    angle = np.arctan2(away[..., 1], away[..., 0]) - lag / np.maximum(np.hypot(away[..., 0], away[..., 1]), NEAREST)
    rows = np.arange(len(own))
    gap = (angle[rows, own, None] - angle) % (2.0 * math.pi)
    gap[rows, own] = np.nan
    ahead = np.where(np.isnan(gap), np.inf, gap).min(axis=1)
    behind = 2.0 * math.pi - np.where(np.isnan(gap), -np.inf, gap).max(axis=1)
    alone = np.isnan(gap).all(axis=1)
    ahead, behind = np.where(alone, 1.0, ahead), np.where(alone, 1.0, behind)
    return (behind - ahead) / (behind + ahead)


def give_way(radius: np.ndarray, crowded: np.ndarray, share: float, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Radius [m] and share of the largest speed, each (B,), by which gaps become equal.

    Args:
        radius: (B,) of the circle meant [m]. crowded: (B,) by ``crowding``. share: by which radius or speed change at most.
    """
    change = share * np.clip(crowded / FULL, -1.0, 1.0)
    if scenario.speed_control:
        return radius, 1.0 - np.maximum(change, 0.0)
    tightest = scenario.vehicle.max_speed / scenario.vehicle.max_turn_rate
    return np.maximum(radius * (1.0 + change), np.minimum(radius, tightest)), np.ones_like(radius)


def keep_to_own_circle(places: np.ndarray, tags: np.ndarray, tag: np.ndarray) -> np.ndarray:
    """Places (B, V, 2) without those of vehicles that are nearer to another tag than to the one circled.

    Args:
        places: (B, V, 2) [m]. tags: (B, T, 2) [m]. tag: (B,) int, the one circled.
    """
    if tags.shape[1] == 1:
        return places
    away = places[:, :, None] - tags[:, None]
    distance = np.hypot(away[..., 0], away[..., 1])
    nearest = np.where(np.isnan(distance), np.inf, distance).argmin(axis=2)
    return np.where((nearest == tag[:, None])[..., None], places, np.nan)
