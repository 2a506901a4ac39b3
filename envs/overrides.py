"""Single values of a scenario by their dotted names: ``gym.make(id, overrides={"water.noisy_share": 0.3})`` and ``--set`` on the
command lines reach every one of them. And the way back: a scenario as plain values.
"""

from __future__ import annotations

import dataclasses
import enum
import json
from collections.abc import Mapping, Sequence
from typing import Any

from tagtrack.envs.belief.filter import BELIEFS
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sim.legs import StraightLegs
from tagtrack.envs.sim.motion import MOTIONS, Replay
from tagtrack.envs.sim.receivers import RECEIVERS


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
            given by its name (``MOTIONS``), a receiver by its own (``RECEIVERS``), a belief by its filter's (``BELIEFS``), an
            enumeration by its member's.
    Raises:
        ValueError: for an unknown name or a value out of range, naming both.

    >>> from tagtrack.envs.scenario import find_scenario
    >>> changed = with_overrides(find_scenario("LeopardShark-v0"), {"vehicle.max_speed": 1.5, "belief.motion": "levy"})
    >>> changed.vehicle.max_speed, type(changed.belief.motion).__name__
    (1.5, 'LevyFlight')
    """
    return _override(scenario, [(name, name.split("."), value) for name, value in overrides.items()], scenario)


Change = tuple[str, list[str], Any]  # the whole name, the path to go from here, the value


def _override(parameters: Any, changes: Sequence[Change], scenario: Scenario) -> Any:
    """All changes of one part at once, because its rules may bind two values together: the order says nothing.

    Whole parts go first, so that {"belief.particles": 500, "belief": "brownian"} does what it says.
    """
    known = {item.name for item in dataclasses.fields(parameters)} if dataclasses.is_dataclass(parameters) else set()
    by_field: dict[str, list[Change]] = {}
    for name, (head, *rest), value in changes:
        if head not in known:
            raise ValueError(f"unknown parameter {name!r}; known: {', '.join(parameter_names(scenario))}")
        by_field.setdefault(head, []).append((name, rest, value))
    parts = {}
    for head, own in by_field.items():
        part = getattr(parameters, head)
        for name, _, value in (change for change in own if not change[1]):
            part = _interpret(part, head, value, name)
        within = [change for change in own if change[1]]
        parts[head] = _override(part, within, scenario) if within else part
    return dataclasses.replace(parameters, **parts)


def _interpret(old: Any, field_name: str, value: Any, name: str) -> Any:
    """The value as the field's own kind: texts come from command lines, names stand for whole parts."""
    if dataclasses.is_dataclass(old):
        if isinstance(value, type(old)) or (dataclasses.is_dataclass(value) and not isinstance(value, type)):
            return value
        known: Mapping[str, Any] = {}
        if field_name == "belief":
            known = BELIEFS
        elif field_name in ("fish", "motion"):
            known = {key: motion() for key, motion in MOTIONS.items()}
        elif field_name == "receiver":
            known = {key: receiver() for key, receiver in RECEIVERS.items()}
        if isinstance(value, str) and value in known:
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
    return tuple(value) if isinstance(value, list) else value


def _kind_name(value: Any) -> str:
    return "true or false" if isinstance(value, bool) else "a whole number" if isinstance(value, int) else "a number"


def describe_scenario(scenario: Any) -> dict[str, Any]:
    """Nested plain values for JSON: parts by name, with the class of a motion or a receiver as ``kind``."""
    plain: dict[str, Any] = {}
    for item in dataclasses.fields(scenario):
        value = getattr(scenario, item.name)
        if dataclasses.is_dataclass(value):
            plain[item.name] = describe_scenario(value)
        elif isinstance(value, enum.IntEnum):
            plain[item.name] = value.name.lower()
        else:
            plain[item.name] = value
    if type(scenario) in {*MOTIONS.values(), *RECEIVERS.values(), Replay, StraightLegs}:
        plain["kind"] = type(scenario).__name__
    return plain
