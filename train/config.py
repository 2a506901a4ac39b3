"""What a training run is: a documented dataclass that the command line fills, and the hyper-parameters of each environment."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from tagtrack.envs.scenario import find_scenario

Algorithm = Literal["ppo", "sac"]


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """Train a policy; it can then be named, by its folder, in `python -m eval benchmark`."""

    env: str = "TagTrack/LeopardShark-v0"
    """Environment id, with or without `TagTrack/`."""
    algo: Algorithm = "ppo"
    """Algorithm of Stable-Baselines3."""
    steps: int | None = None
    """Environment steps in all; default by environment."""
    seed: int = 0
    """Of network, exploration and episodes. One seed is no result: train several."""
    num_envs: int | None = None
    """Worlds that are simulated together; default by environment."""
    preset: str | None = None
    """Other people's settings of the task: RangeOnly-v0 has masmitja2023, utracking_medium, utracking_hard."""
    particles: int | None = None
    """Particles of the filter; default the environment's or preset's own (1000 for most)."""
    tracks: Path | None = None
    """A csv file (t_unix_s,x,y; of several animals with a column tag) of recorded tracks for the fish to swim."""
    time_scale: float | None = None
    """How fast it swims its track; 0.5 is half the recorded speed."""
    motion: str | None = None
    """How the fish moves instead: momentum, brownian, levy or boat (as --set fish=levy); not with --tracks."""
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Parameters of the scenario, for instance water.noisy_share=0.3 reward.standoff=2."""
    hyper: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Hyper-parameters of the algorithm, for instance learning_rate=3e-4 gamma=0.995."""
    out: Path | None = None
    """Folder of the run; default runs/ENV-ALGO-seedN."""
    resume: Path | None = None
    """Folder of a run to go on with, from its last checkpoint; only --steps, --threads and --device go with it."""
    config: Path | None = None
    """A config.json to start from (that of another run); what else is on the command line goes before it."""
    threads: int = 1
    """Threads of the simulation. Torch keeps to one."""
    device: str = "cpu"
    """Torch device: cpu, cuda, cuda:1 ..."""
    validation_episodes: int | None = None
    """Episodes of each validation, on seeds that neither training nor benchmarks use; the best policy is kept. Default by
    environment: 256, and more where rare losses make up the mean error."""


@dataclass(frozen=True, kw_only=True)
class PPOSettings:
    """Proximal policy optimization, for a fast batch of worlds on one core."""

    steps: int = 2_000_000
    num_envs: int = 256
    rollout: int = 8192  # steps of all worlds together between updates
    batch_size: int = 2048
    epochs: int = 4
    learning_rate: float = 1e-3  # falls linearly to a tenth
    gamma: float = 0.995
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    entropy: float = 0.0
    log_std: float = -1.0  # of the first exploration noise
    width: int = 64  # of the two hidden layers
    ahead: float = 0.5  # first bias of the action "ahead": an untrained policy pursues
    validation_episodes: int = 256


@dataclass(frozen=True, kw_only=True)
class SACSettings:
    """Soft actor-critic: fewer steps, more work on each."""

    steps: int = 300_000
    num_envs: int = 64
    buffer: int = 300_000
    learning_starts: int = 6_400
    gradient_steps: int = 8  # for each step of all worlds
    batch_size: int = 256
    learning_rate: float = 1e-3
    gamma: float = 0.99
    tau: float = 0.005
    width: int = 64
    ahead: float = 0.5
    validation_episodes: int = 256


Settings = PPOSettings | SACSettings
FLAGS = {"steps": 1, "num_envs": 1, "validation_episodes": 2}  # settings with a flag of their own -> the least that makes sense

# Where an environment, or a preset of it, wants other values than an algorithm's own.
SETTINGS: dict[tuple[str, str], Settings] = {
    ("TagTrack/TimeOfFlight-v0", "ppo"): PPOSettings(steps=1_500_000),
    ("TagTrack/RangeOnly-v0", "ppo"): PPOSettings(steps=6_000_000, rollout=16384, batch_size=4096, gamma=0.98),
    ("masmitja2023", "ppo"): PPOSettings(steps=6_000_000, rollout=16384, batch_size=4096, gamma=0.99),
    ("utracking_medium", "ppo"): PPOSettings(steps=1_000_000, gamma=0.98),
    ("utracking_hard", "ppo"): PPOSettings(steps=1_000_000, gamma=0.98),
    # To pursue is the worst there is where only the edge tells.
    ("TagTrack/AreaOnly-v0", "ppo"): PPOSettings(steps=1_500_000, rollout=16384, batch_size=4096, gamma=0.99, ahead=0.0),
    # One or two episodes in a hundred, in which the animal is lost, decide: large batches and many validations feel them.
    ("TagTrack/AreaOnlyUnknownRange-v0", "ppo"): PPOSettings(
        steps=12_000_000, rollout=32768, batch_size=8192, gamma=0.99, ahead=0.0, validation_episodes=1024
    ),
}


def find_settings(config: TrainConfig) -> Settings:
    """Hyper-parameters of a run: the algorithm's, the environment's or preset's, the command line's, each over the one before.

    Raises:
        ValueError: for an unknown name or a value of another kind.
    """
    own = PPOSettings() if config.algo == "ppo" else SACSettings()
    settings = SETTINGS.get((qualified_id(config.env), config.algo), own)
    if config.preset is not None:
        settings = SETTINGS.get((config.preset, config.algo), settings)
    changes: dict[str, Any] = {}
    known = {field.name: getattr(settings, field.name) for field in dataclasses.fields(settings)}
    for text in config.hyper:
        name, _, value = text.partition("=")
        if name not in known or name in FLAGS:
            names = ", ".join(key for key in known if key not in FLAGS)
            raise ValueError(f"unknown hyper-parameter {name!r} of {config.algo}; known: {names}")
        try:
            changes[name] = type(known[name])(json.loads(value))
        except (ValueError, TypeError):
            raise ValueError(f"--hyper {name} must be a number, got {value!r}") from None
    for name, least in FLAGS.items():
        value = getattr(config, name)
        if value is not None:
            if value < least:
                raise ValueError(f"--{name.replace('_', '-')} must be at least {least}, got {value}")
            changes[name] = value
    return dataclasses.replace(settings, **changes)


def qualified_id(env: str) -> str:
    """The id with its namespace. Raises ValueError that lists the known ids."""
    find_scenario(env)
    return env if env.startswith("TagTrack/") else f"TagTrack/{env}"


def to_json(config: TrainConfig) -> dict[str, Any]:
    """Plain values of a config, for config.json."""
    plain = dataclasses.asdict(config)
    return {key: str(value) if isinstance(value, Path) else value for key, value in plain.items()}


def from_json(path: Path) -> TrainConfig:
    """Read what ``to_json`` wrote. Raises ValueError that names the file and what is wrong in it."""
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileNotFoundError(f"no configuration {path}; give the config.json of a run") from None
    except (ValueError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not a JSON file ({error})") from None
    if not isinstance(plain, dict):
        raise ValueError(f"{path}: must hold an object of settings, got {type(plain).__name__}")
    for told in ("settings", "scenario", "replayed"):  # what a run made of its config
        plain.pop(told, None)
    known = {field.name: field for field in dataclasses.fields(TrainConfig)}
    unknown = sorted(set(plain) - set(known))
    if unknown:
        raise ValueError(f"{path}: unknown setting {unknown[0]!r}; known: {', '.join(known)}")
    for name in ("tracks", "out", "resume", "config"):
        if plain.get(name) is not None:
            plain[name] = Path(plain[name])
    for name in ("set", "hyper"):
        plain[name] = tuple(plain.get(name, ()))
    return TrainConfig(**plain)
