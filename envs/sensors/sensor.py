"""What a sensor is: how it draws a reading of a ping, how it scores particles by one, and what is seen of it.

The world draws with one object and a belief scores with another of the same readings. A sensor brings its parameters and, in
compiled code, ``read`` and ``weigh``, and where it needs them ``chance`` and ``observe``. Everything else asks the object.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from tagtrack.envs.feature import Feature, Scale
from tagtrack.envs.kernels.calling import (
    Native,
    Signature,
    nothing,
    number,
    numbers,
    record_of,
    require_functions,
    rows,
    single,
    singles,
)
from tagtrack.envs.measurement import LISTENER, MEASUREMENT
from tagtrack.envs.model import Model

DRAWS = 2  # numbers that the truth may draw for each episode and tag

# The truth about one vehicle and one tag, which a sensor draws from and no belief ever sees. `x`, `y`, `heading` of the vehicle,
# place and `depth` of the fish below it, horizontal `range` and slant `distance` [m, rad]; when the ping was sent, `ping`, and
# the tag's first one [s], its `period`; `clock_error` by which the receiver takes a ping for later than it was [s]; `drawn` for
# the episode (`Sensor.draws`); `noisy`: a burst of losses; whether the tag `pinged` and was `heard` at this step.
ENCOUNTER = np.dtype(
    [(name, np.bool_) for name in ("noisy", "pinged", "heard")]
    + [
        (name, np.float64)
        for name in (
            "x", "y", "heading", "fish_x", "fish_y", "depth", "range", "distance", "ping", "first_ping", "period", "clock_error",
        )
    ]
    + [("drawn", np.float64, (DRAWS,))]
)  # fmt: skip

# Chance that a ping from a distance [m] is usable, beside what the water does to it; `drawn_0` and `drawn_1` are the episode's.
CHANCE = Signature("chance", number, distance=number, drawn_0=number, drawn_1=number, parameters=numbers)
# Fills `measurement.readings` of a heard ping from the truth, two standard normals and two uniforms.
READ = Signature(
    "read",
    nothing,
    measurement=record_of(MEASUREMENT),
    encounter=record_of(ENCOUNTER),
    normal_1=number,
    normal_2=number,
    uniform_1=number,
    uniform_2=number,
    parameters=numbers,
)
# Multiplies the weights (N,) of particles (4 or more, N: x, y, heading, speed, and the estimated number) by the likelihood of a
# heard ping or, where the sensor weighs silence, of a missed one. `floor` is the least that a weight is multiplied by, `work`
# (N,) a row to work in.
WEIGH = Signature(
    "weigh",
    nothing,
    weight=singles,
    particles=rows,
    measurement=record_of(MEASUREMENT),
    floor=single,
    work=singles,
    parameters=numbers,
)
# Fills the sensor's own features from what the listener remembers, the offset of the estimate from the vehicle [m], the estimated
# number and its spread, and the task's scale of lengths and spreads [m].
OBSERVE = Signature(
    "observe",
    nothing,
    out=singles,
    listener=record_of(LISTENER),
    dx=number,
    dy=number,
    estimated=number,
    estimated_spread=number,
    length=number,
    spread=number,
    parameters=numbers,
)

# Callables of addresses, for compiled code.
chance_at, read_at, weigh_at, observe_at = CHANCE.at, READ.at, WEIGH.at, OBSERVE.at


class Estimated(NamedTuple):
    """A number that a belief estimates together with the position, as a further row of its particles."""

    middle: float
    half_width: float  # of the interval in which it lies
    walk: float  # standard deviation of its step at each correction: lest its particles become all alike


class Ring(NamedTuple):
    """A reading that is a slant range: a first one, or one that refutes the belief, says where particles must be."""

    reading: int  # its place in `readings`
    sigma: float  # [m]
    factor: float  # reading / true range


class Gate(NamedTuple):
    """A reading that jumps from the one before is not used."""

    reading: int  # its place in `readings`
    largest_jump: float


class Glimpse(NamedTuple):
    """How the last reading of a vehicle is drawn and told."""

    words: str = ""
    fan: tuple[float, float] | None = None  # angles off the bow, to both sides, between which the fish may be [rad]
    radius: float = np.nan  # about the vehicle [m]


class Prospect(NamedTuple):
    """What a planner needs to know of a sensor: tables over places about a vehicle."""

    by_distance: bool  # rows of the likelihood go by the distance in whole metres, not by the cosine of the bearing
    likelihood: np.ndarray  # (A, Z) chance of each reading, as a filter scores it; rows need not sum to one
    silence_tells: bool = False  # a missed ping is a reading, too: every ping tells something


@dataclass(frozen=True, kw_only=True)
class Sensor(Model):
    """Base of all sensors. Subclasses are frozen keyword-only dataclasses of parameters."""

    readings: ClassVar[tuple[str, ...]] = ()  # names of what it reads of a ping; truth and belief must have the same
    hydrophones: ClassVar[int] = 1  # that must hear a ping, each by itself
    asks: ClassVar[bool] = False  # the tag is asked, so that a missing answer is known at once
    in_plane: ClassVar[bool] = False  # depth is left out of its readings
    needs_period: ClassVar[bool] = False  # it must know when a ping was sent
    legend: ClassVar[str] = "last reading"  # what the picture shows of it
    read: ClassVar[Native | None] = None
    weigh: ClassVar[Native | None] = None
    chance: ClassVar[Native | None] = None
    observe: ClassVar[Native | None] = None

    def __init_subclass__(cls) -> None:
        require_functions(cls, read=READ, weigh=WEIGH, chance=CHANCE, observe=OBSERVE)

    # The truth's side.

    @property
    def clock_sigma(self) -> float:
        """Standard deviation of the clocks' error, drawn for each episode [s]."""
        return 0.0

    @property
    def draws(self) -> tuple[tuple[float, float], ...]:
        """Middle and half width of the numbers that the truth draws for each episode, uniformly: at most two."""
        return ()

    # The belief's side.

    @property
    def weighed(self) -> tuple[int, ...]:
        """Places of the readings that a belief scores a ping by: they must be there."""
        return tuple(range(len(self.readings)))

    @property
    def weighs_silence(self) -> bool:
        """Whether a belief scores a missed ping."""
        return False

    @property
    def assumed(self) -> float:
        """The number that others estimate, where it is taken as known (shown in observation and picture)."""
        return 0.0

    @property
    def estimated(self) -> Estimated | None:
        return None

    @property
    def ring(self) -> Ring | None:
        return None

    @property
    def gate(self) -> Gate | None:
        return None

    # What is seen of it.

    def features(self, scale: Scale) -> tuple[Feature, ...]:
        """The sensor's own numbers in the observation, in the order in which ``observe`` fills them."""
        return ()

    def glimpse(self, measurement: Any, estimated: float) -> Glimpse:
        """How a heard ping is drawn; ``measurement`` is a record, ``estimated`` the belief's number."""
        return Glimpse()

    def prospect(self, distance: np.ndarray, floor: float) -> Prospect | None:
        """For planners: ``distance`` (A,) are the middles of whole metres; None where nothing can be foreseen.

        ``floor`` is the least weight of the belief.
        """
        return None

    def require_belief(self) -> None:
        """Raise ValueError where a belief cannot score with these parameters."""
        if self.weigh is None:
            raise ValueError(f"a belief cannot score with a {type(self).__name__}, which only draws")


COSINE_BINS = 2048  # of tables by bearing: at most 2.5 degrees, a quarter of a stereo hydrophone's sigma, a bin


def middle_cosines() -> np.ndarray:
    """(COSINE_BINS,) cosines of the bearing at the middles of equal bins from -1 to 1."""
    return (np.arange(COSINE_BINS) + 0.5) * (2.0 / COSINE_BINS) - 1.0
