"""A fleet's policy begins as another: a baseline, or a run's policy, of a smaller fleet (a curriculum) or in easier water."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.task import Task
from tagtrack.eval.contestants import BASELINES, is_baseline
from tagtrack.policies.box import LEARNED, boxed_policy
from tagtrack.policies.entities import EntityPolicy, find_entities
from tagtrack.policies.files import load_policy
from tagtrack.train.cloning import clone_baseline
from tagtrack.train.entity_network import EntityActorCritic


def start_as(model: BaseAlgorithm, other: str, task: Task, *, hold: int, seed: int) -> None:
    """Let a fresh model begin as a baseline, or as the policy of a run. Raises ValueError where it cannot."""
    if not isinstance(model.policy, EntityActorCritic):
        raise ValueError(f"--start {other}: only PPO of fleets begins as another; drop it, or add --vehicles")
    if other == LEARNED:
        other = str(boxed_policy(task.env_id, vehicles=task.scenario.vehicles, tags=task.scenario.targets))
    if is_baseline(other):
        clone_baseline(model, other, task, hold=hold, seed=seed)
    elif Path(other).is_dir():
        start_from(model, Path(other), task)
    else:
        raise ValueError(f"--start {other}: is neither a baseline ({', '.join(BASELINES)}) nor the folder of a run")


def start_from(model: BaseAlgorithm, folder: Path, task: Task) -> None:
    """Give a fresh model the actor of a fleet's policy; its critic, which no policy file holds, reads entities as that does.

    Raises:
        FileNotFoundError: where there is no policy. ValueError: where it is of a single vehicle, another task or width.
    """
    network: Any = model.policy
    names = feature_names(task.scenario)
    policy = load_policy(folder, names, action_names=action_names(task.scenario), env_id=task.env_id)
    if not isinstance(policy, EntityPolicy):
        raise ValueError(f"--start {folder}: holds the policy of a single vehicle, not of a fleet")
    if policy.width != network.width:
        raise ValueError(f"--start {folder}: its layers are {policy.width} wide; add --hyper width={policy.width}")
    layout = find_entities(names)
    for kind, own, told in (
        ("vehicles", policy.own_names, layout.own_names),
        ("tags", policy.tag_names, layout.tag_names),
        ("teammates", policy.mate_names, layout.mate_names),
    ):
        if own != told:
            raise ValueError(f"--start {folder}: was trained with {kind} that are described otherwise; begin with another run")
    for part in (network.mlp_extractor.actor, network.mlp_extractor.twin):
        _copy_layers(policy, part)


def _copy_layers(policy: EntityPolicy, part: Any) -> None:
    with torch.no_grad():
        for name, layer in part.layers.items():
            plain = name.replace("_", ".")
            weight = torch.as_tensor(policy.weights[f"{plain}.weight"].T.copy(), device=layer.weight.device)
            if weight.shape == layer.weight.shape:  # without teammates theirs is a single unused input
                layer.weight.copy_(weight)
            layer.bias.copy_(torch.as_tensor(policy.weights[f"{plain}.bias"].copy(), device=layer.bias.device))
