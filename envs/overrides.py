"""Single values of a scenario by their dotted names: ``gym.make(id, overrides={"water.noisy_share": 0.3})`` and ``--set`` on the
command lines reach every one of them. And the way back: a scenario as plain values.
"""

from __future__ import annotations

import dataclasses
import enum
import json
from collections.abc import Mapping, Sequence
from typing import Any

from tagtrack.envs.belief.assumptions import BELIEFS
from tagtrack.envs.model import BELIEF, TRUTH, Model, find_model, import_object
from tagtrack.envs.motions import PATHS, WALKS, Motion, Path, Replay
from tagtrack.envs.rewards import Term
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sensors import SENSORS, Sensor
from tagtrack.envs.sim.modem import MODEMS, Modem
from tagtrack.envs.validation import unknown


def parameter_names(parameters: Any, prefix: str = "") -> list[str]:
    """Dotted names of all values of a scenario, in their order."""
    names = []
    for item in dataclasses.fields(parameters):
        value = getattr(parameters, item.name)
        name = prefix + item.name
        parts = _named_terms(value)
        if dataclasses.is_dataclass(value):
            names += parameter_names(value, name + ".")
        elif parts:
            names += [each for key, term in parts.items() for each in parameter_names(term, f"{name}.{key}.")]
        else:
            names.append(name)
    return names


def _named_terms(value: Any) -> dict[str, Term]:
    """Further terms of a reward by their names; empty for anything else."""
    if not isinstance(value, tuple):
        return {}
    return {term.name or type(term).__name__: term for term in value if isinstance(term, Term)}


def with_overrides(scenario: Scenario, overrides: Mapping[str, Any]) -> Scenario:
    """A scenario with some values changed.

    Args:
        overrides: dotted name -> value, for instance ``{"vehicle.max_speed": 1.5, "belief.motion": "levy"}``. A motion may be
            given by its name (``motions.WALKS``, ``PATHS``), a receiver by its own (``sensors.SENSORS``), a belief by its
            filter's (``BELIEFS``), an enumeration by its member's; any model, a term for ``reward.own`` too, by MODULE:CLASS.
    Raises:
        ValueError: for an unknown name, a value out of range, or a parameter that nobody reads, naming it.

    >>> from tagtrack.envs.scenario import find_scenario
    >>> changed = with_overrides(find_scenario("LeopardShark-v0"), {"vehicle.max_speed": 1.5, "belief.motion": "levy"})
    >>> changed.vehicle.max_speed, type(changed.belief.motion).__name__
    (1.5, 'LevyFlight')
    """
    changed = _override(scenario, [(name, name.split("."), value) for name, value in overrides.items()], scenario)
    for name in overrides:
        _require_read(changed, name)
    return changed


def _require_read(scenario: Scenario, name: str) -> None:
    """Refuse a parameter that the chosen model does not read: it would be ignored."""
    part: Any = scenario
    *path, last = name.split(".")
    for head in path:
        part = part[head] if isinstance(part, dict) else getattr(part, head)
        part = _named_terms(part) or part
    if isinstance(part, Model):
        reason = part.unread(BELIEF if path[0] == "belief" else TRUTH).get(last)
        if reason is not None:
            raise ValueError(f"{name} would change nothing in a {type(part).__name__}: {reason}")


Change = tuple[str, list[str], Any]  # the whole name, the path to go from here, the value


def _override(parameters: Any, changes: Sequence[Change], scenario: Scenario) -> Any:
    """All changes of one part at once, because its rules may bind two values together: the order says nothing.

    Whole parts go first, so that {"belief.particles": 500, "belief": "brownian"} does what it says.
    """
    known = {item.name for item in dataclasses.fields(parameters)} if dataclasses.is_dataclass(parameters) else set()
    by_field: dict[str, list[Change]] = {}
    for name, (head, *rest), value in changes:
        if head not in known:
            raise unknown("parameter", name, parameter_names(scenario))
        by_field.setdefault(head, []).append((name, rest, value))
    parts = {}
    for head, own in by_field.items():
        part = getattr(parameters, head)
        for name, _, value in (change for change in own if not change[1]):
            part = _interpret(part, head, value, name)
        within = [change for change in own if change[1]]
        if within and isinstance(part, tuple):
            part = _override_terms(part, within, scenario)
        elif within:
            part = _override(part, within, scenario)
        parts[head] = part
    return dataclasses.replace(parameters, **parts)


def _override_terms(terms: tuple[Any, ...], changes: Sequence[Change], scenario: Scenario) -> tuple[Any, ...]:
    """Changes of further terms of a reward, ``reward.own.NAME.PARAMETER``."""
    named = _named_terms(terms)
    for name, (head, *rest), _ in changes:
        if head not in named or not rest:
            raise unknown("parameter", name, parameter_names(scenario))
    return tuple(
        _override(term, [(name, rest, value) for name, (head, *rest), value in changes if head == key], scenario)
        for key, term in named.items()
    )


FOUND_BY_NAME: Mapping[str, tuple[Mapping[str, Any], tuple[type, ...]]] = {
    "fish": ({**WALKS, **PATHS}, (Motion, Path)),
    "motion": (WALKS, (Motion,)),
    "receiver": (SENSORS, (Sensor,)),
    "modem": (MODEMS, (Modem,)),
}


def _interpret(old: Any, field_name: str, value: Any, name: str) -> Any:
    """The value as the field's own kind: texts come from command lines, names stand for whole parts."""
    if dataclasses.is_dataclass(old):
        return _interpret_part(old, field_name, value, name)
    if field_name == "own":
        return _interpret_terms(value, name)
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


def _interpret_part(old: Any, field_name: str, value: Any, name: str) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return value
    if isinstance(value, Mapping):
        return _read_part(value, type(old), name)
    if field_name == "belief":
        if isinstance(value, str) and value in BELIEFS:
            return BELIEFS[value]
        raise ValueError(f"{name} must be one of {', '.join(BELIEFS)}, got {value!r}")
    if field_name not in FOUND_BY_NAME:
        raise ValueError(f"{name} must be given part by part ({', '.join(parameter_names(old))}), got {value!r}")
    known, kinds = FOUND_BY_NAME[field_name]
    if not isinstance(value, str):
        raise ValueError(f"{name} must be one of {', '.join(known)}, or MODULE:CLASS of your own, got {value!r}")
    return find_model(value, known, kinds, name)


def _interpret_terms(value: Any, name: str) -> tuple[Any, ...]:
    """Further terms of a reward: objects, or ``MODULE:CLASS,MODULE:CLASS``."""
    if isinstance(value, str):
        value = [find_model(each.strip(), {}, (Term,), name) for each in value.split(",")]
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"{name} must be MODULE:CLASS of a term of your own, or several with commas, got {value!r}")
    return tuple(read_model(each, name) if isinstance(each, Mapping) else each for each in value)


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
        elif _named_terms(value):
            plain[item.name] = {name: describe_scenario(term) for name, term in _named_terms(value).items()}
        else:
            plain[item.name] = value
    if isinstance(scenario, Model):
        plain["kind"] = type(scenario).__name__
        if not type(scenario).__module__.startswith("tagtrack."):
            plain["module"] = type(scenario).__module__
    return plain


def read_scenario(plain: Mapping[str, Any]) -> Scenario:
    """The scenario that ``describe_scenario`` described, also after JSON.

    Raises:
        ValueError: for a parameter or a kind that is not known, or a value out of range.

    >>> read_scenario(describe_scenario(Scenario(episode_steps=600))) == Scenario(episode_steps=600)
    True
    """
    return _read_part(plain, Scenario, "scenario")


def read_model(plain: Mapping[str, Any], name: str) -> Any:
    """The model that ``describe_scenario`` described; ``name`` is for errors."""
    return _read_part(plain, Model, name)


_KINDS = {kind.__name__: kind for kind in (*WALKS.values(), *PATHS.values(), Replay, *SENSORS.values(), *MODEMS.values())}


def _read_part(plain: Mapping[str, Any], kind: type[Any], name: str) -> Any:
    """One dataclass of plain values; ``kind`` is its class unless the values name their own."""
    values = dict(plain)
    own, module = values.pop("kind", None), values.pop("module", None)
    if module is not None:
        kind = import_object(f"{module}:{own}")
    elif own is not None:
        if own not in _KINDS:
            raise ValueError(f"{name}.kind must be one of {', '.join(_KINDS)}, got {own!r}")
        kind = _KINDS[own]
    known = {item.name: item for item in dataclasses.fields(kind)}
    if strange := sorted(set(values) - set(known)):
        raise unknown("parameter", f"{name}.{strange[0]}", known)
    return kind(**{key: _read_value(value, known[key], f"{name}.{key}") for key, value in values.items()})


def _read_value(value: Any, item: dataclasses.Field[Any], name: str) -> Any:
    """A field's value in its own kind, which its default shows."""
    default = item.default_factory() if item.default_factory is not dataclasses.MISSING else item.default
    if item.name == "own":
        return tuple(read_model(term, f"{name}.{key}") for key, term in dict(value).items())
    if isinstance(value, Mapping):
        return _read_part(value, type(default), name)
    if isinstance(default, enum.IntEnum) and isinstance(value, str):
        return _interpret(default, item.name, value, name)
    return tuple(value) if isinstance(value, list) else value
