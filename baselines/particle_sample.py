"""A few particles that stand for all of a belief."""

from __future__ import annotations

import numpy as np

from tagtrack.envs.world_state import Worlds


def sample_particles(worlds: Worlds, world: np.ndarray, owner: np.ndarray, tag: np.ndarray, sample: int) -> np.ndarray:
    """Indices (R or 1, S) of a stratified sample of the particles of R beliefs: children of a particle lie side by side."""
    count = worlds.particles.shape[-1]
    sample = min(sample, count)
    if worlds.carried.shape[-1] > 0:
        return draw_evenly(worlds.carried[world, owner, tag], sample)
    return (np.arange(sample) * count // sample)[None, :]  # every n-th


def draw_evenly(weights: np.ndarray, sample: int) -> np.ndarray:
    """Indices (R, S) of a systematic sample by weights (R, N), without chance: the middles of S equal parts of their sum."""
    bounds = np.cumsum(weights, axis=1, dtype=np.float64)
    parts = (np.arange(sample) + 0.5) / sample
    return np.stack([np.searchsorted(row, parts * row[-1], side="right") for row in bounds])
