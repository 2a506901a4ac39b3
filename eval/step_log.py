"""What a roll-out writes down of each step: a single vehicle and tag as they are, a fleet condensed to what tables tell."""

from __future__ import annotations

import numpy as np

from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.eval.episode_record import EpisodeRecord, FleetRecord

PATHS = ("estimate", "fish", "vehicle", "mean", "covariance")


class EpisodeLog:
    """Arrays of E episodes of K steps, filled step by step; with ``traced`` paths and beliefs, too."""

    def __init__(self, scenario: Scenario, episodes: int, *, traced: bool) -> None:
        self.scenario = scenario
        self.single = scenario.vehicles == scenario.targets == 1
        size = (episodes, scenario.episode_steps)
        self._error, self._range, self._reward = np.empty(size), np.empty(size), np.empty(size)
        o, v, t = scenario.owners, scenario.vehicles, scenario.targets
        shapes = {"estimate": (o, t, 2), "fish": (t, 2), "vehicle": (v, 2), "mean": (o, t, 2), "covariance": (o, t, 2, 2)}
        if self.single:
            shapes = {name: (2, 2) if name == "covariance" else (2,) for name in PATHS}
        self.kept = {name: np.empty((*size, *shapes[name])) for name in PATHS} if traced else {}
        self._fleet = None
        if not self.single:
            self._fleet = FleetRecord(
                time_step=scenario.time_step,
                tag_error=np.empty((*size, t)),
                encroachments=np.empty(size),
                messages=np.empty(size),
            )
        self._too_near = np.zeros(0)  # encroachments so far, (B,)

    def note(self, rows: slice, step: int, simulation: Simulation) -> None:
        """Write down what a step came to in the episodes ``rows``, one for each world of the simulation."""
        if self.single:
            self._error[rows, step] = simulation.error[:, 0, 0]
            self._range[rows, step] = simulation.range[:, 0, 0]
            self._reward[rows, step] = simulation.reward[:, 0]
        else:
            self._note_fleet(rows, step, simulation)
        for name, path in self.kept.items():
            path[rows, step] = _path(name, simulation).reshape(path[rows, step].shape)

    def _note_fleet(self, rows: slice, step: int, simulation: Simulation) -> None:
        """Means over the vehicles that take part; where none does any more, over all."""
        assert self._fleet is not None
        part = ~simulation.worlds.vehicles["gone"]
        part = part | ~part.any(axis=1, keepdims=True)
        share = part / part.sum(axis=1, keepdims=True)
        errors = simulation.error  # (B, O, T)
        tags = errors[:, 0] if self.scenario.owners == 1 else np.einsum("bv,bvt->bt", share, errors)
        self._fleet.tag_error[rows, step] = tags
        self._error[rows, step] = tags.mean(axis=1)
        self._range[rows, step] = np.where(part[..., None], simulation.range, np.inf).min(axis=(1, 2))
        self._reward[rows, step] = (share * simulation.reward).sum(axis=1)
        outcomes = simulation.outputs.outcomes
        so_far = outcomes["encroachments"].sum(axis=1)
        self._fleet.encroachments[rows, step] = so_far - (self._too_near if step > 0 else 0.0)
        self._fleet.messages[rows, step] = outcomes["messages"].sum(axis=1)
        self._too_near = so_far

    def record(self) -> EpisodeRecord:
        """All of it but the paths."""
        return EpisodeRecord(error=self._error, range=self._range, reward=self._reward, fleet=self._fleet)


def _path(name: str, simulation: Simulation) -> np.ndarray:
    return getattr(simulation, {"fish": "fish_position", "vehicle": "vehicle_position"}.get(name, name))
