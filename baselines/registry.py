"""Baselines by name, as command lines and tables write them: ``pursuit``, ``circle:40``, ``three_step:tau=10,perimeter=30``."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from tagtrack.baselines.circle import Circle, OracleCircle
from tagtrack.baselines.division import Assignment, Uncertain
from tagtrack.baselines.heuristic import Heuristic, InformedHeuristic
from tagtrack.baselines.information import Information
from tagtrack.baselines.rollout import Rollout
from tagtrack.baselines.simple import Pursuit, Random, Stationary
from tagtrack.baselines.three_step import ThreeStep
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sensors import PresenceReceiver, StereoHydrophone, TimeOfFlightReceiver
from tagtrack.envs.simulation import Simulation

BASELINES: Mapping[str, type[Heuristic]] = MappingProxyType(
    {
        "three_step": ThreeStep,
        "pursuit": Pursuit,
        "circle": Circle,
        "assignment": Assignment,
        "uncertain": Uncertain,
        "information": Information,
        "stationary": Stationary,
        "random": Random,
        "oracle_circle": OracleCircle,
        "rollout": Rollout,
    }
)

# What NAME:VALUE sets, without a key.
LEADING_PARAMETERS: Mapping[str, str] = MappingProxyType(
    {
        "three_step": "tau",
        "pursuit": "perimeter",
        "circle": "radius",
        "assignment": "radius",
        "uncertain": "radius",
        "information": "horizon",
        "random": "seed",
        "oracle_circle": "radius",
        "rollout": "radius",
    }
)


def usual_parameters(scenario: Scenario) -> dict[str, Any]:
    """What a baseline does in a task unless told otherwise, where its own defaults, those of the stereo hydrophone, do not suit.

    Bearing and range together: the tuned circle (5 to 14 m are as good). Ranging, and sensors
    of a user's own: a fifth of the task's length, which is the tuned circle of RangeOnly-v0 (40 m), and, because one range alone
    drives the vehicle away, the information of a whole turn. Presence: 0.8 of the working range (Masmitja et al.
    2020, Fig. 3C); ``pursuit``, ``three_step`` and ``stationary`` run, but stay where every ping is heard and nothing is learned.
    A search begins after three intervals of silence.
    """
    receiver, time_step = scenario.belief.receiver, scenario.time_step
    if isinstance(receiver, StereoHydrophone):
        return {}
    if isinstance(receiver, TimeOfFlightReceiver):
        return {"radius": 10.0}
    usual = {"patience": max(30.0, 3.0 * max(scenario.tag.longest_interval, time_step)), "hold": max(10.0, time_step)}
    if isinstance(receiver, PresenceReceiver):
        return {**usual, "radius": 0.8 * receiver.working_range, "horizon": 6}
    slowest_turn = scenario.vehicle.max_speed / scenario.vehicle.max_turn_rate
    return {**usual, "radius": max(0.2 * scenario.scale.length, slowest_turn), "horizon": 24}


def baseline_parameters(name: str) -> dict[str, dataclasses.Field[Any]]:
    """The parameters that a specification may set."""
    kind = _find_baseline(name)
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}
    return {key: field for key, field in fields.items() if key not in ("scenario", "simulation")}


def make_baseline(specification: str, simulation: Simulation) -> Heuristic:
    """The policy that a specification names, for the vehicles of a simulation.

    Args:
        specification: ``NAME``, ``NAME:VALUE`` or ``NAME:KEY=VALUE,KEY=VALUE``, in metres, seconds and, for the tau of
            ``three_step``, degrees. A perimeter that is not given is the scenario's where the speed can be chosen, else none;
            the others that are not given are those of ``usual_parameters``.
        simulation: what the policy will steer; only those that know more than the observation keep it.
    Raises:
        ValueError: for an unknown name or parameter, listing what exists, or a bad value, naming it.
    """
    name, colon, text = specification.partition(":")
    known = baseline_parameters(name)
    values = _read_values(name, text, known, specification) if colon else {}
    if "perimeter" in known and simulation.scenario.speed_control:
        values.setdefault("perimeter", simulation.scenario.reward.perimeter)
    values = {key: value for key, value in usual_parameters(simulation.scenario).items() if key in known} | values
    kind = BASELINES[name]
    given = {"simulation": simulation} if issubclass(kind, InformedHeuristic) else {"scenario": simulation.scenario}
    try:
        return kind(**given, **values)
    except ValueError as error:
        raise ValueError(f"{specification}: {error}") from None


def _find_baseline(name: str) -> type[Heuristic]:
    if name not in BASELINES:
        raise ValueError(f"unknown baseline {name!r}; known: {', '.join(BASELINES)}")
    return BASELINES[name]


def _read_values(name: str, text: str, known: Mapping[str, dataclasses.Field[Any]], specification: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for part in text.split(","):
        key, equals, value = part.rpartition("=")
        key = key.strip() if equals else LEADING_PARAMETERS.get(name, "")
        if key not in known:
            listed = f"it has {', '.join(known)}" if known else "it has none"
            raise ValueError(f"{specification}: {name} has no parameter {key or part!r}; {listed}")
        if key in values:
            raise ValueError(f"{specification}: {key} is given twice")
        values[key] = _read_number(known[key], value, specification)
    return values


def _read_number(field: dataclasses.Field[Any], text: str, specification: str) -> Any:
    whole = field.type == "int"
    try:
        number = int(text) if whole else float(text)
    except ValueError:
        kind = "a whole number" if whole else "a number"
        raise ValueError(f"{specification}: {field.name} must be {kind}, got {text!r}") from None
    return field.metadata.get("from_text", lambda value: value)(number)
