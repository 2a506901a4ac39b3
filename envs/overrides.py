"""Single values of a scenario by their dotted names: ``gym.make(id, overrides={"water.noisy_share": 0.3})`` and ``--set`` on the
command lines reach every one of them. And the way back: a scenario as plain values.
"""

from __future__ import annotations

import dataclasses
import enum
import json
from collections.abc import Mapping
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
