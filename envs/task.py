"""What a shell is asked to run: the keyword arguments that all shells share become one scenario and its recorded track.

The spaces of observation and action follow from the scenario.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box

from tagtrack.envs.observation import action_names, features
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.presets import find_preset
from tagtrack.envs.scenario import Scenario, find_scenario
from tagtrack.envs.sim.motion import Replay
from tagtrack.envs.sim.tracks import Track, read_track


class Task(NamedTuple):
    """A scenario and, where its fish replays one, the recorded track: what ``Simulation`` is made of."""

    scenario: Scenario
    track: Track | None


def build_task(
    env_id: str,
    *,
    preset: str | None = None,
    particles: int | None = None,
    tracks: str | Path | None = None,
    time_scale: float | None = None,
    overrides: Mapping[str, Any] | None = None,
    scenario: Scenario | None = None,
) -> Task:
    """The task of an id, changed as asked.

    Args:
        env_id: a key of ``SCENARIOS``; not looked at where ``scenario`` is given.
        preset: other people's settings of that task (``presets.PRESETS``), instead of the id's own.
        particles: particles of each belief (``belief.particles``).
        tracks: csv file of a recorded track, which the fish then swims instead of its random walk.
        time_scale: how fast it swims its track: 0.5 is half the recorded speed.
        overrides: dotted name -> value, for instance ``{"water.noisy_share": 0.3}`` (see ``with_overrides``).
        scenario: a whole scenario of one's own, which the other arguments then change.
    Raises:
        ValueError: for an unknown id, preset or name, a value out of range, a time_scale without a track, a broken track file.
        FileNotFoundError: where there is no such file.
    """
    if preset is not None and scenario is not None:
        raise ValueError(f"preset={preset!r} and a scenario are two scenarios; give one of them")
    if preset is not None:
        find_scenario(env_id)  # a wrong id before a wrong preset
        chosen = find_preset(env_id, preset)
    else:
        chosen = find_scenario(env_id) if scenario is None else scenario
    if not isinstance(chosen, Scenario):
        raise ValueError(f"scenario must be a tagtrack.envs.scenario.Scenario, got {chosen!r}")
    if overrides is not None and not isinstance(overrides, Mapping):
        raise ValueError(f'overrides must map dotted names to values, as {{"tag.period": 5.0}}, got {overrides!r}')
    changes = dict(overrides or {})
    if particles is not None:
        changes["belief.particles"] = particles
    chosen = with_overrides(chosen, changes)
    if tracks is None:
        if time_scale is not None:
            raise ValueError(f"time_scale={time_scale!r} slows a recorded track, but none is given; add tracks=FILE")
        return Task(chosen, None)
    fish = chosen.fish if isinstance(chosen.fish, Replay) else Replay()
    if time_scale is not None:
        fish = Replay(time_scale=time_scale)
    return Task(replace(chosen, fish=fish), read_track(tracks))


def parse_overrides(texts: Sequence[str]) -> dict[str, str]:
    """Overrides from ``NAME=VALUE`` texts. Raises ValueError for a text without name or value and for a name set twice."""
    overrides: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise ValueError(f"a parameter is set by NAME=VALUE, for instance water.noisy_share=0.3; got {text!r}")
        if name in overrides:
            raise ValueError(f"{name} is set twice, to {overrides[name]} and to {value}; drop one")
        overrides[name] = value
    return overrides


def episode_limit(scenario: Scenario, max_episode_steps: int | None) -> int:
    """Steps after which an episode ends: the scenario's ``episode_steps``, or fewer where a shell has a lower limit."""
    if max_episode_steps is None:
        return scenario.episode_steps
    if not isinstance(max_episode_steps, (int, np.integer)) or max_episode_steps < 1:
        raise ValueError(f"max_episode_steps must be a whole number of at least 1, got {max_episode_steps!r}")
    return min(scenario.episode_steps, int(max_episode_steps))


def require_single(scenario: Scenario, shell: str) -> None:
    """Refuse a fleet where a shell shows one vehicle and one tag."""
    if scenario.vehicles != 1 or scenario.targets != 1:
        raise ValueError(
            f"{shell} shows a single vehicle and a single tag, got vehicles={scenario.vehicles}, "
            f"targets={scenario.targets}; fleets run through tagtrack.envs.simulation.Simulation"
        )


def observation_space(scenario: Scenario) -> Box:
    """Of one vehicle: finite bounds, one for each of ``features``."""
    layout = features(scenario.targets, scenario.receiver.kind)
    return Box(np.array([f.low for f in layout], np.float32), np.array([f.high for f in layout], np.float32))


def action_space(scenario: Scenario) -> Box:
    """Of one vehicle: as many numbers in [-1, 1] as ``action_names`` has names."""
    return Box(-1.0, 1.0, (len(action_names(scenario.speed_control)),), np.float32)
