"""Hyper-parameters: an algorithm's own, those of an environment or preset, what is sensible, and what few steps leave of them."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from tagtrack.envs.scenario import Scenario
from tagtrack.envs.task import full_id
from tagtrack.envs.validation import unknown
from tagtrack.eval.contestants import is_baseline
from tagtrack.eval.rollout import EPISODES_OF_A_RUN
from tagtrack.eval.whole_number import read_whole_number
from tagtrack.train.config import TrainConfig


@dataclass(frozen=True, kw_only=True)
class PPOSettings:
    """Proximal policy optimization, for a fast batch of worlds on one core."""

    steps: int = 2_000_000
    num_envs: int = 256
    rollout: int = 8192  # steps of all worlds together between updates; see fit_to_steps
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
    hold: int = 1  # environment steps that a decision is held for; steps, rollouts and gamma then count decisions
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

# Where an environment, or a preset of it, wants other values than an algorithm's own.
SETTINGS: dict[tuple[str, str], Settings] = {
    ("TagTrack/TimeOfFlight-v0", "ppo"): PPOSettings(steps=1_500_000),
    # Where the fish is as fast as the vehicle there is more to learn: of all that was tried, longer training, a wider network and
    # a farther horizon paid.
    ("TagTrack/Glider-v0", "ppo"): PPOSettings(steps=10_000_000, rollout=16384, batch_size=4096, gamma=0.99, width=128),
    ("TagTrack/RangeOnly-v0", "ppo"): PPOSettings(steps=6_000_000, rollout=16384, batch_size=4096, gamma=0.98),
    ("TagTrack/RangeOnlyGlider-v0", "ppo"): PPOSettings(steps=6_000_000, rollout=16384, batch_size=4096, gamma=0.98),
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


def with_own_start(config: TrainConfig) -> TrainConfig:
    """The config with what a policy of its task begins as, where nothing is said; ``--start none`` begins with nothing."""
    if config.start is None and config.algo == "ppo" and full_id(config.env) in STARTS:
        return replace(config, start=STARTS[full_id(config.env)])
    return replace(config, start=None) if config.start == "none" else config


class Limits(NamedTuple):
    """The values that make sense."""

    least: float = -math.inf
    most: float = math.inf
    above: bool = False  # the least itself is too little

    def hold(self, value: float) -> bool:
        """Whether a value is finite and within."""
        return math.isfinite(value) and (self.least < value if self.above else self.least <= value) and value <= self.most

    def __str__(self) -> str:
        least = f"above {self.least:g}" if self.above else f"at least {self.least:g}"
        return least if math.isinf(self.most) else f"{least} and at most {self.most:g}"


FLAGS = ("steps", "num_envs", "validation_episodes")  # settings with a flag of their own
LIMITS = {
    "steps": Limits(2),  # advantages are normalized: one has no spread
    "num_envs": Limits(1),  # from above, memory limits them
    "validation_episodes": Limits(2, EPISODES_OF_A_RUN),
    "rollout": Limits(2),
    "batch_size": Limits(2),
    "epochs": Limits(1),
    "learning_rate": Limits(0, 1, above=True),
    "gamma": Limits(0, 1, above=True),
    "gae_lambda": Limits(0, 1),
    "clip_range": Limits(0, above=True),
    "entropy": Limits(0),
    "log_std": Limits(-10, 2),
    "width": Limits(1, 4096),
    "ahead": Limits(-10, 10),
    "hold": Limits(1),
    "buffer": Limits(1),
    "learning_starts": Limits(0),
    "gradient_steps": Limits(1),
    "tau": Limits(0, 1, above=True),
}


# Seconds between decisions where there are tags to share out and nothing is known of it at first: commitment is what makes it
# learnable. A copy of a baseline has no need of it.
FLEET_HOLD = 12.0
FLEET = PPOSettings(steps=4_000_000, rollout=16384, batch_size=4096, gamma=0.98)
AREA_FLEET = replace(FLEET, gamma=0.99, learning_rate=5e-4, ahead=0.0)
STARTS = {"TagTrack/GliderPair-v0": "information:34"}  # what a fleet's policy begins as, unless it is told otherwise
FLEETS = {"TagTrack/AreaOnly-v0": AREA_FLEET, "TagTrack/AreaOnlyUnknownRange-v0": AREA_FLEET}
STEPS_OF_HELD = 1_500_000  # decisions that are held


def find_settings(config: TrainConfig, scenario: Scenario | None = None) -> Settings:
    """Hyper-parameters of a run: the algorithm's, the environment's or preset's, the command line's, each over the one before.

    Args:
        scenario: of the run's task, which tells whether it is a fleet's.
    Raises:
        ValueError: for an unknown name, a value of another kind or out of its range, and a name given twice.
    """
    own = PPOSettings() if config.algo == "ppo" else SACSettings()
    settings = SETTINGS.get((full_id(config.env), config.algo), own)
    if config.preset is not None:
        settings = SETTINGS.get((config.preset, config.algo), settings)
    if isinstance(settings, PPOSettings) and scenario is not None and scenario.vehicles * scenario.targets > 1:
        settings = FLEETS.get(full_id(config.env), FLEET)
        if config.start is not None:
            settings = replace(settings, learning_rate=5e-4, log_std=-1.5)  # lest it forget what it began as
        if scenario.targets > 1 and (config.start is None or not is_baseline(config.start)):
            hold = max(1, round(FLEET_HOLD / scenario.time_step))
            settings = replace(settings, hold=hold, steps=STEPS_OF_HELD if hold > 1 else settings.steps)
    changes = _read_hyper(config, settings)
    for name in FLAGS:
        value = getattr(config, name)
        if value is not None:
            _require(f"--{name.replace('_', '-')}", name, value)
            changes[name] = value
    return replace(settings, **changes)


def _read_hyper(config: TrainConfig, settings: Settings) -> dict[str, Any]:
    known = {field.name: getattr(settings, field.name) for field in dataclasses.fields(settings) if field.name not in FLAGS}
    texts: dict[str, str] = {}
    for text in (text for group in config.hyper for text in group):
        name, _, value = text.partition("=")
        if not (name and value):
            raise ValueError(f"a hyper-parameter is set by NAME=VALUE, for instance gamma=0.99; got {text!r}")
        if name not in known:
            raise unknown("hyper-parameter", name, known, of=config.algo)
        if name in texts:
            raise ValueError(f"--hyper {name} is set twice, to {texts[name]} and to {value}; drop one")
        texts[name] = value
    return {name: _read_number(name, text, known[name]) for name, text in texts.items()}


def _read_number(name: str, text: str, old: float) -> float:
    whole = isinstance(old, int)
    try:
        value = read_whole_number(text) if whole else float(text)
    except ValueError:
        raise ValueError(f"--hyper {name} must be a {'whole ' * whole}number, got {text!r}") from None
    _require(f"--hyper {name}", name, value)
    return value


def _require(flag: str, name: str, value: float) -> None:
    if not LIMITS[name].hold(value):
        raise ValueError(f"{flag} must be {LIMITS[name]}, got {value}")


LEAST_UPDATES = 8  # of a run, however short
LEAST_LENGTH = 8  # steps of a world from one update to the next, below which rather fewer worlds are simulated


def fit_to_steps(settings: Settings, *, keep_worlds: bool) -> Settings:
    """The settings as so many steps leave them: a short run learns more often, from fewer steps, in fewer worlds.

    PPO's rollouts are shortened until there are 8 updates and the last rollout ends soon after the last step; batches of one
    size fill a rollout. Worlds are fewer where a world would have less than 8 steps between two updates. At the steps of
    ``SETTINGS`` nothing changes. SAC begins to learn after a tenth of its steps at the latest.

    Args:
        keep_worlds: their number was asked for.
    """
    steps, worlds = settings.steps, settings.num_envs
    if isinstance(settings, SACSettings):
        return replace(settings, learning_starts=min(settings.learning_starts, steps // 10))
    updates = max(LEAST_UPDATES, math.ceil(steps / settings.rollout))
    if not keep_worlds:
        worlds = min(worlds, math.ceil(steps / (updates * LEAST_LENGTH)))
    length = max(math.ceil(steps / (updates * worlds)), math.ceil(2 / worlds))
    batches = math.ceil(length * worlds / settings.batch_size)
    batch_size = math.ceil(length * worlds / batches)
    return replace(settings, num_envs=worlds, rollout=length * worlds, batch_size=batch_size)
