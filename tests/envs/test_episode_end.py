"""When an episode ends: after the scenario's steps, whatever a shell has registered, or earlier where a shell is told so."""

import gymnasium
import numpy as np
import pytest

import tagtrack  # noqa: F401 - registers the ids

ENV_ID = "TagTrack/LeopardShark-v0"


@pytest.mark.parametrize(
    ("options", "steps"),
    [
        ({}, 300),
        ({"overrides": {"episode_steps": 600}}, 600),
        ({"overrides": {"episode_steps": 7}}, 7),
        ({"max_episode_steps": 10}, 10),
    ],
)
def test_single_episode_ends_when_it_should(options: dict, steps: int) -> None:
    env = gymnasium.make(ENV_ID, particles=10, **options)
    env.reset(seed=0)
    ended = [env.step(np.zeros(2, np.float32))[3] for _ in range(steps)]
    assert ended == [False] * (steps - 1) + [True]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize(("options", "steps"), [({"overrides": {"episode_steps": 400}}, 400), ({"max_episode_steps": 10}, 10)])
def test_batch_ends_when_it_should_in_every_mode(mode: str, options: dict, steps: int) -> None:
    envs = gymnasium.make_vec(ENV_ID, num_envs=2, particles=10, autoreset_mode=mode, **options)
    envs.reset(seed=0)
    ended = [envs.step(np.zeros((2, 2), np.float32))[3] for _ in range(steps)]
    assert not np.any(ended[:-1]) and np.all(ended[-1])
    envs.close()
