"""The algorithms of Stable-Baselines3 as this project sets them up, fresh or from a checkpoint."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator
from typing import Any

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from tagtrack.envs.frame import Frame
from tagtrack.envs.layout import feature_names
from tagtrack.train.checkpoint import Checkpoint
from tagtrack.train.entity_network import EntityActorCritic
from tagtrack.train.settings import PPOSettings, Settings
from tagtrack.train.vec_env import TagTrackVecEnv


def build_model(settings: Settings, env: TagTrackVecEnv, seed: int, device: str) -> BaseAlgorithm:
    """A fresh PPO or SAC whose untrained policy steers straight for the belief (pursuit).

    For a fleet, and where decisions are held, PPO's network is the one that takes entities as sets (``entity_network.py``).

    Args:
        settings: as ``fit_to_steps`` leaves them: a rollout is whole steps of all rows.
    """
    # Relu: a third faster than tanh here.
    network: dict[str, Any] = {"net_arch": [settings.width, settings.width], "activation_fn": torch.nn.ReLU}
    if isinstance(settings, PPOSettings):
        first, last = settings.learning_rate, 0.1 * settings.learning_rate
        scenario = env.simulation.scenario
        entities = scenario.vehicles * scenario.targets > 1 or settings.hold > 1
        if entities:
            if scenario.frame == Frame.CHOSEN or (scenario.frame == Frame.LINE and scenario.targets > 1):
                raise ValueError(f"a fleet's policy steers by its heading, got steer_by={scenario.frame.name.lower()}; drop it")
            network = {"names": feature_names(scenario), "width": settings.width, "ahead": settings.ahead}
            network["by_heading"] = scenario.frame == Frame.HEADING
        with even_batches():
            ppo = PPO(
                EntityActorCritic if entities else "MlpPolicy",
                env,
                n_steps=settings.rollout // env.num_envs,
                batch_size=settings.batch_size,
                n_epochs=settings.epochs,
                gamma=settings.gamma,
                gae_lambda=settings.gae_lambda,
                clip_range=settings.clip_range,
                ent_coef=settings.entropy,
                learning_rate=LinearDecay(first, last),
                policy_kwargs={**network, "log_std_init": settings.log_std},
                seed=seed,
                device=device,
            )
        if not entities:
            with torch.no_grad():
                head: Any = ppo.policy.action_net  # torch types attributes of a module as tensor or module
                head.bias[0] = settings.ahead
        return ppo
    sac = SAC(
        "MlpPolicy",
        env,
        buffer_size=settings.buffer,
        learning_starts=settings.learning_starts,
        train_freq=1,
        gradient_steps=settings.gradient_steps,
        batch_size=settings.batch_size,
        gamma=settings.gamma,
        tau=settings.tau,
        learning_rate=settings.learning_rate,
        policy_kwargs=network,
        seed=seed,
        device=device,
    )
    with torch.no_grad():
        head = sac.actor.mu
        head.bias[0] = settings.ahead
    return sac


@contextlib.contextmanager
def even_batches() -> Iterator[None]:
    """SB3 warns of a last batch that is smaller; ours lack a few samples of thousands at most."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="(?s).*mini-batch size", category=UserWarning)
        yield


class LinearDecay:
    """Learning rate that falls from ``first`` to ``last`` as training goes on (a class, so that checkpoints can hold it)."""

    def __init__(self, first: float, last: float) -> None:
        self.first, self.last = first, last

    def __call__(self, remaining: float) -> float:
        return self.last + (self.first - self.last) * max(0.0, remaining)  # negative in a rollout that ends after the last step


def load_model(settings: Settings, checkpoint: Checkpoint, env: VecEnv, device: str) -> BaseAlgorithm:
    """The model of a checkpoint. It is SB3's own format, which holds pickles: see ``Checkpoint.require_trust``.

    Raises:
        ValueError: if it is damaged, or fits neither environment nor settings.
    """
    try:
        if isinstance(settings, PPOSettings):
            # More steps than before may bring longer rollouts in more worlds.
            changed: dict[str, Any] = {
                "n_steps": settings.rollout // env.num_envs,
                "batch_size": settings.batch_size,
            }
            with even_batches():
                return PPO.load(checkpoint.model, env=env, device=device, **changed)
        sac = SAC.load(checkpoint.model, env=env, device=device)
        sac.load_replay_buffer(checkpoint.replay_buffer)
        return sac
    except (MemoryError, OSError):
        raise
    except Exception as error:  # whatever a damaged pickle brings about
        raise ValueError(f"{checkpoint.folder} cannot be loaded ({type(error).__name__}: {error}); train anew") from error
