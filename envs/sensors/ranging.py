"""A slant range, by modem or synchronized tag (Masmitja et al. 2020, Eq. 21)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from tagtrack.envs.feature import Feature, Scale
from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.maths import fast_exp
from tagtrack.envs.kernels.resample_loops import fill_row
from tagtrack.envs.measurement import Status
from tagtrack.envs.model import BELIEF, TRUTH, read_by
from tagtrack.envs.sensors.presence import normal_cdf, weigh_silence
from tagtrack.envs.sensors.sensor import OBSERVE, READ, WEIGH, Glimpse, Prospect, Ring, Sensor
from tagtrack.envs.validation import require, settle_numbers

f32 = np.float32
SLANT_RANGE = 0  # place in the readings


@native(READ)
def read(measurement, encounter, normal_1, normal_2, uniform_1, uniform_2, parameters):
    """Slant range from the true one: scaled, with Gaussian and uniform noise, never negative."""
    sigma, tolerance, factor = parameters[0], parameters[1], parameters[2]
    reading = factor * encounter.distance + sigma * normal_1 + tolerance * (2.0 * uniform_1 - 1.0)
    measurement.readings[SLANT_RANGE] = max(reading, 0.0)


@compiled
def weigh_range(weight, x, y, own_x, own_y, depth, slant_range, factor, sigma, floor):
    """Multiply by the likelihood of a slant range to a fish at a known ``depth`` [m] (Masmitja et al. 2020, Eq. 21)."""
    precision = f32(-0.5) / (sigma * sigma)
    peak = f32(1.0 / math.sqrt(2.0 * math.pi)) / sigma
    below = depth * depth
    for i in range(weight.shape[0]):
        dx = x[i] - own_x
        dy = y[i] - own_y
        miss = factor * np.sqrt(dx * dx + dy * dy + below) - slant_range
        weight[i] *= floor + peak * fast_exp(precision * miss * miss)


@native(WEIGH)
def weigh(weight, particles, measurement, floor, work, parameters):
    sigma, factor = f32(parameters[0]), f32(parameters[2])
    max_range, silence_sigma, reception = f32(parameters[3]), f32(parameters[4]), f32(parameters[5])
    own_x, own_y, depth = f32(measurement.x), f32(measurement.y), f32(measurement.depth)
    if measurement.status == Status.HEARD:
        slant_range = f32(measurement.readings[SLANT_RANGE])
        weigh_range(weight, particles[0], particles[1], own_x, own_y, depth, slant_range, factor, sigma, floor)
    else:
        fill_row(work, max_range)
        weigh_silence(weight, particles[0], particles[1], work, own_x, own_y, depth, silence_sigma, reception, floor)


@native(OBSERVE)
def observe(out, listener, dx, dy, estimated, estimated_spread, length, spread, parameters):
    out[0] = 0.0
    out[1] = 0.0
    reading = listener.readings[SLANT_RANGE]
    if not math.isnan(reading):
        out[0] = min(reading / length, 10.0)
    if listener.status == Status.HEARD:
        expected = math.sqrt(dx * dx + dy * dy + listener.depth * listener.depth)
        out[1] = min(max((reading - expected) / spread, -8.0), 8.0)


def require_factor(receiver: Any) -> None:
    """Refuse a ``range_factor`` of no sound speed, by which a reading would put particles where float32 ends."""
    require(0.1 <= receiver.range_factor <= 10.0, receiver, "range_factor", "from 0.1 to 10")


@dataclass(frozen=True, kw_only=True)
class RangeReceiver(Sensor):
    """Slant range, by modem or synchronized tag. A belief scores by ``range_sigma`` and ``range_factor`` (Eq. 21).

    With a ``max_range`` a belief scores silence too: an answer that did not come says that the fish may be farther than that.
    """

    range_sigma: float = 5.0  # of the Gaussian noise [m]
    range_tolerance: float = read_by(TRUTH, 0.0)  # half width of a further, uniform noise [m]
    range_factor: float = 1.0  # reading / true range: the error of the assumed sound speed
    max_range: float = read_by(BELIEF, 0.0)  # where the chance to be heard has fallen to half [m]; 0: silence says nothing
    silence_sigma: float = read_by(BELIEF, 10.0)  # how soft that edge is [m]
    reception: float = read_by(BELIEF, 0.9)  # share of the pings from within that are heard
    name: ClassVar[str] = "range"
    readings: ClassVar[tuple[str, ...]] = ("slant_range",)
    asks: ClassVar[bool] = True
    legend: ClassVar[str] = "last range"
    read: ClassVar[Native | None] = read
    weigh: ClassVar[Native | None] = weigh
    observe: ClassVar[Native | None] = observe

    def __post_init__(self) -> None:
        settle_numbers(self)
        for name in ("range_sigma", "range_tolerance", "max_range"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        require(self.silence_sigma > 0, self, "silence_sigma", "positive")
        require_factor(self)
        require(0 < self.reception <= 1, self, "reception", "more than 0 and at most 1")

    def unread(self, side: str) -> dict[str, str]:
        unread = dict(super().unread(side))
        if side == BELIEF and self.max_range == 0.0:
            unread |= dict.fromkeys(("silence_sigma", "reception"), "without a max_range silence says nothing")
        return unread

    def require_belief(self) -> None:
        require(self.range_sigma > 0, self, "range_sigma", "positive in a belief")

    @property
    def weighs_silence(self) -> bool:
        return self.max_range > 0.0

    @property
    def assumed(self) -> float:
        return self.max_range

    @property
    def ring(self) -> Ring:
        return Ring(reading=SLANT_RANGE, sigma=self.range_sigma, factor=self.range_factor)

    def features(self, scale: Scale) -> tuple[Feature, ...]:
        return (
            Feature("last_range", f"last slant range / {scale.length:g} m; 0 before the first", 0.0, 10.0),
            Feature(
                "range_miss", f"slant range just read minus that to the estimate / {scale.spread:g} m; 0 if none", -8.0, 8.0
            ),
        )

    def glimpse(self, measurement: Any, estimated: float) -> Glimpse:
        slant_range, depth = float(measurement["readings"][SLANT_RANGE]), float(measurement["depth"])
        radius = math.sqrt(max(slant_range**2 - depth**2, 0.0))
        return Glimpse(words=f"{radius:.0f} m", radius=radius)

    def prospect(self, distance: np.ndarray, floor: float) -> Prospect:
        """Ranges in bins two sigmas wide (Eq. 21)."""
        width = 2.0 * self.range_sigma
        edges = np.arange(math.ceil(self.range_factor * distance[-1] / width) + 2) * width
        below = normal_cdf((edges - self.range_factor * distance[:, None]) / self.range_sigma)
        return Prospect(by_distance=True, likelihood=np.diff(below, axis=1))
