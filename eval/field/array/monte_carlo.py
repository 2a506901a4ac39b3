"""Estimators on the same simulated pings, over and over: their errors beside the bound, and their time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tagtrack.eval.field.array.scene import Noise, Scene
from tagtrack.eval.field.static_array.bound import cramer_rao_bound, root_trace
from tagtrack.eval.field.static_array.model import ArraySetting, Floats
from tagtrack.eval.field.static_array.registry import Estimator

PLACES = ("inside", "outside")


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What one method made of one noise in M runs of K pings."""

    error: Floats  # (M, K) [m]; NaN where it gave no position
    seconds: Floats  # (M,) of one processor per position

    def rmse(self, chosen: Any) -> Floats:
        """(M,) [m], root mean square over the chosen pings (K,) that got a position."""
        error = self.error[:, chosen]
        located = np.isfinite(error).sum(axis=1)
        return np.sqrt(np.nansum(error**2, axis=1) / np.where(located, located, np.nan))


def repeat(
    scene: Scene,
    noises: Sequence[Noise],
    methods: Mapping[str, Estimator],
    settings: Mapping[Noise, ArraySetting],
    *,
    runs: int,
    seed: int,
    advance: Callable[[str, int], None] = lambda method, positions: None,
) -> dict[Noise, dict[str, Outcome]]:
    """All methods on the same pings, run after run.

    A run's pings depend on the seed, its number and its noise alone: with fewer runs or methods the others stay the same.
    """
    found: dict[Noise, dict[str, Outcome]] = {}
    count = len(scene.position)
    for method in methods.values():  # what a first call alone does is no part of the times
        method(scene.draw_pings(noises[0], np.random.default_rng(seed)), scene.receivers, settings[noises[0]])
    for noise in noises:
        error = {name: np.full((runs, count), np.nan) for name in methods}
        seconds = {name: np.full(runs, np.nan) for name in methods}
        for run in range(runs):
            key = [seed, run, round(1e9 * noise.sigma), round(1e6 * noise.outliers)]
            pings = scene.draw_pings(noise, np.random.default_rng(key))
            for name, method in methods.items():
                begun = time.process_time()
                positions = method(pings, scene.receivers, settings[noise])
                seconds[name][run] = (time.process_time() - begun) / count
                error[name][run] = np.linalg.norm(positions.position - scene.position, axis=1)
                advance(name, count)
        found[noise] = {name: Outcome(error=error[name], seconds=seconds[name]) for name in methods}
    return found


def bound_of_pings(scene: Scene, noise: Noise) -> Floats:
    """(K,) [m], the least root-mean-square error of an unbiased estimate from each ping alone; outliers do not enter it."""
    setting = ArraySetting(sound_speed=scene.sound_speed, sigma=noise.sigma)
    return root_trace(cramer_rao_bound(scene.position, scene.receivers, setting))


def summarize(scene: Scene, found: Mapping[Noise, Mapping[str, Outcome]]) -> dict[str, Any]:
    """The figures as JSON has them: by noise the bound and each method's RMSE, inside and outside; times by method."""
    inside = scene.inside
    chosen = {"inside": inside, "outside": ~inside}
    noises = []
    for noise, outcomes in found.items():
        bound = bound_of_pings(scene, noise)
        methods = {
            name: {
                "located": float(np.isfinite(outcome.error).mean()),
                **{f"rmse_{place}_m": _middle(outcome.rmse(pings)) for place, pings in chosen.items()},
            }
            for name, outcome in outcomes.items()
        }
        least = {f"bound_{place}_m": _root_mean_square(bound[pings]) for place, pings in chosen.items()}
        noises.append({"sigma_s": noise.sigma, "outliers": noise.outliers, "label": noise.label, **least, "methods": methods})
    names = list(next(iter(found.values())))
    seconds = {name: [outcomes[name].seconds for outcomes in found.values()] for name in names}
    return {
        "pings": len(scene.position),
        "pings_inside": int(inside.sum()),
        "noises": noises,
        "seconds_per_position": {name: float(np.median(np.concatenate(values))) for name, values in seconds.items()},
    }


def _middle(rmse: Floats) -> dict[str, float | None]:
    """Median, and the 5th and 95th percentile over the runs; null where no run located anything."""
    known = rmse[np.isfinite(rmse)]
    if not known.size:
        return {"value": None, "low": None, "high": None}
    low, value, high = np.quantile(known, [0.05, 0.5, 0.95]).tolist()
    return {"value": value, "low": low, "high": high}


def _root_mean_square(values: Floats) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size and np.isfinite(values).all() else None
