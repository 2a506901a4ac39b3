"""The training itself: Stable-Baselines3 over the batched worlds, with validation, checkpoints and a progress bar."""

from __future__ import annotations

import importlib.util
import signal
import sys
import time
from types import FrameType
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from stable_baselines3.common.vec_env import VecEnv
from tqdm import tqdm

from tagtrack.envs.task import Task
from tagtrack.eval.rollout import SeedBlock, block_seed, roll_out
from tagtrack.policies.export import from_stable_baselines3
from tagtrack.policies.files import save_policy
from tagtrack.policies.network import NetworkPolicy
from tagtrack.train.config import PPOSettings, Settings
from tagtrack.train.run_folder import RunFolder


def build_model(settings: Settings, env: VecEnv, seed: int, device: str) -> BaseAlgorithm:
    """A fresh PPO or SAC whose untrained policy steers straight for the belief (pursuit)."""
    network = {"net_arch": [settings.width, settings.width], "activation_fn": torch.nn.ReLU}  # a third faster than tanh here
    if isinstance(settings, PPOSettings):
        rollout_steps = max(1, settings.rollout // env.num_envs)
        first, last = settings.learning_rate, 0.1 * settings.learning_rate
        ppo = PPO(
            "MlpPolicy",
            env,
            n_steps=rollout_steps,
            batch_size=min(settings.batch_size, rollout_steps * env.num_envs),
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


class LinearDecay:
    """Learning rate that falls from ``first`` to ``last`` as training goes on (a class, so that checkpoints can hold it)."""

    def __init__(self, first: float, last: float) -> None:
        self.first, self.last = first, last

    def __call__(self, remaining: float) -> float:
        return self.last + (self.first - self.last) * remaining


def load_model(settings: Settings, path: Any, env: VecEnv, device: str) -> BaseAlgorithm:
    """The model of a checkpoint. It is SB3's own format, which holds pickles: only for runs one trusts."""
    if isinstance(settings, PPOSettings):
        return PPO.load(path / "model.zip", env=env, device=device)
    model = SAC.load(path / "model.zip", env=env, device=device)
    model.load_replay_buffer(path / "replay_buffer.pkl")
    return model


class Training(BaseCallback):
    """Validates at regular steps, keeps the best policy, writes checkpoints and the progress, and heeds Ctrl-C."""

    def __init__(
        self, folder: RunFolder, task: Task, env_id: str, *, total: int, seed: int, episodes: int, state: dict[str, Any]
    ) -> None:
        super().__init__()
        self.folder, self.task, self.env_id = folder, task, env_id
        self.total, self.episodes = total, episodes
        self.validation_seed = block_seed(SeedBlock.VALIDATION, seed)
        self.interval = max(1, total // 12)
        self.best_reward: float = state.get("best_reward", -np.inf)
        self.best_error: float = state.get("best_error_m", np.inf)
        self.seconds: float = state.get("seconds", 0.0)
        self.validation_seconds = 0.0
        self.first_step: int = state.get("steps", 0)
        self.rows = [row for row in folder.read_progress() if int(row["steps"]) <= self.first_step]
        self.next_validation = self.first_step + self.interval if self.first_step else 0
        self.last_validation = -1
        self.interrupted = False

    def _on_training_start(self) -> None:
        self.started = time.perf_counter() - self.seconds
        self.bar = tqdm(
            total=self.total, initial=self.first_step, unit=" steps", unit_scale=True, dynamic_ncols=True, desc="training"
        )
        self.errors: list[float] = []
        self.rewards: list[float] = []

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self.next_validation:
            self.validate()
            self.next_validation = self.num_timesteps + self.interval

    def _on_step(self) -> bool:
        self.bar.update(self.num_timesteps - self.bar.n)
        for info in self.locals["infos"]:
            if "episode" in info:
                self.errors.append(info["episode"]["localization_error"])
                self.rewards.append(info["episode"]["r"])
        return not self.interrupted

    def policy(self) -> NetworkPolicy:
        """The policy as it is now, in numpy."""
        simulation = self.training_env.get_attr("simulation")[0]
        return from_stable_baselines3(
            self.model,
            env_id=self.env_id,
            observation_features=tuple(feature.name for feature in simulation.features),
            action_names=simulation.action_names,
        )

    def validate(self) -> None:
        """Roll out the policy on the validation episodes; keep it if its reward is the best; write checkpoint and progress."""
        if self.num_timesteps == self.last_validation:
            return
        self.last_validation = self.num_timesteps
        begun = time.perf_counter()
        policy = self.policy()
        record = roll_out(self.task, lambda _: policy, episodes=self.episodes, seed=self.validation_seed)
        assert record.reward is not None
        error, reward = float(record.error.mean()), float(record.reward.mean())
        if reward > self.best_reward:
            self.best_reward, self.best_error = reward, error
            save_policy(self.folder.path, policy)
        now = time.perf_counter()
        self.validation_seconds += now - begun
        seconds = now - self.started
        done = self.num_timesteps - self.first_step
        training_seconds = seconds - self.seconds - self.validation_seconds
        row = {
            "steps": str(self.num_timesteps),
            "seconds": f"{seconds:.1f}",
            "steps_per_s": f"{done / max(training_seconds, 1e-9):.0f}",  # of training alone; "seconds" counts all
            "train_error_m": f"{np.mean(self.errors):.3f}" if self.errors else "",
            "train_reward": f"{np.mean(self.rewards):.3f}" if self.rewards else "",
            "validation_error_m": f"{error:.3f}",
            "validation_reward": f"{reward:.5f}",
            "best_error_m": f"{self.best_error:.3f}",
        }
        self.errors, self.rewards = [], []
        self.rows.append(row)
        self.folder.write_progress(self.rows)
        state = {
            "steps": self.num_timesteps,
            "seconds": seconds,
            "best_reward": self.best_reward,
            "best_error_m": self.best_error,
        }
        self.folder.save_checkpoint(self.model, state)
        self.logger.record("validation/error_m", error)
        self.logger.dump(self.num_timesteps)
        self.bar.set_postfix_str(f"error {error:.2f} m, best {self.best_error:.2f} m")


def make_logger(folder: RunFolder) -> Logger:
    """SB3's logger: to TensorBoard where it is installed; our own progress.csv is written by ``Training``."""
    formats: list[KVWriter] = []
    if importlib.util.find_spec("tensorboard") is not None:
        formats.append(TensorBoardOutputFormat(str(folder.path / "tensorboard")))
    return Logger(folder=str(folder.path), output_formats=formats)


def learn(model: BaseAlgorithm, training: Training) -> bool:
    """Train to the end or to Ctrl-C. The first Ctrl-C ends the step in hand and saves; a second one breaks off at once.

    Returns:
        Whether training came to its end.
    """

    def stop(number: int, frame: FrameType | None) -> None:
        if training.interrupted:
            raise KeyboardInterrupt
        training.interrupted = True
        print("\nstopping after this update; Ctrl-C again to break off at once", file=sys.stderr)

    before = signal.signal(signal.SIGINT, stop)
    try:
        remaining = training.total - model.num_timesteps
        if remaining > 0:
            model.learn(remaining, callback=training, reset_num_timesteps=False)
        training.validate()
    finally:
        signal.signal(signal.SIGINT, before)
        if hasattr(training, "bar"):
            training.bar.close()
    return not training.interrupted
