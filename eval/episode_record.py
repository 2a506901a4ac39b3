"""What one policy did: its errors and ranges, step by step, over E episodes of K steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FleetRecord:
    """What is told of several vehicles or tags beside the record they share: E episodes of K steps, T tags."""

    time_step: float  # [s]
    tag_error: Floats  # (E, K, T) [m], mean over the beliefs of the vehicles that take part
    encroachments: Floats  # (E, K) how often a vehicle came too near another one in each step, summed over vehicles
    messages: Floats  # (E, K) sent in each step by all vehicles

    def from_step(self, step: int) -> FleetRecord:
        """The same episodes without what came before a step."""
        return FleetRecord(
            time_step=self.time_step,
            tag_error=self.tag_error[:, step:],
            encroachments=self.encroachments[:, step:],
            messages=self.messages[:, step:],
        )


@dataclass(frozen=True, kw_only=True)
class EpisodeRecord:
    """What one policy did: E episodes of K steps.

    Of a fleet, the error is the mean over tags and over the beliefs of the vehicles that take part (where none does any more,
    over all), the range that of the nearest vehicle to the nearest fish, the reward the mean over the vehicles that take part.

    A step without truth, for instance after an episode's end, is NaN in both arrays and counts nowhere. An error that
    is NaN where the range is known is refused: it would be a broken belief, left out of its own reckoning. Arrays of
    the wrong shape, negative or infinite values and an episode without any step raise ValueError too.
    """

    error: Floats  # (E, K) [m] distance from the belief's estimate to the fish
    range: Floats | None = None  # (E, K) [m] true distance from the vehicle to the fish
    reward: Floats | None = None  # (E, K) of each step
    fleet: FleetRecord | None = None  # None: one vehicle and one tag

    def __post_init__(self) -> None:
        object.__setattr__(self, "error", _checked("error", self.error))
        if self.range is not None:
            distance = _checked("range", self.range)
            if distance.shape != self.error.shape:
                raise ValueError(f"range has shape {distance.shape}, error has {self.error.shape}")
            broken = np.argwhere(np.isnan(self.error) != np.isnan(distance))
            if broken.size:
                episode, step = broken[0]
                raise ValueError(
                    f"error and range must be known at the same steps: episode {episode}, step {step} has one"
                )
            object.__setattr__(self, "range", distance)

    @property
    def episodes(self) -> int:
        """Number of episodes, E."""
        return self.error.shape[0]

    def from_step(self, step: int) -> EpisodeRecord:
        """The same episodes without what came before a step."""
        return EpisodeRecord(
            error=self.error[:, step:],
            range=None if self.range is None else self.range[:, step:],
            reward=None if self.reward is None else self.reward[:, step:],
            fleet=None if self.fleet is None else self.fleet.from_step(step),
        )


def join(records: Sequence[EpisodeRecord]) -> EpisodeRecord:
    """One policy's episodes, which were run in several parts."""
    if len(records) == 1:
        return records[0]
    fleets = [record.fleet for record in records if record.fleet is not None]
    return EpisodeRecord(
        error=np.concatenate([record.error for record in records]),
        range=_join([record.range for record in records]),
        reward=_join([record.reward for record in records]),
        fleet=_concatenate(fleets, axis=0) if fleets else None,
    )


def _join(parts: Sequence[Floats | None]) -> Floats | None:
    known = [part for part in parts if part is not None]
    return np.concatenate(known) if known else None


def pool(records: Sequence[EpisodeRecord]) -> EpisodeRecord:
    """Several policies in the same episodes as one record of E episodes with all their steps: each weighs the same."""
    ranges = [record.range for record in records if record.range is not None]
    fleets = [record.fleet for record in records if record.fleet is not None]
    return EpisodeRecord(
        error=np.concatenate([record.error for record in records], axis=1),
        range=np.concatenate(ranges, axis=1) if len(ranges) == len(records) else None,
        fleet=_concatenate(fleets, axis=1) if fleets and len(fleets) == len(records) else None,
    )


def _concatenate(fleets: Sequence[FleetRecord], *, axis: int) -> FleetRecord:
    """More episodes (axis 0) or more steps of each (axis 1)."""
    return FleetRecord(
        time_step=fleets[0].time_step,
        tag_error=np.concatenate([fleet.tag_error for fleet in fleets], axis=axis),
        encroachments=np.concatenate([fleet.encroachments for fleet in fleets], axis=axis),
        messages=np.concatenate([fleet.messages for fleet in fleets], axis=axis),
    )


def _checked(name: str, values: ArrayLike) -> Floats:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.size == 0:
        raise ValueError(f"{name} must have the shape (episodes, steps), got {array.shape}")
    if np.isinf(array).any() or (array < 0).any():
        raise ValueError(f"{name} must be distances, got {array[np.isinf(array) | (array < 0)][0]} m")
    empty = np.flatnonzero(np.isnan(array).all(axis=1))
    if empty.size:
        raise ValueError(f"{name} of episode {empty[0]} has no step")
    return array
