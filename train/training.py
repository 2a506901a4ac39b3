"""The training itself: Stable-Baselines3 over the batched worlds, with validation, checkpoints and a progress bar."""

from __future__ import annotations

import contextlib
import importlib.util
import signal
import sys
import time
from collections.abc import Callable
from types import FrameType

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from tqdm import tqdm

from tagtrack.envs.task import Task
from tagtrack.eval.rollout import SeedBlock, roll_out, run_seed
from tagtrack.policies.entities import EntityPolicy
from tagtrack.policies.export import from_stable_baselines3
from tagtrack.policies.files import save_policy
from tagtrack.policies.network import NetworkPolicy
from tagtrack.train.checkpoint import Progress, save_checkpoint
from tagtrack.train.course import describe_course
from tagtrack.train.entity_network import EntityActorCritic, export_entities
from tagtrack.train.run_folder import UNTRAINED, RunFolder

Tell = Callable[[int], None]  # env steps just done


class Stopped(Exception):
    """Training ends before its steps are done, between two rollouts: what has been seen is learned from."""


class Training(BaseCallback):
    """Validates at regular steps, keeps the best policy, writes checkpoints and the progress, and heeds Ctrl-C.

    Args:
        total: steps at which training ends. episodes: of each validation.
        resumed: what was done before, of a run that goes on. hold: environment steps that a decision is held for.
        watched: rollouts at first in which the actor stays as it is, and only the critic learns.
        tell: hears of the steps just done, instead of a progress bar.
    """

    def __init__(
        self, folder: RunFolder, task: Task, env_id: str, *, total: int, seed: int, episodes: int,
        resumed: Progress | None, hold: int = 1, watched: int = 0, tell: Tell | None = None,
    ) -> None:  # fmt: skip
        super().__init__()
        self.folder, self.task, self.env_id = folder, task, env_id
        self.total, self.episodes, self.hold, self.watched = total, episodes, hold, watched
        self.validation_seed = run_seed(SeedBlock.VALIDATION, seed)
        self.interval = max(1, total // 12)
        before = resumed or Progress()
        self.best_reward, self.best_error = before.best_reward, before.best_error_m
        self.seconds, self.first_step = before.seconds, before.steps
        self.validation_seconds = 0.0
        self.rows = [row for row in folder.read_progress() if int(row["steps"]) <= self.first_step] if resumed else []
        # A checkpoint is written after a validation, which resuming need not repeat.
        self.last_validation = before.steps if resumed else -1
        self.next_validation = before.steps + self.interval if resumed else 0
        if before.next_validation is not None:  # more steps may have made the intervals longer
            self.next_validation = min(self.next_validation, before.next_validation)
        self.interrupted = False
        self.episodes_ended: list[dict[str, float]] = []
        self.bar = tqdm(
            total=total,
            initial=self.first_step,
            unit=" steps",
            unit_scale=True,
            dynamic_ncols=True,
            desc="training",
            disable=None if tell is None else True,
        )
        self.tell, self.told = tell, self.first_step

    def _on_training_start(self) -> None:
        self.started = time.perf_counter() - self.seconds

    def _on_rollout_start(self) -> None:
        if isinstance(self.model.policy, EntityActorCritic):
            self.model.policy.freeze_actor(self.watched > 0)
            self.watched -= 1
        if self.num_timesteps >= self.next_validation:
            self.next_validation = self.num_timesteps + self.interval
            self.validate()
        elif self.interrupted:
            self.validate()
        else:
            self.require_finite()
        if self.interrupted:
            raise Stopped

    def _on_step(self) -> bool:
        if self.tell is None:
            self.bar.update(self.num_timesteps - self.bar.n)
        else:
            self.tell(self.num_timesteps - self.told)
            self.told = self.num_timesteps
        self.episodes_ended += [info["episode"] for info in self.locals["infos"] if "episode" in info]
        return True

    def require_finite(self) -> None:
        """Raise ValueError where learning has blown up, before SB3 draws actions from it or a checkpoint keeps it."""
        if not all(bool(torch.isfinite(parameter).all()) for parameter in self.model.policy.parameters()):
            raise ValueError(
                f"training diverged before step {self.num_timesteps:,}: weights of the network are no longer finite; take a "
                f"smaller learning_rate (--hyper). The best policy so far is in {self.folder.path}"
            )

    def policy(self) -> NetworkPolicy | EntityPolicy:
        """The policy as it is now, in numpy."""
        simulation = self.training_env.get_attr("simulation")[0]
        if isinstance(self.model.policy, EntityActorCritic):
            return export_entities(self.model, env_id=self.env_id, action_names=simulation.action_names, hold=self.hold)
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
        self.require_finite()
        self.last_validation = self.num_timesteps
        begun = time.perf_counter()
        policy = self.policy()
        if self.num_timesteps == 0:
            save_policy(self.folder.path / UNTRAINED, policy)
        record = roll_out(self.task, lambda _: policy, episodes=self.episodes, seed=self.validation_seed)
        assert record.reward is not None
        error, reward = float(record.error.mean()), float(record.reward.mean())
        if reward > self.best_reward:
            self.best_reward, self.best_error = reward, error
            save_policy(self.folder.path, policy)
        now = time.perf_counter()
        self.validation_seconds += now - begun
        seconds = now - self.started
        self.rows.append(self._row(seconds, error, reward))
        self.folder.write_progress(self.rows)
        progress = Progress(
            steps=self.num_timesteps, seconds=seconds, best_reward=self.best_reward, best_error_m=self.best_error,
            next_validation=self.next_validation,
        )  # fmt: skip
        save_checkpoint(self.folder.path, self.model, progress, describe_course(self.model))
        self.logger.record("validation/error_m", error)
        self.logger.dump(self.num_timesteps)
        self.bar.set_postfix_str(f"error {error:.2f} m, best {self.best_error:.2f} m")

    def _row(self, seconds: float, error: float, reward: float) -> dict[str, str]:
        """A row of progress.csv; the training episodes that it tells of are then forgotten."""
        training_seconds = seconds - self.seconds - self.validation_seconds
        ended, self.episodes_ended = self.episodes_ended, []
        steps = sum(episode["l"] for episode in ended)
        return {
            "steps": str(self.num_timesteps),
            "seconds": f"{seconds:.1f}",
            "steps_per_s": f"{(self.num_timesteps - self.first_step) / max(training_seconds, 1e-9):.0f}",
            "train_error_m": f"{sum(e['localization_error'] * e['l'] for e in ended) / steps:.3f}" if ended else "",
            "train_reward_per_step": f"{sum(e['r'] for e in ended) / steps:.5f}" if ended else "",
            "validation_error_m": f"{error:.3f}",
            "validation_reward_per_step": f"{reward:.5f}",
            "best_error_m": f"{self.best_error:.3f}",
        }


def make_logger(folder: RunFolder) -> Logger:
    """SB3's logger: to TensorBoard where it is installed; our own progress.csv is written by ``Training``."""
    formats: list[KVWriter] = []
    if importlib.util.find_spec("tensorboard") is not None:
        formats.append(TensorBoardOutputFormat(str(folder.path / "tensorboard")))
    return Logger(folder=str(folder.path), output_formats=formats)


def learn(model: BaseAlgorithm, training: Training) -> bool:
    """Train to the end, which must not be reached yet, or to Ctrl-C.

    The first Ctrl-C ends the rollout in hand, learns from it and saves; a second one breaks off at once.

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
        with contextlib.suppress(Stopped):
            model.learn(training.total - model.num_timesteps, callback=training, reset_num_timesteps=False)
        training.validate()
    finally:
        signal.signal(signal.SIGINT, before)
        training.bar.close()
    return not training.interrupted
