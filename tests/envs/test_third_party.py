"""Other people's libraries take the fleets as they are. Each test is skipped where its library is not installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from tagtrack.envs.parallel import TagTrackParallelEnv, parallel_env

STEPS = 12
SMALL: dict[str, Any] = {"vehicles": 3, "tags": 2, "particles": 16}
# Vehicles at full speed draw up to 60 W: some batteries end within the 24 s of an episode, some do not.
BATTERY = {"vehicle.battery": 0.35, "vehicle.battery_spread": 0.5}


def fleet(*, drop_out: bool = False, **options: Any) -> TagTrackParallelEnv:
    overrides = {"episode_steps": STEPS, **(BATTERY if drop_out else {})}
    return parallel_env("LeopardShark-v0", **{**SMALL, "overrides": overrides, **options})


def optional(module: str) -> Any:
    return pytest.importorskip(module, reason=f"{module} is not installed; it is no dependency", exc_type=ImportError)


def test_supersuit_makes_a_vector_of_all_vehicles() -> None:
    supersuit = optional("supersuit")
    rows = supersuit.pettingzoo_env_to_vec_env_v1(fleet())
    env = supersuit.concat_vec_envs_v1(rows, 2, num_cpus=0, base_class="gymnasium")
    observation, _ = env.reset(seed=0)
    assert observation.shape == (6, fleet().observation_space("auv_0").shape[0])
    for _ in range(2 * STEPS):
        observation, reward, _, truncated, _ = env.step(np.zeros((6, 2), np.float32))
        assert np.isfinite(observation).all() and reward.shape == (6,)


def test_supersuits_black_death_stands_in_for_vehicles_that_have_left() -> None:
    """Its own ``agents`` do not tell when an episode has ended (3.11 waits for agents that are both terminated and truncated)."""
    supersuit = optional("supersuit")
    env = supersuit.black_death_v3(fleet(drop_out=True))
    left = False
    for seed in range(3):
        env.reset(seed=seed)
        while env.unwrapped.agents:
            present = list(env.unwrapped.agents)
            observations, rewards, *_ = env.step({agent: np.ones(2, np.float32) for agent in env.possible_agents})
            for agent in set(env.possible_agents) - set(present):
                left = True
                assert (observations[agent] == 0.0).all() and rewards[agent] == 0.0
    assert left


@pytest.mark.parametrize("base", ["gymnasium", "stable_baselines3"])
def test_supersuit_runs_vehicles_in_processes_of_their_own(base: str) -> None:
    supersuit = optional("supersuit")
    env = supersuit.concat_vec_envs_v1(supersuit.pettingzoo_env_to_vec_env_v1(fleet()), 2, num_cpus=2, base_class=base)
    env.reset()
    for _ in range(3):
        observation = env.step(np.zeros((6, 2), np.float32))[0]
    assert np.isfinite(observation).all()
    env.close()


def torchrl_env() -> Any:
    gym = optional("torchrl.envs.libs.gym")
    env = gym.GymEnv("tagtrack:TagTrack/LeopardShark-v0", particles=16, overrides={"episode_steps": STEPS})
    return env.auto_register_info_dict()


@pytest.mark.parametrize("batched", ["SerialEnv", "ParallelEnv"])
def test_torchrl_batches_infos(batched: str) -> None:
    envs = optional("torchrl.envs")
    env = getattr(envs, batched)(2, torchrl_env)
    rollout = env.rollout(2 * STEPS, break_when_any_done=False)
    env.close()
    assert rollout["next", "reward_localization"].shape == (2, 2 * STEPS) and rollout["next", "belief_mean"].shape[-1] == 2
    assert bool((rollout["next", "localization_error"] > 0.0).all()) and rollout["next", "done"].sum() == 4


@pytest.mark.parametrize("mode", ["SAME_STEP", "DISABLED"])
def test_torchrl_takes_the_vector_environment(mode: str) -> None:
    libs = optional("torchrl.envs.libs.gym")
    vector = gymnasium.make_vec("TagTrack/LeopardShark-v0", num_envs=3, particles=16, autoreset_mode=AutoresetMode[mode])
    rollout = libs.GymWrapper(vector).rollout(4)
    assert rollout["observation"].shape == (3, 4, 21)


def test_minari_records_infos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    minari = optional("minari")
    optional("jax")  # its collector's
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env = gymnasium.make("tagtrack:TagTrack/LeopardShark-v0", particles=16, overrides={"episode_steps": STEPS})
    collector = minari.DataCollector(env, record_infos=True)
    for seed in range(2):
        collector.reset(seed=seed)
        for _ in range(STEPS):
            *_, info = collector.step(collector.action_space.sample())
    data = collector.create_dataset("tagtrack/test-v0", algorithm_name="random")
    assert data[1].infos["localization_error"][-1] == info["localization_error"]
    assert data[1].infos["true_fish_position"].shape == (STEPS + 1, 2)


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL is tested using version")
@pytest.mark.parametrize("drop_out", [False, True])
def test_torchrl_rolls_out_and_masks_vehicles_that_have_left(drop_out: bool) -> None:
    libs = optional("torchrl.envs.libs.pettingzoo")
    env = libs.PettingZooWrapper(fleet(drop_out=drop_out), use_mask=True, return_state=True)
    env.set_seed(0)
    rollout = env.rollout(STEPS, break_when_any_done=False)
    mask = rollout["next", "auv", "mask"]
    assert mask.shape == (STEPS, 3) and rollout["auv", "observation"].isfinite().all()
    assert bool(mask[:-1].all()) != drop_out  # after the last step nobody is left


@pytest.mark.parametrize("drop_out", [False, True])
def test_skrl_wraps_it(drop_out: bool) -> None:
    wrappers = optional("skrl.envs.wrappers.torch")
    import torch

    env = wrappers.wrap_env(fleet(drop_out=drop_out), wrapper="pettingzoo")
    observations, _ = env.reset()
    assert env.num_agents == 3 and set(observations) == set(env.possible_agents)
    for _ in range(STEPS):
        observations, *_ = env.step({agent: torch.ones(1, 2) for agent in env.agents})
        assert all(observation.isfinite().all() for observation in observations.values())


@pytest.mark.parametrize("drop_out", [False, True])
def test_rllib_wraps_it(drop_out: bool) -> None:
    wrapper = optional("ray.rllib.env.wrappers.pettingzoo_env").ParallelPettingZooEnv
    env = wrapper(fleet(drop_out=drop_out))
    observations, _ = env.reset(seed=0)
    terminations = {"__all__": False}
    for _ in range(STEPS):
        actions = {agent: np.ones(2, np.float32) for agent in env.par_env.agents}
        observations, rewards, terminations, truncations, _ = env.step(actions)
        assert set(rewards) == set(observations)
        if terminations["__all__"] or truncations["__all__"]:
            break
    assert terminations["__all__"] or truncations["__all__"]
