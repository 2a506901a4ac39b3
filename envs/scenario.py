"""A scenario: every parameter of a task, truth and belief apart. Small frozen dataclasses, SI units, a paper's defaults.

``SCENARIOS`` holds one for each environment id; ``with_overrides`` changes single values by their dotted names, which is how
``gym.make(id, overrides={"water.noisy_share": 0.3})`` and ``--set water.noisy_share=0.3`` reach every one of them.
"""

from __future__ import annotations

import dataclasses
import enum
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tagtrack.envs.belief.filter import FILTERS, Belief
from tagtrack.envs.sim.acoustics import StereoHydrophone, Tag, Water
from tagtrack.envs.sim.motion import MOTIONS, MomentumRandomWalk, Motion, Replay
from tagtrack.envs.sim.validation import require, settle_numbers
from tagtrack.envs.sim.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where the fish is when an episode begins; the vehicle lies at the origin."""

    nearest: float = 20.0  # [m], as in the trials of section 5.1
    farthest: float = 60.0  # [m]: near enough that the first pings are heard; with 100 (L) an episode may begin unheard

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.nearest >= 0, self, "nearest", "at least 0")
        require(self.farthest >= self.nearest, self, "farthest", f"at least nearest ({self.nearest} m)")


@dataclass(frozen=True, kw_only=True)
class Reward:
    """Named terms of the reward, each with its weight; their sum is the reward of a step."""

    localization: float = 1.0  # weight of minus the localization error, as a share of error_cap
    error_cap: float = 100.0  # errors beyond count as this one, lest lost episodes drown the rest [m]
    standoff: float = 0.0  # weight of minus the share of the perimeter that the vehicle has intruded
    perimeter: float = 0.0  # distance that the vehicle should keep from the fish [m]; 0: none

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.error_cap > 0, self, "error_cap", "positive")
        for name in ("localization", "standoff", "perimeter"):
            require(getattr(self, name) >= 0, self, name, "at least 0")


REWARD_TERMS = ("localization", "standoff")


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
    shared_belief: bool = True  # one belief for all vehicles, or one each
    speed_control: bool = False  # whether the action sets the speed, too
    vehicle: Vehicle = field(default_factory=Vehicle)
    fish: Motion | Replay = field(
        default_factory=lambda: MomentumRandomWalk(speed_sigma=0.05, turn_sigma=0.15, max_speed=0.5)
    )
    start: Start = field(default_factory=Start)
    tag: Tag = field(default_factory=Tag)
    water: Water = field(default_factory=Water)
    receiver: StereoHydrophone = field(default_factory=StereoHydrophone)
    # Table I's diffusion (FILTERS["standard"]) spreads particles far faster than this fish swims; section 7 finds that tuning it
    # helps, so the task assumes a fish somewhat faster and more restless than the true one.
    belief: Belief = field(
        default_factory=lambda: Belief(motion=MomentumRandomWalk(speed_sigma=0.06, turn_sigma=0.2, max_speed=0.6))
    )
    reward: Reward = field(default_factory=Reward)

    def __post_init__(self) -> None:
        settle_numbers(self)
        require(self.time_step > 0, self, "time_step", "positive")
        require(self.time_step <= self.tag.period, self, "time_step", f"at most the tag's period ({self.tag.period} s)")
        for name in ("episode_steps", "vehicles", "targets"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ValueError(f"Scenario.{name} must be a whole number of at least 1, got {value!r}")
        if isinstance(self.belief.motion, Replay):
            raise ValueError("Scenario.belief.motion cannot replay a track: particles need a random motion")

    @property
    def owners(self) -> int:
        """Number of beliefs: one, or one for each vehicle."""
        return 1 if self.shared_belief else self.vehicles


SCENARIOS = {
    "TagTrack/LeopardShark-v0": Scenario(),
    "TagTrack/LeopardSharkStandoff-v0": Scenario(speed_control=True, reward=Reward(standoff=1.0, perimeter=20.0)),
}


def find_scenario(env_id: str) -> Scenario:
    """The scenario of an id, with or without its namespace. Raises ValueError that lists the known ids."""
    for name in (env_id, f"TagTrack/{env_id}"):
        if name in SCENARIOS:
            return SCENARIOS[name]
    raise ValueError(f"unknown environment {env_id!r}; known: {', '.join(SCENARIOS)}")


def parameter_names(parameters: Any, prefix: str = "") -> list[str]:
    """Dotted names of all values of a scenario, in their order."""
    names = []
    for item in dataclasses.fields(parameters):
        value = getattr(parameters, item.name)
        name = prefix + item.name
        names += parameter_names(value, name + ".") if dataclasses.is_dataclass(value) else [name]
    return names


def with_overrides(scenario: Scenario, overrides: Mapping[str, Any]) -> Scenario:
    """A scenario with some values changed.

    Args:
        overrides: dotted name -> value, for instance ``{"vehicle.max_speed": 1.5, "belief.motion": "levy"}``. A motion may be
            given by its name (``MOTIONS``), a belief by its filter's (``FILTERS``), an enumeration by its member's.
    Raises:
        ValueError: for an unknown name or a value out of range, naming both.
    """
    # Whole parts first, so that {"belief": "brownian", "belief.particles": 500} does what it says in either order;
    # changes to one part are made at once, because rules may bind two values together.
    for name in sorted(overrides, key=lambda key: key.count(".")):
        scenario = _override(scenario, name.split("."), overrides[name], name, scenario)
    return scenario


def _override(parameters: Any, path: list[str], value: Any, name: str, scenario: Scenario) -> Any:
    head, rest = path[0], path[1:]
    if not dataclasses.is_dataclass(parameters) or head not in {f.name for f in dataclasses.fields(parameters)}:
        raise ValueError(f"unknown parameter {name!r}; known: {', '.join(parameter_names(scenario))}")
    old = getattr(parameters, head)
    new = _override(old, rest, value, name, scenario) if rest else _interpret(old, head, value, name)
    changed: Any = dataclasses.replace(parameters, **{head: new})  # type: ignore[type-var]  # an instance, not a class
    return changed


def _interpret(old: Any, field_name: str, value: Any, name: str) -> Any:
    """The value as the field's own kind: texts come from command lines, names stand for whole parts."""
    if dataclasses.is_dataclass(old):
        if isinstance(value, type(old)) or (dataclasses.is_dataclass(value) and not isinstance(value, type)):
            return value
        known: Mapping[str, Any] = {}
        if field_name == "belief":
            known = FILTERS
        elif field_name in ("fish", "motion"):
            known = {key: motion() for key, motion in MOTIONS.items()}
        if value in known:
            return known[value]
        choice = f"one of {', '.join(known)}" if known else f"given part by part ({', '.join(parameter_names(old))})"
        raise ValueError(f"{name} must be {choice}, got {value!r}")
    if isinstance(old, enum.IntEnum):
        kind = type(old)
        if isinstance(value, str) and value.upper() in kind.__members__:
            return kind[value.upper()]
        if isinstance(value, int) and not isinstance(value, bool) and value in list(kind):
            return kind(value)
        raise ValueError(f"{name} must be one of {', '.join(kind.__members__).lower()}, got {value!r}")
    if isinstance(value, str):
        try:
            value = json.loads(value.lower())
        except ValueError:
            raise ValueError(f"{name} must be {_kind_name(old)}, got {value!r}") from None
    if isinstance(old, bool) != isinstance(value, bool):
        raise ValueError(f"{name} must be {_kind_name(old)}, got {value!r}")
    if isinstance(old, int) and isinstance(value, float) and value.is_integer():
        value = int(value)
    return value


def _kind_name(value: Any) -> str:
    return "true or false" if isinstance(value, bool) else "a whole number" if isinstance(value, int) else "a number"


def describe_scenario(scenario: Any) -> dict[str, Any]:
    """Nested plain values for JSON: parts by name, with the class of a motion as ``kind``."""
    plain: dict[str, Any] = {}
    for item in dataclasses.fields(scenario):
        value = getattr(scenario, item.name)
        if dataclasses.is_dataclass(value):
            plain[item.name] = describe_scenario(value)
        elif isinstance(value, enum.IntEnum):
            plain[item.name] = value.name.lower()
        else:
            plain[item.name] = value
    if type(scenario) in {*MOTIONS.values(), Replay}:
        plain["kind"] = type(scenario).__name__
    return plain
