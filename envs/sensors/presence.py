"""A receiver that logs which tag it hears, and no more (Masmitja et al. 2020, Eq. 22)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from tagtrack.envs.feature import Feature, Scale
from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.maths import normal_survival
from tagtrack.envs.kernels.resample_loops import fill_row
from tagtrack.envs.measurement import Status
from tagtrack.envs.model import BELIEF, TRUTH, read_by
from tagtrack.envs.sensors.sensor import CHANCE, OBSERVE, READ, WEIGH, Estimated, Glimpse, Prospect, Sensor
from tagtrack.envs.validation import require, settle_numbers

f32 = np.float32
RATIOS, RATIO_STEP = 64, 8.0  # a table of reception: so many ratios, so many metres apart
MAX_RANGE, RECEPTION = range(2)  # places in the numbers drawn for an episode


def normal_cdf(z: np.ndarray) -> np.ndarray:
    """Chance that a standard normal number lies below ``z``, exact far below the mean, too. Without scipy: vehicles lack it."""
    chance = np.where(z > 0.0, 1.0, 0.0)
    near = np.abs(z) < 15.0  # beyond, it is 0 or 1 to the last bit of a float32
    chance[near] = [0.5 * math.erfc(-value) for value in z[near] / math.sqrt(2.0)]
    return chance


@native(CHANCE)
def chance(distance, drawn_0, drawn_1, parameters):
    """Chance that a ping from a distance [m] is logged: Eq. 22's survival function times the reception."""
    detection_sigma = parameters[3]
    return drawn_1 * 0.5 * math.erfc((distance - drawn_0) / (math.sqrt(2.0) * detection_sigma))


@native(CHANCE)
def measured_chance(distance, drawn_0, drawn_1, parameters):
    """The measured ratio; the parameters are the table."""
    row = int(distance / RATIO_STEP)
    return parameters[row] if row < RATIOS else 0.0


@native(READ)
def read(measurement, encounter, normal_1, normal_2, uniform_1, uniform_2, parameters):
    """Nothing beyond that it was heard."""


@compiled
def weigh_detection(weight, x, y, reach, own_x, own_y, depth, sigma, floor):
    """Multiply by the survival function of the distance about each particle's ``reach`` [m] (Eq. 22, a ping was heard)."""
    per_sigma = f32(1.0) / sigma
    below = depth * depth
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        z = (np.sqrt(dx * dx + dy * dy + below) - reach[i]) * per_sigma
        weight[i] *= floor + normal_survival(z)


@compiled
def weigh_silence(weight, x, y, reach, own_x, own_y, depth, sigma, reception, floor):
    """Multiply by 1 minus ``reception`` times that function; with a reception of 1 by the CDF (Eq. 22, none was heard)."""
    per_sigma = f32(1.0) / sigma
    below = depth * depth
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        z = (np.sqrt(dx * dx + dy * dy + below) - reach[i]) * per_sigma
        weight[i] *= floor + f32(1.0) - reception * normal_survival(z)


@compiled
def weigh_by_cauchy(weight, x, y, reach, own_x, own_y, depth, sigma, reception, heard, floor):
    """As ``weigh_detection`` where ``heard``, else as ``weigh_silence``, by the Cauchy distribution's survival function."""
    per_sigma = f32(1.0) / sigma
    below = depth * depth
    least = f32(0.0) if heard else f32(1.0)
    gain = reception if heard else -reception
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        z = (np.sqrt(dx * dx + dy * dy + below) - reach[i]) * per_sigma
        survival = f32(0.5) - f32(math.atan(z) / math.pi)
        weight[i] *= floor + least + gain * survival


@native(WEIGH)
def weigh(weight, particles, measurement, floor, work, parameters):
    """Masmitja et al. 2020, Eq. 22, by its text and its sigmas: as printed its two cases are interchanged.

    A detection weighs by the survival function, a silence by the CDF, each with a sigma of its own. Where a belief assumes that
    pings within range are missed (a ``reception`` below 1), silence says less: 1 minus reception times the survival function.
    """
    max_range, detection_sigma, silence_sigma = f32(parameters[0]), f32(parameters[3]), f32(parameters[4])
    reception, heavy_tails = f32(parameters[5]), parameters[7] > 0.0
    own_x, own_y, depth = f32(measurement.x), f32(measurement.y), f32(measurement.depth)
    x, y = particles[0], particles[1]
    if particles.shape[0] > 4:
        reach = particles[4]
    else:
        reach = work
        fill_row(reach, max_range)
    heard = measurement.status == Status.HEARD
    if heavy_tails:
        sigma = detection_sigma if heard else silence_sigma
        weigh_by_cauchy(weight, x, y, reach, own_x, own_y, depth, sigma, f32(1.0) if heard else reception, heard, floor)
    elif heard:
        weigh_detection(weight, x, y, reach, own_x, own_y, depth, detection_sigma, floor)
    else:
        weigh_silence(weight, x, y, reach, own_x, own_y, depth, silence_sigma, reception, floor)


@native(OBSERVE)
def observe(out, listener, dx, dy, estimated, estimated_spread, length, spread, parameters):
    out[0] = min(estimated / length, 10.0)
    out[1] = min(estimated_spread / 50.0, 4.0)


@dataclass(frozen=True, kw_only=True)
class PresenceReceiver(Sensor):
    """A receiver that logs which tag it hears, and no more. The defaults are the filter of Masmitja et al. 2020 (AOTT).

    The truth hears with the chance ``reception`` times the survival function of the distance about ``max_range``. A ``_spread``
    is half the width of the interval from which the truth draws a value for each episode. A belief spreads its particles over
    that of ``max_range`` and assumes the middle of that of ``reception``.
    """

    max_range: float = 250.0  # mu of Eq. 22: where the chance has fallen to half [m]
    max_range_spread: float = 0.0  # [m]; in a belief more than 0: estimated together with the position
    max_range_walk: float = read_by(BELIEF, 3.0)  # of an estimated range, at each correction [m]: lest all become alike
    detection_sigma: float = 4.5  # sigma_w of the survival function [m]: how soft the edge is
    silence_sigma: float = read_by(BELIEF, 9.0)  # sigma_w of the CDF, by which silence is scored [m]
    reception: float = 1.0  # successful receptions over transmissions within range; 1 in a belief is the paper's Eq. 22
    reception_spread: float = read_by(TRUTH, 0.0)
    # Whether a Cauchy distribution weighs, as in the published code of Masmitja, in place of Eq. 22's normal one.
    heavy_tails: bool = read_by(BELIEF, False)
    name: ClassVar[str] = "presence"
    legend: ClassVar[str] = "range, when heard"
    read: ClassVar[Native | None] = read
    weigh: ClassVar[Native | None] = weigh
    chance: ClassVar[Native | None] = chance
    observe: ClassVar[Native | None] = observe

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("max_range", "detection_sigma", "silence_sigma"):
            require(getattr(self, name) > 0, self, name, "positive")
        require(self.max_range_walk >= 0, self, "max_range_walk", "at least 0")
        require(0 <= self.max_range_spread < self.max_range, self, "max_range_spread", "at least 0 and below max_range")
        require(0 < self.reception <= 1, self, "reception", "more than 0 and at most 1")
        widest = min(self.reception, 1.0 - self.reception) + 1e-9
        require(0 <= self.reception_spread <= widest, self, "reception_spread", "such that reception stays within 0 to 1")

    def unread(self, side: str) -> dict[str, str]:
        unread = dict(super().unread(side))
        if side == BELIEF and self.max_range_spread == 0.0:
            unread["max_range_walk"] = "without a max_range_spread the range is taken as known"
        return unread

    @property
    def working_range(self) -> float:
        """Distance [m] at which nine tenths of what is heard near by are still heard."""
        return self.max_range - 1.2816 * self.detection_sigma

    @property
    def draws(self) -> tuple[tuple[float, float], ...]:
        return (self.max_range, self.max_range_spread), (self.reception, self.reception_spread)

    @property
    def weighs_silence(self) -> bool:
        return True

    @property
    def assumed(self) -> float:
        return self.max_range

    @property
    def estimated(self) -> Estimated | None:
        if self.max_range_spread == 0.0:
            return None
        return Estimated(middle=self.max_range, half_width=self.max_range_spread, walk=self.max_range_walk)

    def features(self, scale: Scale) -> tuple[Feature, ...]:
        return (
            Feature("max_range", f"range within which the tag is believed to be heard / {scale.length:g} m", 0.0, 10.0),
            Feature("max_range_spread", "its standard deviation / 50 m; 0 where it is assumed", 0.0, 4.0),
        )

    def glimpse(self, measurement: Any, estimated: float) -> Glimpse:
        return Glimpse(words=f"{estimated:.0f} m", radius=estimated)

    def prospect(self, distance: np.ndarray, floor: float) -> Prospect:
        """Silence or detection (Eq. 22)."""
        heard = self.reception * normal_cdf((self.max_range - distance) / self.detection_sigma)
        return Prospect(by_distance=True, likelihood=np.stack((1.0 - heard, heard), axis=1), silence_tells=True)


@dataclass(frozen=True, kw_only=True)
class MeasuredReception(Sensor):
    """A presence receiver that hears as often as was measured at sea; for the truth: a belief assumes a ``PresenceReceiver``.

    The defaults are the whole campaign of Masmitja et al. 2020: canister C and moorings A and B at receivers A, B, D and E, means
    where several pairs lie at one distance. They do not fall with it. Beyond 217 m nothing was measured; there the ratio runs to
    the 20 % that the text gives for 400 m.
    """

    distances: tuple[float, ...] = (0.0, 48.0, 95.0, 133.0, 144.0, 164.0, 193.0, 217.0, 400.0)  # rising [m]; none is heard beyond
    ratios: tuple[float, ...] = (0.365, 0.31, 0.47, 0.375, 0.443, 0.32, 0.53, 0.43, 0.2)
    name: ClassVar[str] = "measured"
    read: ClassVar[Native | None] = read
    chance: ClassVar[Native | None] = measured_chance

    def __post_init__(self) -> None:
        distances, ratios = (np.asarray(column, float) for column in (self.distances, self.ratios))
        rises = distances.ndim == 1 and distances.size > 0 and bool((np.diff(distances) > 0).all()) and distances[0] >= 0
        require(rises and distances[-1] < RATIOS * RATIO_STEP, self, "distances", f"rising, from 0 to {RATIOS * RATIO_STEP:g} m")
        within = ratios.shape == distances.shape and bool(((ratios >= 0) & (ratios <= 1)).all())
        require(within, self, "ratios", "as many as distances, each within 0 to 1")

    def row(self) -> tuple[float, ...]:
        distance = RATIO_STEP * (np.arange(RATIOS) + 0.5)
        return tuple(np.interp(distance, self.distances, self.ratios, right=0.0).tolist())
