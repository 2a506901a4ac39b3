"""`tagtrack eval minari`: data sets for offline learning in Minari's format, of any id and policy, on this disk alone.

An episode holds observations, actions, rewards and all that the infos tell, the localization error among them.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import gymnasium
import numpy as np
import tyro
from gymnasium.vector import AutoresetMode

from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.task import build_task, full_id
from tagtrack.envs.vector import TagTrackVectorEnv
from tagtrack.eval.contestants import find_makers
from tagtrack.eval.options import EpisodeOptions
from tagtrack.eval.rivals import best_of
from tagtrack.eval.rollout import Localizer, PolicyMaker, SeedBlock, block_seed

if TYPE_CHECKING:
    from minari.data_collector.episode_buffer import EpisodeBuffer

HEURISTIC = "heuristic"
BATCH = 32  # worlds at once


@dataclass(frozen=True, kw_only=True)
class Minari:
    """Write data sets for offline reinforcement learning in Minari's format, one for each id and policy.

    MINARI_DATASETS_PATH=DIR lets Minari find them: minari.load_dataset("tagtrack/leopardshark/heuristic-v0"). Episodes are those
    of training, none that a benchmark counts. Needs pip install "tagtrack[minari]".
    """

    envs: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ID ...", help_behavior_hint="(all)")] = ()
    """Environment ids, with or without `TagTrack/`."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY ...")] = (HEURISTIC, "learned", "random")
    """heuristic is each task's best; learned comes with the package; else as for benchmark."""
    trial: EpisodeOptions = field(default_factory=lambda: EpisodeOptions(episodes=32))
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("runs/minari")
    """Folder of the data sets."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        minari = import_minari()
        os.environ["MINARI_DATASETS_PATH"] = str(self.out.resolve())
        for env_id in [full_id(each) for each in self.envs or SCENARIOS]:
            for policy in self.policies:
                name = f"tagtrack/{env_id.rpartition('/')[2].lower().removesuffix('-v0')}/{_plain_name(policy)}-v0"
                if (self.out / name).exists():
                    raise ValueError(f"{self.out / name} is there already; delete it, or choose another --out")
                try:
                    spec, maker = find_policy(policy, env_id)
                except ValueError as error:
                    if policy != "learned" or self.envs:
                        raise
                    print(f"{name}: left out ({error})")
                    continue
                episodes = list(record_episodes(env_id, maker, self.trial))
                with warnings.catch_warnings():  # that nobody is named as author, and the like
                    warnings.filterwarnings("ignore", message="`.*` is set to None", category=UserWarning)
                    data = minari.create_dataset_from_buffers(
                        name,
                        episodes,
                        env=gymnasium.make(f"tagtrack:{env_id}"),
                        algorithm_name=spec,
                        description=f"{self.trial.episodes} episodes of {env_id} under {spec}, seeds from {self.trial.seed} on",
                        data_format="hdf5",
                    )
                print(f"{name}: {data.total_episodes} episodes, {data.total_steps} steps under {spec}")


def import_minari() -> Any:
    """The library. Raises ImportError that names the extra."""
    try:
        import h5py  # noqa: F401
        import minari
    except ImportError:
        raise ImportError('data sets need Minari: pip install "tagtrack[minari]"') from None
    return minari


def _plain_name(policy: str) -> str:
    """A policy's name as Minari allows it."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", Path(policy).name).strip("-") or "policy"


def find_policy(policy: str, env_id: str) -> tuple[str, PolicyMaker]:
    """What a policy is in a task, and its maker. Raises ValueError for one that is unknown or steers no vehicle."""
    task = build_task(env_id)
    spec = best_of(task) if policy == HEURISTIC else policy
    maker = find_makers({spec: spec}, task, env_id)[spec]
    if isinstance(maker, Localizer):
        raise ValueError(f"{spec} steers no vehicle, so there are no actions to record")
    return spec, maker


def record_episodes(env_id: str, maker: PolicyMaker, trial: EpisodeOptions) -> Iterator[EpisodeBuffer]:
    """Whole episodes, one world each: K actions and rewards, K + 1 observations and infos."""
    seed = block_seed(SeedBlock.TRAINING, trial.seed)
    for first in range(0, trial.episodes, BATCH):
        worlds = min(BATCH, trial.episodes - first)
        env = TagTrackVectorEnv(env_id, worlds, threads=trial.threads, autoreset_mode=AutoresetMode.NEXT_STEP)
        yield from _record_batch(env, maker(env.simulation), seed + first)
        env.close()


def _record_batch(env: TagTrackVectorEnv, policy: Any, seed: int) -> Iterator[EpisodeBuffer]:
    from minari.data_collector.episode_buffer import EpisodeBuffer

    observation, info = env.reset(seed=seed)
    seen, told, steps = [observation], [_values(info)], []
    state, lengths = None, np.zeros(env.num_envs, int)
    while not lengths.all():
        action, state = policy.predict(observation.reshape(-1, observation.shape[-1]), state, None, True)
        action = np.asarray(action, np.float32).reshape(env.action_space.shape)  # type: ignore[arg-type]
        observation, reward, terminated, truncated, info = env.step(action)
        seen.append(observation)
        told.append(_values(info))
        steps.append((np.clip(action, -1.0, 1.0), reward, terminated, truncated))
        lengths[(terminated | truncated) & (lengths == 0)] = len(steps)
    kept = [np.stack(each) for each in zip(*steps, strict=True)]
    infos = {name: np.stack([each[name] for each in told]) for name in told[0]}
    for world, length in enumerate(lengths.tolist()):
        actions, rewards, terminations, truncations = (each[:length, world] for each in kept)
        yield EpisodeBuffer(
            id=None,
            seed=seed + world,
            observations=np.stack(seen)[: length + 1, world],
            actions=actions,
            rewards=rewards,
            terminations=terminations,
            truncations=truncations,
            infos={name: values[: length + 1, world] for name, values in infos.items()},
        )


def _values(info: dict[str, Any]) -> dict[str, np.ndarray]:
    """An info without its masks."""
    return {name: values for name, values in info.items() if not name.startswith("_")}
