"""What a shell is asked to run: the keyword arguments that all shells share become one scenario and its recorded tracks.

The spaces of observation and action follow from the scenario.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box

from tagtrack.envs.layout import action_names, features
from tagtrack.envs.motions import Replay
from tagtrack.envs.motions.replay import find_stretches
from tagtrack.envs.motions.tracks import Track, read_tracks
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.presets import find_preset
from tagtrack.envs.scenario import Scenario, find_scenario


class Task(NamedTuple):
    """A scenario and, where its fish replays them, recorded tracks: what ``Simulation`` is made of."""

    scenario: Scenario
    tracks: tuple[Track, ...] | None = None  # one for each animal
    tracks_file: str | None = None  # where they were read

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
        tracks: csv file of recorded tracks (``read_tracks``), one of which the fish then swims instead of its random walk.
        time_scale: how fast it swims its track: 0.5 is half the recorded speed (``fish.time_scale``).
        overrides: dotted name -> value, for instance ``{"water.noisy_share": 0.3}`` (see ``with_overrides``).
        scenario: a whole scenario of one's own, which the other arguments then change.
    Raises:
        ValueError: for an unknown id, preset or name, a value out of range, a time_scale without a track, a motion
            beside a track, a broken track file or one without a stretch as long as an episode.
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
    if tracks is not None:
        return _build_replay(chosen, changes, tracks, time_scale)
    chosen = with_overrides(chosen, changes)
    if time_scale is not None:
        raise ValueError(f"time_scale={time_scale!r} slows a recorded track, but none is given; add tracks=FILE")
    return Task(chosen)


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
    layout = features(scenario)
    return Box(np.array([f.low for f in layout], np.float32), np.array([f.high for f in layout], np.float32))


def action_space(scenario: Scenario) -> Box:
    """Of one vehicle: as many numbers in [-1, 1] as ``action_names`` has names."""
    return Box(-1.0, 1.0, (len(action_names(scenario)),), np.float32)
