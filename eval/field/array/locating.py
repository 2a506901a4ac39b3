"""From detections to positions, tag by tag: what `array locate` and `array tracks` have in common."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from numpy.typing import NDArray

from tagtrack.eval.field.array.reading import by_deployment, fit_names, read_aloud
from tagtrack.eval.field.array.sound import SoundSpeed, read_sound_speed
from tagtrack.eval.field.static_array.averaging import average_pings, number_by_count, number_by_time
from tagtrack.eval.field.static_array.consensus import agree
from tagtrack.eval.field.static_array.detections import Detections, shorten
from tagtrack.eval.field.static_array.likelihood import make_likelihood
from tagtrack.eval.field.static_array.matching import array_window, match_pings, remove_impossible
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions
from tagtrack.eval.field.static_array.noise import estimate_sigma
from tagtrack.eval.field.static_array.registry import METHODS, locate
from tagtrack.eval.field.static_array.two_places import other_places
from tagtrack.eval.field.telemetry import ReceiverPlaces

HARDY = ("pf", "yaps")  # methods that weigh arrivals which disagree by themselves
USUAL_SIGMA = 1e-3  # of an arrival [s], where the pings do not tell


@dataclass(frozen=True, kw_only=True)
class Located:
    """One tag: K rows of positions, each of one ping or of several averaged."""

    tag: str
    heard: int  # pings, by at least one receiver
    pings: Pings  # K rows with their arrivals
    count: NDArray[np.int64]  # (K,) pings in each row
    positions: Positions  # NaN where not located
    sigma: float  # of an arrival [s]
    removed: int  # arrivals that no place explains, or that disagree with the others
    misfit: Floats  # (K,) root of the cost per spare arrival, 1 as expected; NaN where none is to spare
    other: Floats  # (K, 2) another place that explains the ping as well [m]; NaN where there is none
    other_covariance: Floats  # (K, 2, 2) of that [m^2]

    @property
    def known(self) -> NDArray[np.bool_]:
        """(K,) bool: which rows have a position."""
        return np.asarray(np.isfinite(self.positions.position).all(axis=1))

    @property
    def ambiguous(self) -> NDArray[np.bool_]:
        """(K,) bool: which rows have another place."""
        return np.asarray(np.isfinite(self.other).all(axis=1))

    @property
    def sd(self) -> Floats:
        """(K, 2) standard deviations [m] along x and y."""
        return np.sqrt(np.diagonal(self.positions.covariance, axis1=1, axis2=2))


@dataclass(frozen=True, kw_only=True)
class Averaging:
    """Which pings make one position: a number of them, or all within a time."""

    count: int = 1  # heard by as many receivers as a position takes; with others around them
    seconds: float | None = None  # in place of a number
    systematic: float = 1e-3  # of clocks and places of receivers, which averaging does not remove [s]

    def number(self, pings: Pings, least_receivers: int) -> NDArray[np.int64]:
        """Block (K,) of each ping."""
        if self.seconds is not None:
            return number_by_time(pings, self.seconds)
        return number_by_count(pings, self.count, least_receivers)


@dataclass(frozen=True, kw_only=True)
class LocateOptions:
    """Which detections, by which receivers, and how."""

    detections: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE ...")]
    """Detections on corrected clocks: csv (t_unix_s,receiver,tag), exports of VUE, Fathom, GLATOS, OTN ..., or folders."""
    receivers: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """csv with columns receiver,x,y [m] or receiver,lon,lat [degrees]; detections by receivers not in it are left out."""
    tags: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ID ...", help_behavior_hint="(all)")] = ()
    """Tags to locate."""
    method: Annotated[str, tyro.conf.arg(metavar="NAME")] = "wls_ml"
    """Estimator: wls, ml, wls_ml, map, map_m, pf, yaps."""
    sound_speed: Annotated[str, tyro.conf.arg(metavar="C")] = "1500"
    """Speed of sound [m/s], or a csv file of it over time: t_unix_s,sound_speed, or t_unix_s,temperature (salinity, depth)."""
    sigma: Annotated[float | None, tyro.conf.arg(metavar="S", help_behavior_hint="(from the pings)")] = None
    """Standard deviation of an arrival time [s]; by default what the pings with spare arrivals show, else 1 ms."""
    acceleration: float = 1e-3
    """Of the animal, for map, map_m and pf: standard deviation of a random acceleration [m/s^1.5]; some 0.05 for a boat."""
    min_receivers: int = 3
    """Fewest receivers that must have heard a ping."""
    max_sd: float = 100.0
    """Positions less certain than this [m], standard deviation in the worse direction, are not given."""

    def check(self) -> None:
        """Raise ValueError for an option out of range."""
        if self.method not in METHODS:
            raise ValueError(f"unknown --method {self.method}; known: {', '.join(METHODS)}")
        _ = self.sound  # a speed, or a file that can be read
        for name in ("max_sd", "acceleration") + (("sigma",) if self.sigma is not None else ()):
            if not getattr(self, name) > 0:
                raise ValueError(f"--{name.replace('_', '-')} must be positive, got {getattr(self, name)}")
        if self.min_receivers < 3:
            raise ValueError(f"--min-receivers must be at least 3, which a position takes, got {self.min_receivers}")

    @cached_property
    def sound(self) -> SoundSpeed:
        """What ``sound_speed`` says."""
        return read_sound_speed(self.sound_speed)

    def read(self, places: ReceiverPlaces) -> Detections:
        """The detections by the receivers whose places are known.

        Raises:
            ValueError: for files that disagree, naming the names they have.
        """
        detections = fit_names(read_aloud(self.detections), tuple(dict.fromkeys(places.called)), self.receivers)
        common = [name for name in detections.receivers if name in places.called]
        if len(common) < 3:
            heard = shorten(tuple(common))
            raise ValueError(f"a position takes three receivers; of {self.receivers} only {heard} heard anything")
        missing = [tag for tag in self.tags if tag not in detections.tags]
        if missing:
            raise ValueError(f"no detection of tag {missing[0]!r}; there are {shorten(detections.tags)}")
        return by_deployment(detections, places)

    def locate(self, detections: Detections, places: ReceiverPlaces, averaging: Averaging | None = None) -> Iterator[Located]:
        """Each tag in turn."""
        for tag in self.tags or detections.tags:
            yield self.locate_tag(detections.of_tag(tag), tag, places.position, averaging)

    def locate_tag(self, detections: Detections, tag: str, receivers: Floats, averaging: Averaging | None) -> Located:
        """Match, clean, average and locate the pings of one tag."""
        speed = self.sound.usual
        matched = match_pings(detections, array_window(receivers, speed))
        heard = len(matched.pings.time)
        cleaned = remove_impossible(replace(matched, pings=self.sound.level(matched.pings)), receivers, speed)
        pings = cleaned.pings if averaging else _of_at_least(cleaned.pings, self.min_receivers)
        setting = ArraySetting(
            sound_speed=speed, sigma=self.sigma or USUAL_SIGMA, acceleration_sigma=self.acceleration
        )
        if self.sigma is None:
            setting = replace(setting, sigma=estimate_sigma(pings, receivers, setting) or USUAL_SIGMA)
        agreement = agree(pings, receivers, setting)
        misfit, dropped = agreement.misfit, 0
        if self.method not in HARDY:
            pings, dropped = agreement.pings, agreement.dropped
            if not averaging:
                misfit = misfit[_heard_by(pings, self.min_receivers)]
                pings = _of_at_least(pings, self.min_receivers)
        information, count = None, np.ones(len(pings.time), dtype=np.int64)
        if averaging:
            blocks = average_pings(pings, averaging.number(pings, self.min_receivers), setting.sigma, averaging.systematic)
            pings, information, count = blocks.pings, blocks.information, blocks.count
            misfit = np.full(len(pings.time), np.nan)
        positions = locate(self.method, pings, receivers, setting, information=information, robust=averaging is None)
        if self.method not in HARDY:
            positions = widen(positions, misfit)
        positions = _certain(positions, self.max_sd)
        other, other_covariance = np.full_like(positions.position, np.nan), np.full_like(positions.covariance, np.nan)
        if not averaging:
            other = other_places(pings, receivers, setting, positions.position, positions.covariance)
            other_covariance = make_likelihood(pings, receivers, setting).positions(other).covariance
        return Located(
            tag=tag,
            heard=heard,
            pings=pings,
            count=count,
            positions=positions,
            sigma=setting.sigma,
            removed=cleaned.impossible + dropped,
            misfit=misfit,
            other=other,
            other_covariance=other_covariance,
        )


def widen(positions: Positions, misfit: Floats) -> Positions:
    """Covariances (K, n, n) by the square of a misfit (K,) above 1: what disagrees tells less than its arrivals say."""
    factor = np.where(misfit > 1.0, misfit, 1.0) ** 2
    return Positions(position=positions.position, covariance=positions.covariance * factor[:, None, None])


def _of_at_least(pings: Pings, receivers: int) -> Pings:
    kept = _heard_by(pings, receivers)
    return Pings(time=pings.time[kept], arrival=pings.arrival[kept])


def _heard_by(pings: Pings, receivers: int) -> NDArray[np.bool_]:
    """(K,) which pings at least so many receivers heard."""
    return np.asarray(pings.heard.sum(axis=1) >= receivers)


def _certain(positions: Positions, max_sd: float) -> Positions:
    """NaN where the worse direction is less certain than ``max_sd`` [m]."""
    finite = np.asarray(np.isfinite(positions.covariance).all(axis=(1, 2)))
    largest = np.full(len(finite), np.inf)
    largest[finite] = np.linalg.eigvalsh(positions.covariance[finite])[:, -1]
    certain = (largest <= max_sd**2) & np.isfinite(positions.position).all(axis=1)
    return Positions(
        position=np.where(certain[:, None], positions.position, np.nan),
        covariance=np.where(certain[:, None, None], positions.covariance, np.nan),
    )
