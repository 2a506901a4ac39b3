"""What a shell is asked to run: one ``Task``, made of an id and options that all shells share.

Ids are resolved here and nowhere else: ours, and those that other people registered with Gymnasium for our environments.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np

import tagtrack
from tagtrack.envs.model import import_own
from tagtrack.envs.motions import Replay
from tagtrack.envs.motions.replay import find_stretches
from tagtrack.envs.motions.tracks import Track, read_tracks
from tagtrack.envs.overrides import read_scenario, with_overrides
from tagtrack.envs.presets import find_preset
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sim.modem import Modem
from tagtrack.envs.validation import unknown

if TYPE_CHECKING:
    from typing_extensions import Unpack

MOST_AGENTS = 20  # vehicles, or tags, of a task


class TaskOptions(TypedDict, total=False):
    """What may be asked of a task beside its id: the keyword arguments that all shells share."""

    preset: str | None
    """Other people's settings of the task (``presets.PRESETS``), instead of the id's own."""
    particles: int | None
    """Particles of each belief (``belief.particles``)."""
    tracks: str | Path | None
    """csv file of recorded tracks (``read_tracks``), one of which the fish then swims instead of its random walk."""
    time_scale: float | None
    """How fast it swims its track: 0.5 is half the recorded speed (``fish.time_scale``)."""
    overrides: Mapping[str, Any] | None
    """Dotted name -> value, for instance ``{"water.noisy_share": 0.3}`` (see ``with_overrides``)."""
    scenario: Scenario | Mapping[str, Any] | None
    """A whole scenario of one's own, which the other options then change; also as ``describe_scenario`` tells of it."""
    vehicles: int | None
    """How many vehicles, 1 to 20."""
    tags: int | None
    """How many tagged fish, 1 to 20."""
    modem: str | Modem | None
    """What the vehicles may tell one another: ``"perfect"``, ``"none"``, ``"instant"`` or ``"tdma"`` (``sim.modem``)."""


class Task(NamedTuple):
    """A scenario and, where its fish replays them, recorded tracks: what ``Simulation`` is made of."""

    scenario: Scenario
    tracks: tuple[Track, ...] | None = None  # one for each animal
    tracks_file: str | None = None  # where they were read
    env_id: str = "a scenario of one's own"  # with its namespace

    def describe_tracks(self) -> dict[str, Any] | None:
        """Which recorded animals the fish is, as plain values for JSON; None where it is none.

        ``animals`` and unbroken ``stretches`` count those long enough for an episode; ``hours`` is what these last as recorded.
        """
        scenario = self.scenario
        if self.tracks is None or not isinstance(scenario.fish, Replay):
            return None
        stretches = find_stretches(self.tracks, scenario.fish, scenario.time_step, scenario.episode_steps)
        return {
            "file": self.tracks_file,
            "animals": len({stretch.tag for stretch in stretches}),
            "stretches": len(stretches),
            "hours": round(sum(float(stretch.time[-1] - stretch.time[0]) for stretch in stretches) / 3600.0, 3),
            "time_scale": scenario.fish.time_scale,
            "longest_gap": scenario.fish.longest_gap,
        }


def build_task(env_id: str | Task, **options: Unpack[TaskOptions]) -> Task:
    """The task of an id, changed as asked; a ``Task`` stays what it is.

    Args:
        env_id: of ours, with or without ``TagTrack/``, or one that somebody registered for our environments; ``MODULE:ID``
            imports a module first, as ``gymnasium.make`` does.
        options: as ``TaskOptions`` lists them.
    Raises:
        TypeError: for an option that is none of these.
        ValueError: for an unknown id, preset or name, a value out of range, a time_scale without a track, a motion
            beside a track, a broken track file or one without a stretch as long as an episode; for options beside a Task.
        FileNotFoundError: where there is no such file.
    """
    unknown = sorted(set(options) - set(TaskOptions.__annotations__))
    if unknown:
        # In Python's own words: TorchRL tries options of other environments, and drops those that are refused so.
        known = ", ".join(TaskOptions.__annotations__)
        raise TypeError(f"got an unexpected keyword argument {unknown[0]!r}; options of a task: {known}")
    if isinstance(env_id, Task):
        given = [name for name, value in options.items() if value is not None]
        if given:
            raise ValueError(f"{given[0]} cannot be changed in a task that is made; build it with it")
        return env_id
    scenario, preset, tracks = options.get("scenario"), options.get("preset"), options.get("tracks")
    if isinstance(scenario, Mapping):
        scenario = read_scenario(scenario)
    if scenario is not None and preset is not None:
        raise ValueError(f"preset={preset!r} and a scenario are two scenarios; give one of them")
    name = env_id if scenario is not None and env_id in SCENARIOS else full_id(env_id)
    base = _registered_task(name) if name not in SCENARIOS else Task(SCENARIOS[name], env_id=name)
    if preset is not None:
        base = base._replace(scenario=find_preset(name, preset))
    if scenario is not None:
        base = base._replace(scenario=scenario)
    if not isinstance(base.scenario, Scenario):
        raise ValueError(f"scenario must be a tagtrack.envs.scenario.Scenario, got {base.scenario!r}")
    return _change(base, options, tracks)


def _change(base: Task, options: TaskOptions, tracks: str | Path | None) -> Task:
    """A task with overrides, particles and tracks as asked."""
    overrides, time_scale = options.get("overrides"), options.get("time_scale")
    if overrides is not None and not isinstance(overrides, Mapping):
        raise ValueError(f'overrides must map dotted names to values, as {{"tag.period": 5.0}}, got {overrides!r}')
    fleet = _fleet_changes(options)
    if twice := sorted(set(fleet) & set(overrides or {})):
        raise ValueError(f"{twice[0]} is given twice, as an option and in overrides; drop one")
    changes = {**fleet, **(overrides or {})}
    if options.get("particles") is not None:
        changes["belief.particles"] = options["particles"]
    if tracks is not None:
        return _build_replay(base.scenario, changes, tracks, time_scale)._replace(env_id=base.env_id)
    if time_scale is not None:
        raise ValueError(f"time_scale={time_scale!r} slows a recorded track, but none is given; add tracks=FILE")
    scenario = with_overrides(base.scenario, changes)
    for name, value in (("vehicles", scenario.vehicles), ("tags", scenario.targets)):
        if value > MOST_AGENTS:
            raise ValueError(f"{name} must be at most {MOST_AGENTS}, got {value}")
    return base._replace(scenario=scenario)


def _fleet_changes(options: TaskOptions) -> dict[str, Any]:
    """What options say of a fleet, as overrides."""
    changes: dict[str, Any] = {}
    for name, own in (("vehicles", "vehicles"), ("tags", "targets")):
        value = options.get(name)
        if value is not None:
            whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
            if not (whole and 1 <= value <= MOST_AGENTS):  # type: ignore[operator]
                raise ValueError(f"{name} must be a whole number from 1 to {MOST_AGENTS}, got {value!r}")
            changes[own] = int(value)  # type: ignore[call-overload]
    if options.get("modem") is not None:
        changes["modem"] = options["modem"]
    return changes


def full_id(env_id: str) -> str:
    """An environment's id with its namespace.

    Raises:
        ValueError: where neither we nor anybody else registered it, listing ours; where it is of another kind of environment.

    >>> full_id("LeopardShark-v0")
    'TagTrack/LeopardShark-v0'
    """
    module, colon, name = str(env_id).rpartition(":")
    if colon:
        _import(module)
    name = tagtrack._FLEETS.get(name, name)  # what PettingZoo knows it by
    for known in (name, f"TagTrack/{name}"):
        if known in SCENARIOS:
            return known
    if _specification(name) is not None:
        return name
    raise unknown("environment", env_id, SCENARIOS)


def _import(module: str) -> None:
    try:
        import_own(module)
    except ImportError as error:
        raise ValueError(f"cannot import {module!r} ({error}); run where it lies, or put it on PYTHONPATH") from None


def _specification(env_id: str) -> Any:
    """Gymnasium's specification of an id for one of our environments; None where it has none."""
    try:
        from gymnasium.envs.registration import load_env_creator, registry
    except ImportError:
        return None
    specification = registry.get(env_id)
    if specification is None:
        return None
    creator: Any = specification.entry_point
    if isinstance(creator, str):
        try:
            creator = load_env_creator(creator)
        except (ImportError, AttributeError) as error:
            raise ValueError(f"{env_id} was registered as {specification.entry_point}, which cannot load ({error})") from None
    if not hasattr(creator, "default_id"):
        raise ValueError(f"{env_id} is no environment of TagTrack's; known: {', '.join(SCENARIOS)}, or one registered like them")
    return specification


def _registered_task(env_id: str) -> Task:
    """The task of an id that somebody registered with options of his own."""
    options = {key: value for key, value in _specification(env_id).kwargs.items() if key != "render_mode"}
    base = options.pop("env_id", None) or "TagTrack/LeopardShark-v0"
    if base == env_id:
        raise ValueError(f"{env_id} was registered with itself as env_id; name one of {', '.join(SCENARIOS)}, or give a scenario")
    task = build_task(base, **options)._replace(env_id=env_id)
    limit = _specification(env_id).max_episode_steps
    return task._replace(scenario=replace(task.scenario, episode_steps=episode_limit(task.scenario, limit)))


def _build_replay(scenario: Scenario, changes: dict[str, Any], tracks: str | Path, time_scale: float | None) -> Task:
    """The task of a scenario whose fish swims recorded tracks."""
    motion = changes.get("fish", Replay())
    if not isinstance(motion, Replay):
        raise ValueError(f"the fish swims either the tracks of {tracks} or by a motion (fish={motion}); drop one of the two")
    if not isinstance(scenario.fish, Replay):
        scenario = replace(scenario, fish=Replay())
    if time_scale is not None:
        if "fish.time_scale" in changes:
            raise ValueError(f"time_scale={time_scale!r} and fish.time_scale={changes['fish.time_scale']} are one; drop one")
        changes["fish.time_scale"] = time_scale
    scenario = with_overrides(scenario, changes)
    assert isinstance(scenario.fish, Replay)
    found = read_tracks(tracks)
    try:
        find_stretches(found, scenario.fish, scenario.time_step, scenario.episode_steps)
    except ValueError as error:
        raise ValueError(f"{tracks}: {error}") from None
    return Task(scenario, found, str(tracks))


def parse_overrides(texts: Sequence[str], motion: str | None = None) -> dict[str, str]:
    """Overrides from ``NAME=VALUE`` texts and, in short, the fish's ``motion`` by its name.

    Raises:
        ValueError: for a text without name or value and for a name set twice.

    >>> parse_overrides(["water.noisy_share=0.3"], motion="levy")
    {'water.noisy_share': '0.3', 'fish': 'levy'}
    """
    overrides: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise ValueError(f"a parameter is set by NAME=VALUE, for instance water.noisy_share=0.3; got {text!r}")
        if name in overrides:
            raise ValueError(f"{name} is set twice, to {overrides[name]} and to {value}; drop one")
        overrides[name] = value
    if motion is not None:
        if "fish" in overrides:
            raise ValueError(f"the motion of the fish is set twice, to {motion} and to {overrides['fish']}; drop one")
        overrides["fish"] = motion
    return overrides


def episode_limit(scenario: Scenario, steps: int | None, name: str = "max_episode_steps") -> int:
    """Steps after which an episode ends: the scenario's ``episode_steps``, unless a shell is told another number, more or fewer.

    Args:
        name: of the shell's argument, for errors.
    """
    if steps is None:
        return scenario.episode_steps
    whole = isinstance(steps, (int, np.integer)) and not isinstance(steps, bool)
    if not whole or steps < 1:
        raise ValueError(f"{name} must be a whole number of at least 1, got {steps!r}")
    if isinstance(scenario.fish, Replay) and steps > scenario.episode_steps:
        raise ValueError(
            f"{name}={steps} is beyond the {scenario.episode_steps} steps for which recorded tracks were "
            'chosen; make it overrides={"episode_steps": ...} instead'
        )
    return int(steps)
