"""A scenario: every parameter of a task, truth and belief apart. Small frozen dataclasses, SI units, a paper's defaults.

``SCENARIOS`` holds one for each environment id; ``overrides.py`` changes single values by their dotted names.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field, replace

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.recovery import Recovery
from tagtrack.envs.feature import Scale
from tagtrack.envs.frame import Frame
from tagtrack.envs.kernels.random import MOST
from tagtrack.envs.motions import MomentumRandomWalk, Motion, Path
from tagtrack.envs.rewards import Reward
from tagtrack.envs.sensors import (
    PresenceReceiver,
    RangeReceiver,
    Sensor,
    StereoHydrophone,
    TimeOfFlightReceiver,
)
from tagtrack.envs.sensors.sensor import DRAWS
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.sim.modem import Modem, ModemRule, PerfectModem, modem_rule
from tagtrack.envs.sim.vehicle import Vehicle
from tagtrack.envs.tag import Tag
from tagtrack.envs.validation import brief, require, settle_numbers, unknown

LONGEST_STEP = 1e5  # [s], a little more than a day
MOST_STEPS = 10**7  # of an episode
MOST_REPEATS = 10_000  # in a time step, of what happens again and again: corrections of the heading, pings, packets, legs


class Formation(enum.IntEnum):
    """How several vehicles lie about the origin when an episode begins."""

    RING = 0  # at the corners of a regular polygon, the first one to the east
    LINE = 1  # abreast, from south to north


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where the fish is when an episode begins; a single vehicle lies at the origin, several in formation about it."""

    nearest: float = 20.0  # [m], as in the trials of section 5.1
    farthest: float = 60.0  # [m]: near enough that the first pings are heard; with 100 (L) an episode may begin unheard
    shallowest: float = 0.0  # depth of the fish below the vehicle, drawn for each episode; the vehicle knows it [m]
    deepest: float = 0.0
    formation: Formation = Formation.RING
    separation: float = 20.0  # between neighbours in the formation [m]

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.nearest >= 0, self, "nearest", "at least 0")
        require(self.farthest >= self.nearest, self, "farthest", f"at least nearest ({self.nearest} m)")
        require(self.shallowest >= 0, self, "shallowest", "at least 0")
        require(self.deepest >= self.shallowest, self, "deepest", f"at least shallowest ({self.shallowest} m)")
        require(self.separation >= 0, self, "separation", "at least 0")

    def places(self, vehicles: int) -> tuple[tuple[float, float], ...]:
        """Where so many vehicles lie at the start (x, y) [m]."""
        if vehicles == 1:
            return ((0.0, 0.0),)
        if self.formation == Formation.LINE:
            return tuple((0.0, self.separation * (v - 0.5 * (vehicles - 1))) for v in range(vehicles))
        radius = 0.5 * self.separation / math.sin(math.pi / vehicles)
        turns = [2.0 * math.pi * v / vehicles for v in range(vehicles)]
        return tuple((radius * math.cos(turn), radius * math.sin(turn)) for turn in turns)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One task. A policy chooses a course at every ``time_step``, at which fish, filter and reward run, too.

    The paper's loop runs at 1 Hz. Here the heading controller alone does (``Vehicle.control_interval``): between two pings
    there is nothing new to decide.
    """

    time_step: float = 2.0  # [s]: the period of the tag
    episode_steps: int = 300  # 10 minutes, as missions stationaryTrackB and C (Table IV)
    vehicles: int = 1
    targets: int = 1  # fish, one tag each
    modem: Modem = field(default_factory=PerfectModem)  # what vehicles may tell one another; decides who has which beliefs
    message_control: bool = False  # whether the action says if the vehicle uses its next slot to send
    speed_control: bool = False  # whether the action sets the speed, too
    steer_by: Frame = Frame.AUTO  # what the course of an action is relative to
    vehicle: Vehicle = field(default_factory=Vehicle)
    fish: Motion | Path = field(
        default_factory=lambda: MomentumRandomWalk(speed_sigma=0.05, turn_sigma=0.15, max_speed=0.5)
    )
    start: Start = field(default_factory=Start)
    tag: Tag = field(default_factory=Tag)
    water: Water = field(default_factory=Water)
    receiver: Sensor = field(default_factory=StereoHydrophone)
    # Table I's diffusion (FILTERS["standard"]) spreads particles far faster than this fish swims; section 7 finds that tuning it
    # helps, so the task assumes a fish somewhat faster and more restless than the true one.
    belief: Belief = field(
        default_factory=lambda: Belief(motion=MomentumRandomWalk(speed_sigma=0.06, turn_sigma=0.2, max_speed=0.6))
    )
    reward: Reward = field(default_factory=Reward)
    scale: Scale = field(default_factory=Scale)  # of the observation
    lost_error: float = 100.0  # beyond it the fish counts as lost [m]: further off than a receiver reaches (4.1)

    def __post_init__(self) -> None:
        settle_numbers(self, time_step=LONGEST_STEP)
        for name in ("time_step", "lost_error"):
            require(getattr(self, name) > 0, self, name, "positive")
        for name, most in (("episode_steps", MOST_STEPS), ("vehicles", MOST), ("targets", MOST)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ValueError(f"Scenario.{name} must be a whole number of at least 1, got {brief(value)}")
            if value > most:
                raise ValueError(f"Scenario.{name} must be at most {most}, got {brief(value)}")
        if not isinstance(self.fish, (Motion, Path)):
            raise ValueError(f"Scenario.fish must be a Motion or a Path, got {self.fish!r}")
        self._check_receiver()
        self._check_modem()
        self._check_pace()

    def _check_pace(self) -> None:
        """Nothing within a time step may go on for ever."""
        finest = self.time_step / MOST_REPEATS
        paced = ((self.vehicle, "control_interval"), (self.tag, "period"), (self.modem, "slot"), (self.fish, "longest_leg"))
        for part, name in paced:
            if getattr(part, name, 0.0):  # 0: it never happens
                require(getattr(part, name) >= finest, part, name, f"at least {finest:g} s, a {MOST_REPEATS}th of the time step")

    def _check_modem(self) -> None:
        if not isinstance(self.modem, Modem):
            raise ValueError(f"Scenario.modem must be a Modem, got {self.modem!r}")
        self.modem_rule  # noqa: B018 - raises where the modem does not suit the fleet
        for name, asked in (("message_control", self.message_control), ("reward.message", self.reward.message > 0)):
            if asked and not self.modem.talks:
                raise ValueError(f"Scenario.{name} is about messages, and a {type(self.modem).__name__} sends none")

    def _check_receiver(self) -> None:
        own, assumed = self.receiver, self.belief.receiver
        if not isinstance(own, Sensor) or own.read is None:
            raise ValueError(f"Scenario.receiver must be a Sensor that reads, got {own!r}")
        if assumed.readings != own.readings:
            raise ValueError(
                f"Scenario.belief.receiver cannot score the readings of a {type(own).__name__}, got {type(assumed).__name__}"
            )
        if len(own.draws) > DRAWS:
            raise ValueError(f"{type(own).__name__}.draws must be at most {DRAWS} numbers, got {len(own.draws)}")
        if self.start.deepest > 0 and own.in_plane:
            raise ValueError(f"Start.deepest must be 0 with a {type(own).__name__}, whose bearings are in the plane")
        if self.tag.random_delay > 0 and own.needs_period:
            raise ValueError(f"Tag.random_delay must be 0 with a {type(own).__name__}, which must know when a ping was sent")

    @property
    def owners(self) -> int:
        """Number of beliefs: one, or one for each vehicle."""
        return 1 if self.modem.shares else self.vehicles

    @property
    def modem_rule(self) -> ModemRule:
        """What compiled code reads of the modem. Raises ValueError where it does not suit the fleet."""
        readings = len(self.belief.receiver.weighed)
        return modem_rule(self.modem, self.vehicles, readings, self.time_step, at_will=self.message_control)

    @property
    def frame(self) -> Frame:
        """What courses are relative to: ``steer_by``, with ``AUTO`` decided."""
        if self.steer_by != Frame.AUTO:
            return self.steer_by
        return Frame.HEADING if self.targets > 1 else Frame.LINE


# Bearing and one-way range (Lin et al. 2013): a tag that was calibrated four hours ago, up to 85 m away at first, as far as the
# vehicle was tied in V.B. Of the two rates of recovery the paper says nothing: a slow_rate of 0.02 scatters twice as many
# particles while nothing is wrong, and the way back from a wrong belief is a few seconds shorter.
TIME_OF_FLIGHT = Scenario(
    start=Start(nearest=20.0, farthest=85.0),
    receiver=TimeOfFlightReceiver(),
    belief=Belief(
        motion=MomentumRandomWalk(speed_sigma=0.06, turn_sigma=0.2, max_speed=0.6),
        receiver=TimeOfFlightReceiver(range_sigma=3.0),
        weight_floor=1e-7,  # w_min of Eq. 8
        recovery=Recovery(slow_rate=0.01, fast_rate=0.3),
    ),
)

# Range-only tracking (Masmitja et al. 2020, Eq. 21): a modem on a vehicle at the surface asks a tag on a slow animal every 10 s.
# The sound speed is assumed 1 % too high, as in Masmitja et al. 2023; the filter knows nothing of it.
RANGE_ONLY = Scenario(
    time_step=10.0,
    episode_steps=360,  # one hour
    vehicle=Vehicle(
        max_speed=1.0, max_turn_rate=0.1, heading_gain=0.1, control_interval=5.0, fix_interval=0.0
    ),
    fish=MomentumRandomWalk(speed_sigma=0.01, turn_sigma=0.05, max_speed=0.4),
    start=Start(nearest=50.0, farthest=400.0, shallowest=10.0, deepest=60.0),
    tag=Tag(period=10.0),
    water=Water(reach=900.0, edge_width=30.0, clear_hearing=0.9, noisy_share=0.0),
    receiver=RangeReceiver(range_sigma=5.0, range_factor=1.01),
    belief=Belief(
        motion=MomentumRandomWalk(speed_sigma=0.012, turn_sigma=0.06, max_speed=0.5),
        receiver=RangeReceiver(range_sigma=6.0),
        half_width=400.0,
        renewed_share=0.02,
        renewed_radius=200.0,
    ),
    scale=Scale(length=200.0, near=60.0, spread=20.0, memory=200.0),
)

# Area-only tracking (Masmitja et al. 2020): a Wave Glider hears a Vemco V7 or not. Where the reception ratio, 60 to 100 %
# (Fig. 3D), is full, 90 % of the pings are heard at the working range of 250 m and 20 % at 400 m, the most that Fig. S3 found
# there; over all episodes 72 and 16 %.
AREA_RECEIVER = PresenceReceiver(max_range=340.0, detection_sigma=70.0, reception=0.8, reception_spread=0.2)
AREA_ASSUMED = PresenceReceiver(max_range=340.0, detection_sigma=70.0, silence_sigma=70.0, reception=0.8)
AREA_ONLY = Scenario(
    time_step=30.0,
    episode_steps=720,  # six hours, some 288 pings; the paper's field test lasted fifteen
    vehicle=Vehicle(max_speed=1.0, max_turn_rate=0.05, heading_gain=0.05, control_interval=15.0, fix_interval=0.0),
    fish=MomentumRandomWalk(speed_sigma=0.005, turn_sigma=0.02, max_speed=0.3),
    start=Start(nearest=50.0, farthest=300.0),
    tag=Tag(period=60.0, random_delay=30.0),
    water=Water(reach=2000.0, edge_width=1.0, clear_hearing=1.0, noisy_share=0.0),  # all losses are the receiver's
    receiver=AREA_RECEIVER,
    belief=Belief(
        motion=MomentumRandomWalk(speed_sigma=0.006, turn_sigma=0.025, max_speed=0.35),
        receiver=AREA_ASSUMED,
        half_width=400.0,
        renewed_share=0.015,
    ),
    reward=Reward(error_cap=1000.0),
    scale=Scale(length=200.0, near=60.0, spread=20.0, memory=300.0),
    lost_error=400.0,
)

# Vehicles that are no faster than the fish, as gliders and surface drifters are: a wrong turn is not made good again. One after a
# fish of its own speed, two that must share out four, and one that has ranges alone, of which its own path makes positions.
GLIDER = Scenario(
    vehicle=Vehicle(max_speed=0.8),
    fish=MomentumRandomWalk(speed_sigma=0.05, turn_sigma=0.15, max_speed=0.8),
    belief=Belief(motion=MomentumRandomWalk(speed_sigma=0.06, turn_sigma=0.2, max_speed=0.9)),
)
GLIDER_PAIR = Scenario(vehicles=2, targets=4, vehicle=Vehicle(max_speed=0.5))
RANGE_ONLY_GLIDER = replace(
    RANGE_ONLY,
    vehicle=replace(RANGE_ONLY.vehicle, max_speed=0.5),
    fish=MomentumRandomWalk(speed_sigma=0.01, turn_sigma=0.05, max_speed=0.2),
    start=replace(RANGE_ONLY.start, farthest=250.0),
    belief=replace(RANGE_ONLY.belief, motion=MomentumRandomWalk(speed_sigma=0.012, turn_sigma=0.06, max_speed=0.25)),
)

SCENARIOS = {
    "TagTrack/LeopardShark-v0": Scenario(),
    "TagTrack/LeopardSharkStandoff-v0": Scenario(speed_control=True, reward=Reward(standoff=1.0, perimeter=20.0)),
    "TagTrack/Glider-v0": GLIDER,
    "TagTrack/GliderPair-v0": GLIDER_PAIR,
    "TagTrack/TimeOfFlight-v0": TIME_OF_FLIGHT,
    "TagTrack/RangeOnly-v0": RANGE_ONLY,
    "TagTrack/RangeOnlyGlider-v0": RANGE_ONLY_GLIDER,
    "TagTrack/AreaOnly-v0": AREA_ONLY,
    "TagTrack/AreaOnlyUnknownRange-v0": replace(
        AREA_ONLY,
        episode_steps=360,  # three hours: later the mean error is that of the few episodes in which the animal is lost
        receiver=replace(AREA_RECEIVER, max_range=275.0, max_range_spread=125.0),
        belief=replace(AREA_ONLY.belief, receiver=replace(AREA_ASSUMED, max_range=275.0, max_range_spread=125.0)),
    ),
}


def find_scenario(env_id: str) -> Scenario:
    """The scenario of an id, with or without its namespace. Raises ValueError that lists the known ids."""
    for name in (env_id, f"TagTrack/{env_id}"):
        if name in SCENARIOS:
            return SCENARIOS[name]
    raise unknown("environment", env_id, SCENARIOS)
