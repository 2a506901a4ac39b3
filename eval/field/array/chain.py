"""From detections to positions, tag by tag, as a function: match, clean, average, locate. `array locate` and `tracks` use it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tagtrack.eval.field.array.depth import TagHeight, require_depths
from tagtrack.eval.field.array.located import Located
from tagtrack.eval.field.array.sound import SoundSpeed
from tagtrack.eval.field.static_array.averaging import average_pings, number_by_count, number_by_time
from tagtrack.eval.field.static_array.consensus import agree
from tagtrack.eval.field.static_array.detections import Detections, time_resolution
from tagtrack.eval.field.static_array.likelihood import make_likelihood
from tagtrack.eval.field.static_array.matching import array_window, match_pings, remove_impossible, usual_interval
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions, check_receivers
from tagtrack.eval.field.static_array.noise import ROUNDING, estimate_sigma
from tagtrack.eval.field.static_array.registry import SMOOTHING, Estimator, locate
from tagtrack.eval.field.static_array.two_places import other_places

HARDY = ("pf", "yaps")  # methods that weigh arrivals which disagree by themselves
USUAL_SIGMA = 1e-3  # of an arrival [s], where the pings do not tell


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
class Locating:
    """How tags are located."""

    method: str | Estimator = "wls_ml"  # a name of ``METHODS``, or an estimator of one's own
    sound_speed: float | SoundSpeed = 1500.0  # [m/s], or a series of it
    sigma: float | None = None  # of an arrival [s]; None: what the pings with spare arrivals show, else 1 ms
    acceleration: float = 1e-3  # of the animal, for map, map_m and pf [m/s^1.5]
    min_receivers: int = 3  # that must have heard a ping
    max_sd: float = 100.0  # positions less certain than this in the worse direction are NaN [m]
    averaging: Averaging | None = None  # None: a position for each ping
    height: float | TagHeight | None = None  # of the tags above the receivers' zero [m], where it is known

    @property
    def sound(self) -> SoundSpeed:
        """The series of sound speeds, of one where a number is given."""
        if isinstance(self.sound_speed, SoundSpeed):
            return self.sound_speed
        return SoundSpeed(time=np.zeros(1), speed=np.array([float(self.sound_speed)]))


def locate_tags(
    detections: Detections,
    receivers: Mapping[str, ArrayLike],
    locating: Locating | None = None,
    *,
    tags: Sequence[str] = (),
) -> Iterator[Located]:
    """Match, clean, average and locate what moored receivers heard, one tag after the other.

    Args:
        detections: on corrected clocks, in order of time (``read_detections``; ``synchronize`` and ``correct`` for raw clocks).
        receivers: places (2,) [m] by name; detections by others are left out. With a third coordinate, upwards, positions are
            in space, or, at a known ``height``, horizontal.
        tags: to locate; all by default.
    Raises:
        ValueError: for a tag that nobody heard, fewer than three receivers with places (four in space), all in one place or, in
            space, in one plane, or a method that does not exist or returns other shapes than it should.

    >>> from tagtrack.eval.field import Detections, locate_tags
    >>> places = {"N": (0.0, 100.0), "S": (0.0, -100.0), "E": (100.0, 0.0), "W": (-100.0, 0.0)}
    >>> tag = np.array([30.0, 20.0])
    >>> heard = Detections(
    ...     time=np.array([np.linalg.norm(tag - place) / 1500.0 for place in places.values()]),
    ...     receiver=np.arange(4, dtype=np.int32), tag=np.zeros(4, np.int32), receivers=tuple(places), tags=("fish",))
    >>> [located] = locate_tags(heard, places)
    >>> located.positions.position.round(2)
    array([[30., 20.]])
    """
    known = [name for name in detections.receivers if name in receivers]
    locating = locating or Locating()
    place = _check_places(np.array([receivers[name] for name in known], np.float64).reshape(len(known), -1), locating)
    number = np.array([known.index(name) if name in known else -1 for name in detections.receivers], np.int32)
    fitted = replace(detections, receiver=number[detections.receiver], receivers=tuple(known))
    fitted = fitted.take(fitted.receiver >= 0)
    for tag in tags or detections.tags:
        yield locate_tag(fitted.of_tag(tag), tag, place, locating)


def locate_tag(detections: Detections, tag: str, receivers: Floats, locating: Locating) -> Located:
    """Match, clean, average and locate the pings of one tag; ``receivers`` (R, n) [m] in the order of the detections'."""
    sound, method, averaging = locating.sound, locating.method, locating.averaging
    speed = sound.usual
    matched = match_pings(detections, array_window(receivers, speed))
    heard, least = len(matched.pings.time), least_receivers(receivers, locating)
    cleaned = remove_impossible(replace(matched, pings=sound.level(matched.pings)), receivers, speed)
    pings = _with_height(cleaned.pings, tag, locating.height)
    without_height = len(cleaned.pings.time) - len(pings.time)
    pings = pings if averaging else _of_at_least(pings, least)
    setting = ArraySetting(
        sound_speed=speed, sigma=locating.sigma or USUAL_SIGMA, acceleration_sigma=locating.acceleration
    )
    if locating.sigma is None:
        step = time_resolution(detections.time)
        found = estimate_sigma(pings, receivers, setting, step=step)
        setting = replace(setting, sigma=found or max(USUAL_SIGMA, step * ROUNDING))
    agreement = agree(pings, receivers, setting)
    misfit, dropped = agreement.misfit, 0
    if method not in HARDY:
        pings, dropped = agreement.pings, agreement.dropped
        if not averaging:
            misfit = misfit[_heard_by(pings, least)]
            pings = _of_at_least(pings, least)
    information, count = None, np.ones(len(pings.time), dtype=np.int64)
    if averaging:
        blocks = average_pings(pings, averaging.number(pings, least), setting.sigma, averaging.systematic)
        pings, information, count = blocks.pings, blocks.information, blocks.count
        misfit = np.full(len(pings.time), np.nan)
    positions = locate(method, pings, receivers, setting, information=information, robust=averaging is None)
    if method not in HARDY:
        positions = widen(positions, misfit)
    positions = _certain(positions, locating.max_sd)
    other, other_covariance = np.full_like(positions.position, np.nan), np.full_like(positions.covariance, np.nan)
    if not averaging:
        alone = make_likelihood(pings, receivers, setting)
        # A track knows more of a position than its ping does: another place of the ping lies beyond what the ping itself knows.
        spread = alone.positions(positions.position).covariance if method in SMOOTHING else positions.covariance
        other = other_places(pings, receivers, setting, positions.position, spread)
        other_covariance = alone.positions(other).covariance
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
        without_height=without_height,
        interval=usual_interval(detections),
        crossing=array_window(receivers, speed, margin=0.0),
    )


def least_receivers(receivers: Floats, locating: Locating) -> int:
    """That must have heard a ping: as many as are wanted, and as a position takes."""
    dimensions = 2 if locating.height is not None else receivers.shape[1]
    return max(locating.min_receivers, dimensions + 1)


def _check_places(receivers: Floats, locating: Locating) -> Floats:
    if locating.height is None and receivers.shape[1] == 3:
        require_depths(check_receivers(receivers))
    return receivers if locating.height is not None else check_receivers(receivers)


def _with_height(pings: Pings, tag: str, height: float | TagHeight | None) -> Pings:
    """The pings at which the tag's height is known, with it; all where it is not asked for."""
    if height is None:
        return pings
    known = np.full(len(pings.time), height) if isinstance(height, int | float) else height.at(tag, pings.time)
    return replace(pings, height=known).take(np.isfinite(known))


def widen(positions: Positions, misfit: Floats) -> Positions:
    """Covariances (K, n, n) by the square of a misfit (K,) above 1: what disagrees tells less than its arrivals say."""
    factor = np.where(misfit > 1.0, misfit, 1.0) ** 2
    return Positions(position=positions.position, covariance=positions.covariance * factor[:, None, None])


def _of_at_least(pings: Pings, receivers: int) -> Pings:
    return pings.take(_heard_by(pings, receivers))


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
