"""Who takes part: a contestant named on a command line is a baseline (``circle:40``), the folder of a saved policy, or
moored receivers (``static_array:200``), or something of a user's own file (``my_module:MyController``).

All of them are made once, and thereby checked, before anything runs.
"""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Hashable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from tagtrack.baselines.heuristic import Heuristic, InformedHeuristic
from tagtrack.baselines.registry import BASELINES, make_baseline
from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.model import import_object
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.envs.validation import guess
from tagtrack.eval.rollout import Contestant, Localizer, PolicyMaker
from tagtrack.eval.sb3_zip import is_zip, load_zip
from tagtrack.eval.static_array import NAME, is_static_array, read_static_array
from tagtrack.policies.box import LEARNED, boxed_policy, trained_by
from tagtrack.policies.entities import EntityPolicy
from tagtrack.policies.files import load_policy
from tagtrack.policies.protocol import Policy

Name = TypeVar("Name", bound=Hashable)
PolicySpec = str | os.PathLike[str] | Policy | PolicyMaker | Localizer
GROUP = re.compile(r"([^:=,/\\]+)=(.*)")  # learned=RUN,RUN


def name_contestants(specs: Sequence[str]) -> dict[str, str]:
    """The specs by the names they go by in tables: a baseline or an array by its spec, a saved policy by its folder's name.

    Raises:
        ValueError: if there is none, or two go by the same name.
    """
    if not specs:
        raise ValueError(f"name at least one policy: {_choices()}")
    named: dict[str, str] = {}
    for spec in specs:
        name = spec.rpartition(":")[2] if _is_object(spec) else spec
        if is_run(spec) or is_zip(spec):
            name = Path(spec).resolve().name
        _name(named, name, spec)
    return named


def name_groups(specs: Sequence[str]) -> dict[str, str | dict[str, str]]:
    """As ``name_contestants``, where NAME=RUN,RUN,... names training runs that count as one policy: its runs by their names.

    Raises:
        ValueError: also for a group without a run.
    """
    named: dict[str, str | dict[str, str]] = {}
    for spec in specs:
        group = None if Path(spec).exists() else GROUP.fullmatch(spec)
        if group is None:
            for name, alone in name_contestants([spec]).items():
                _name(named, name, alone)
            continue
        name, runs = group[1], [run for run in group[2].split(",") if run]
        if not runs:
            raise ValueError(f"the group {spec!r} has no run; name its folders: {name}=runs/seed0,runs/seed1")
        _name(named, name, name_contestants(runs))
    return named or {**name_contestants(specs)}


def _name(named: dict[str, Any], name: str, spec: Any) -> None:
    if name in named:
        raise ValueError(f"two policies go by the name {name!r}: {named[name]} and {spec}; leave one out or rename its folder")
    named[name] = spec


def find_makers(specs: Mapping[Name, PolicySpec], task: Task, env_id: str, *, trust: bool = False) -> dict[Name, Contestant]:
    """A maker for each policy, which has made it once for this task; a ``Localizer`` stands for itself.

    Args:
        specs: by name, a baseline's or an array's spec, a folder with a saved policy, a policy, a function that makes one for a
            ``Simulation``, or a ``Localizer``.
        env_id: for error messages. trust: load models of Stable-Baselines3 (``model.zip``), which runs the code in them.
    Raises:
        ValueError: for an unknown baseline, a wrong number behind its colon, a policy of another layout or a damaged file.
        FileNotFoundError: for a folder without a policy.
    """
    # Folders and unknown names first: a simulation may have to be compiled.
    makers = {name: _find_maker(spec, task, env_id, trust=trust) for name, spec in specs.items()}
    fleet = task.scenario.vehicles > 1 or task.scenario.targets > 1
    if fleet and (arrays := [specs[name] for name, maker in makers.items() if isinstance(maker, Localizer)]):
        raise ValueError(
            f"{arrays[0]} stands for one vehicle and one tag, got vehicles={task.scenario.vehicles}, "
            f"tags={task.scenario.targets}; leave it out"
        )
    simulation = Simulation(task.scenario, tracks=task.tracks)
    for maker in makers.values():
        if not isinstance(maker, Localizer):
            maker(simulation)
    return makers


def make_groups(
    specs: Mapping[str, str | dict[str, str]], task: Task, env_id: str, *, trust: bool = False
) -> dict[str, Contestant | dict[str, Contestant]]:
    """As ``find_makers``, of what ``name_groups`` gives: a group is a mapping of its runs."""
    flat = {(name, run): spec for name, each in specs.items() for run, spec in _as_group(each).items()}
    found = find_makers(flat, task, env_id, trust=trust)
    groups: dict[str, Contestant | dict[str, Contestant]] = {}
    for name, each in specs.items():
        groups[name] = {run: found[name, run] for run in each} if isinstance(each, dict) else found[name, ""]
    return groups


def each_run(makers: Mapping[str, Contestant | dict[str, Contestant]], *, all_runs: bool = True) -> dict[str, Contestant]:
    """All contestants by name, a training's runs as NAME/RUN, or its first one alone."""
    found: dict[str, Contestant] = {}
    for name, maker in makers.items():
        runs = list(maker.items()) if isinstance(maker, dict) else [("", maker)]
        for run, one in runs if all_runs else runs[:1]:
            found[f"{name}/{run}" if run else name] = one
    return found


def _as_group(spec: str | dict[str, str]) -> dict[str, str]:
    return spec if isinstance(spec, dict) else {"": spec}


def _find_maker(spec: PolicySpec, task: Task, env_id: str, *, trust: bool) -> Contestant:
    if isinstance(spec, (str, os.PathLike)):
        if spec == LEARNED:
            scenario = task.scenario
            spec = boxed_policy(task.env_id, vehicles=scenario.vehicles, tags=scenario.targets)
            print(f"note: {LEARNED} was trained by {trained_by(spec)}")
        if is_zip(str(spec)):
            if not trust:
                way = "benchmark takes it with --trust, if it is yours"
                raise ValueError(f"loading {spec}, of Stable-Baselines3, runs the code that is in it; {way}")
            return _always(load_zip(Path(spec), task.scenario))
        if isinstance(spec, str) and is_baseline(spec):
            return partial(make_baseline, spec)
        if isinstance(spec, str) and is_static_array(spec):
            return read_static_array(spec)
        if isinstance(spec, str) and _is_object(spec):
            return _maker_of(import_object(spec), spec)
        return _always(_load(Path(spec), task.scenario, env_id))
    if isinstance(spec, Localizer):
        return spec
    if hasattr(spec, "predict"):
        return _always(spec)
    if callable(spec):
        return spec
    raise ValueError(f"a policy is a baseline, a folder, or something with a predict method, got {spec!r}")


def _always(policy: Policy) -> PolicyMaker:
    return partial(_given, policy)  # makers travel to other processes, where functions within functions cannot go


def _given(policy: Policy, simulation: Simulation) -> Policy:
    return policy


def _load(folder: Path, scenario: Scenario, env_id: str) -> Policy:
    if not folder.exists():
        near = guess(folder, [*BASELINES, LEARNED, NAME])
        raise ValueError(f"unknown policy {str(folder)!r}: {near}there is no such folder, and {_choices()}")
    policy = load_policy(
        folder,
        feature_names(scenario),
        action_names=action_names(scenario),
        env_id=env_id,
    )
    if not isinstance(policy, EntityPolicy):
        return policy
    try:
        return dataclasses.replace(policy, courses=scenario.frame.name.lower())
    except ValueError as error:
        raise ValueError(f"the policy in {folder} cannot steer this fleet: {error}") from None


def is_run(spec: str) -> bool:
    """Whether a spec names the folder of a saved policy: it is nothing else."""
    return not (is_baseline(spec) or is_static_array(spec) or spec == LEARNED or is_zip(spec) or _is_object(spec))


def _is_object(spec: str) -> bool:
    """Whether a spec is ``MODULE:OBJECT``, of a user's own file: dotted names, and no folder of that name."""
    module, colon, name = spec.partition(":")
    dotted = bool(colon) and all(part.isidentifier() for part in (*module.split("."), name))
    return dotted and not (is_baseline(spec) or is_static_array(spec) or Path(spec).exists())


def _maker_of(found: Any, spec: str) -> Contestant:
    """A maker of a policy of a user's own: a class of heuristics, what makes a policy for a simulation, or a policy."""
    is_class = isinstance(found, type)
    if not is_class and isinstance(found, Localizer):
        return found
    if not is_class and hasattr(found, "predict"):
        return _always(found)
    if not callable(found):
        raise ValueError(f"{spec} is no policy: it must be a class of heuristics, a function of a Simulation, or have predict")

    return partial(_make_own, found, spec)


def _make_own(found: Any, spec: str, simulation: Simulation) -> Policy:
    policy: Policy
    try:
        if isinstance(found, type) and issubclass(found, InformedHeuristic):
            policy = found(simulation=simulation)
        elif isinstance(found, type) and issubclass(found, Heuristic):
            policy = found(scenario=simulation.scenario)
        else:
            policy = found(simulation)
    except TypeError as error:
        raise ValueError(f"{spec} cannot be made for a simulation: {error}") from error
    if not hasattr(policy, "predict"):
        raise ValueError(f"{spec} makes a {type(policy).__name__}, which has no predict")
    return policy


def is_baseline(spec: str) -> bool:
    return spec.partition(":")[0] in BASELINES


def _choices() -> str:
    return (
        f"the baselines are {', '.join(BASELINES)}; {LEARNED} is the policy that comes with the package, {NAME} stands for "
        "moored receivers, MODULE:CLASS for one of your own"
    )
