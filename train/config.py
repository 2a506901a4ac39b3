"""What a training run is: a documented dataclass that the command line fills, and its file."""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from tagtrack.envs.validation import unknown
from tagtrack.eval.cells.options import EngineOptions
from tagtrack.eval.whole_number import OptionalWholeNumber, WholeNumber

Algorithm = Literal["ppo", "sac"]
Texts = tuple[tuple[str, ...], ...]  # one group for each time that a flag is given


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """Train a policy; it can then be named, by its folder, in `tagtrack eval benchmark`."""

    env: Annotated[str, tyro.conf.arg(metavar="ID")] = "TagTrack/LeopardShark-v0"
    """Environment id, with or without `TagTrack/`."""
    algo: Algorithm = "ppo"
    """Algorithm of Stable-Baselines3."""
    steps: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(default by environment)")] = None
    """Environment steps in all, as 1000 or 1.5e6. PPO rounds them up to whole rollouts; a short run gets shorter rollouts, in
    fewer worlds, so that it still learns eight times."""
    seed: WholeNumber = 0
    """Of network, exploration and episodes. One seed is no result: train several."""
    seeds: Annotated[tuple[WholeNumber, ...], tyro.conf.arg(metavar="N ...", help_behavior_hint="(none)")] = ()
    """Several runs that differ in their seed, in DIR/seedN of --out, and one table over all; the same command again goes on with
    what is not finished."""
    engine: Annotated[EngineOptions, tyro.conf.arg(name="")] = field(default_factory=EngineOptions)
    num_envs: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(default by environment)")] = None
    """Worlds that are simulated together."""
    preset: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(none)")] = None
    """Other settings: surf_zone of LeopardShark-v0; masmitja2023, utracking_medium, utracking_hard of RangeOnly-v0."""
    particles: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(the environment's or preset's own)")] = None
    """Particles of the filter; 1000 for most environments."""
    tracks: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(none)")] = None
    """A csv file (t_unix_s,x,y; of several animals with a column tag) of recorded tracks for the fish to swim."""
    time_scale: Annotated[float | None, tyro.conf.arg(metavar="X", help_behavior_hint="(1)")] = None
    """How fast it swims its track; 0.5 is half the recorded speed."""
    motion: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(the task's own)")] = None
    """How the fish moves instead: momentum, brownian, levy or boat (as --set fish=levy); not with --tracks."""
    vehicles: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(the task's own, 1)")] = None
    """Vehicles of the fleet, at most 20."""
    tags: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(the task's own, 1)")] = None
    """Tagged fish, at most 20."""
    modem: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(the task's own, perfect)")] = None
    """What the vehicles may tell one another: perfect (one belief for all), none (one each), instant (all told at once), tdma
    (packets in turn)."""
    set: Annotated[Texts, tyro.conf.arg(metavar="NAME=VALUE ..."), tyro.conf.UseAppendAction] = ()
    """Parameters of the scenario, for instance water.noisy_share=0.3 reward.standoff=2."""
    hyper: Annotated[Texts, tyro.conf.arg(metavar="NAME=VALUE ..."), tyro.conf.UseAppendAction] = ()
    """Hyper-parameters of the algorithm, for instance learning_rate=3e-4 gamma=0.995."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(runs/ENV-ALGO-seedN, or runs/ENV-ALGO)")] = None
    """Folder of the run; with --seeds of all runs."""
    resume: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(none)")] = None
    """Folder of a run to go on with, from its last checkpoint; only --steps (more of them), --threads, --device and --trust go
    with it. It goes on, bit for bit, as if it had never been cut off; with more --steps it learns at another pace."""
    start: Annotated[str | None, tyro.conf.arg(metavar="POLICY", help_behavior_hint="(none)")] = None
    """What a fleet's policy begins as: a baseline, which it imitates first (uncertain, information:13), or the folder of a run,
    for instance of a smaller fleet; none where the task has one of its own. At first only its critic learns."""
    trust: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Resume a run that was trained elsewhere: loading its checkpoint runs whatever code somebody put in."""
    config: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(none)")] = None
    """A config.json to start from (that of another run); what else is on the command line goes before it."""
    threads: WholeNumber = 1
    """Threads of the simulation. Torch keeps to one."""
    device: Annotated[str, tyro.conf.arg(metavar="NAME")] = "cpu"
    """Torch device: cpu, cuda, cuda:1 ..."""
    validation_episodes: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(default by environment)")] = None
    """Episodes of each validation, on seeds that neither training nor benchmarks use; the best policy is kept. 256, and more
    where rare losses make up the mean error."""


LARGEST = 1e18  # of a number in a file
TOLD = ("settings", "scenario", "replayed")  # what a run's config.json tells beside its config
UNWRITTEN = ("trust", "seeds", "engine")  # no file can ask for them


def flatten(texts: Texts) -> list[str]:
    """The texts of all times that a flag was given."""
    return [text for group in texts for text in group]


def merge_texts(earlier: Texts, later: Texts) -> Texts:
    """NAME=VALUE texts of which the later ones go before the earlier ones of the same name."""
    names = {text.partition("=")[0] for text in flatten(later)}
    kept = tuple(text for text in flatten(earlier) if text.partition("=")[0] not in names)
    return ((kept,) if kept else ()) + later


def to_json(config: TrainConfig) -> dict[str, Any]:
    """Plain values of a config, for config.json."""
    plain = {name: value for name, value in dataclasses.asdict(config).items() if name not in UNWRITTEN}
    plain |= {"set": flatten(config.set), "hyper": flatten(config.hyper)}
    return {key: str(value) if isinstance(value, Path) else value for key, value in plain.items()}


def from_json(path: Path) -> TrainConfig:
    """Read what ``to_json`` wrote. Raises ValueError that names the file and what is wrong in it."""
    plain = read_object(path)
    fields = {field.name: field for field in dataclasses.fields(TrainConfig) if field.name not in UNWRITTEN}
    kinds = typing.get_type_hints(TrainConfig)
    values: dict[str, Any] = {}
    for name, value in plain.items():
        if name in TOLD:
            continue
        if name not in fields:
            raise ValueError(f"{path}: {unknown('setting', name, fields)}")
        try:
            values[name] = _interpret(value, kinds[name])
        except ValueError as error:
            raise ValueError(f"{path}: {name} must be {error}, got {json.dumps(value)[:80]}") from None
    return TrainConfig(**values)


def read_object(path: Path) -> dict[str, Any]:
    """The object of a JSON file. Raises ValueError or FileNotFoundError that names the file."""
    if not path.exists():
        raise FileNotFoundError(f"no configuration {path}; give the config.json of a run")
    if not path.is_file():  # a pipe would be waited for, a device never ends
        raise ValueError(f"{path} is no ordinary file; give the config.json of a run")
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: not a JSON file ({error})") from None
    if not isinstance(plain, dict):
        raise ValueError(f"{path}: must hold an object of settings, got {type(plain).__name__}")
    return plain


def _interpret(value: Any, kind: Any) -> Any:
    """A JSON value as a field's type has it. Raises ValueError with what it must be."""
    optional = type(None) in typing.get_args(kind)
    if isinstance(kind, types.UnionType) or typing.get_origin(kind) is typing.Union:
        (kind,) = (each for each in typing.get_args(kind) if each is not type(None))
    if value is None and optional:
        return None
    or_null = " or null" * optional
    number = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= LARGEST
    if kind is int and number and value == int(value):
        return int(value)
    if kind is float and number:
        return float(value)
    if kind in (str, Path) and isinstance(value, str):
        return kind(value)
    if kind == Texts and isinstance(value, list) and all(isinstance(text, str) for text in value):
        return (tuple(value),) if value else ()
    if typing.get_origin(kind) is Literal and value in typing.get_args(kind):
        return value
    names: dict[Any, str] = {int: "a whole number", float: "a number", Texts: "a list of texts NAME=VALUE"}
    choice = f"one of {', '.join(typing.get_args(kind))}" if typing.get_origin(kind) is Literal else "a text"
    raise ValueError(names.get(kind, choice) + or_null)


def changed_fields(config: TrainConfig, allowed: Sequence[str]) -> list[str]:
    """Names of the fields, but for the allowed ones, that differ from their defaults."""
    plain = TrainConfig()
    names = [field.name for field in dataclasses.fields(TrainConfig) if field.name not in allowed]
    return [name for name in names if getattr(config, name) != getattr(plain, name)]
