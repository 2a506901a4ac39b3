"""An episode ends where it was asked to end, however the environment was made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import tagtrack  # noqa: F401  registers the environments

ENV_ID = "TagTrack/LeopardShark-v0"
AHEAD = np.array([1.0, 0.0], np.float32)
ALL_AHEAD = np.stack([AHEAD, AHEAD])
every_mode = pytest.mark.parametrize("mode", AutoresetMode)


def length_of(env: gym.Env[Any, Any]) -> int:
    """Steps until the episode that begins now is truncated."""
    env.reset(seed=0)
    for step in range(1, 2000):
        if env.step(AHEAD)[3]:
            return step
    raise AssertionError("the episode does not end")


def lengths_of(envs: Any, mode: AutoresetMode) -> list[int]:
    """The lengths of the first two episodes, which all worlds end together."""
    envs.reset(seed=0)
    lengths, begun = [], 0
    for step in range(1, 3000):
        truncated = envs.step(ALL_AHEAD)[3]
        if truncated.all():
            lengths.append(step - begun)
            # A reset at the next step takes a step; one within the step, or one that is asked for, none.
            begun = step + (mode is AutoresetMode.NEXT_STEP)
            if len(lengths) == 2:
                return lengths
            if mode is AutoresetMode.DISABLED:
                envs.reset(options={"reset_mask": truncated})
        assert not truncated.any() or truncated.all()
    raise AssertionError("the episodes do not end")


@pytest.mark.parametrize(
    ("asked", "length"),
    [({"overrides": {"episode_steps": 600}}, 600), ({"max_episode_steps": 10}, 10), ({"overrides": {"episode_steps": 7}}, 7)],
)
def test_single_environment_ends_where_it_was_asked_to(asked: dict[str, Any], length: int) -> None:
    assert length_of(gym.make(ENV_ID, particles=10, **asked)) == length


@every_mode
@pytest.mark.parametrize(
    ("asked", "length"),
    [({"overrides": {"episode_steps": 600}}, 600), ({"max_episode_steps": 1000}, 1000), ({"max_episode_steps": 10}, 10)],
)
def test_vector_environment_ends_where_it_was_asked_to(asked: dict[str, Any], length: int, mode: AutoresetMode) -> None:
    envs = gym.make_vec(ENV_ID, 2, "vector_entry_point", particles=10, autoreset_mode=mode, **asked)
    assert lengths_of(envs, mode) == [length, length]


@every_mode
def test_recorded_tracks_last_no_longer_than_they_were_chosen_for(tmp_path: Path, mode: AutoresetMode) -> None:
    track = tmp_path / "track.csv"
    track.write_text("t_unix_s,x,y\n" + "".join(f"{second},{0.2 * second},0\n" for second in range(200)))
    asked: dict[str, Any] = {
        "particles": 10, "tracks": track, "overrides": {"episode_steps": 20}, "autoreset_mode": mode,
    }  # fmt: skip
    assert lengths_of(gym.make_vec(ENV_ID, 2, "vector_entry_point", max_episode_steps=12, **asked), mode) == [12, 12]
    with pytest.raises(ValueError) as caught:
        gym.make_vec(ENV_ID, 2, "vector_entry_point", max_episode_steps=21, **asked)
    assert "max_episode_steps=21 is beyond the 20 steps" in str(caught.value) and "\n" not in str(caught.value)
