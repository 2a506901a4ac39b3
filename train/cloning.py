"""A fleet's policy begins as a copy of a baseline: imitation, also where only the copy comes (Ross et al. 2011).

In the first round the baseline steers, in the others the copy does in half of the worlds; the baseline says each time what it
would do. What both have seen is learned by heart in between.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from tqdm import tqdm

from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.contestants import find_makers
from tagtrack.eval.rollout import SeedBlock, run_seed
from tagtrack.policies.entities import EntityPolicy
from tagtrack.policies.protocol import Policy
from tagtrack.train.entity_network import export_entities

ROUNDS = 5  # of an episode in each world
WORLDS = 48
EPOCHS = 6  # over all that was seen, after each round
BATCH = 1024


def clone_baseline(model: BaseAlgorithm, specification: str, task: Task, *, hold: int, seed: int) -> float:
    """Teach the actor of a fresh model what a baseline decides every ``hold`` steps.

    Returns:
        Half the mean squared distance between its actions and the baseline's at the end; for courses at an angle 1 - cos of it.
    """
    network: Any = model.policy
    make: Any = find_makers({specification: specification}, task, task.env_id)[specification]
    simulation = Simulation(task.scenario, WORLDS, tracks=task.tracks)
    first_seed = run_seed(SeedBlock.TRAINING, seed) + 2**30  # not those of training itself
    seen: list[tuple[torch.Tensor, torch.Tensor]] = []
    both: Any = network.mlp_extractor
    optimizer = torch.optim.Adam(both.actor.parameters(), lr=1e-3)
    generator = torch.Generator().manual_seed(seed)
    loss = float("nan")
    for number in tqdm(range(ROUNDS), desc=f"imitating {specification}", unit=" rounds", disable=None):
        copy = export_entities(model, env_id=task.env_id, action_names=simulation.action_names, hold=hold) if number else None
        seen.append(_watch(simulation, make(simulation), copy, hold, first_seed + number * WORLDS))
        loss = _learn(network, optimizer, seen, generator)
    simulation.close()
    both.twin.load_state_dict(both.actor.state_dict())
    return loss


def _watch(
    simulation: Simulation, baseline: Policy, copy: EntityPolicy | None, hold: int, seed: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """An episode of each world: (M, D) observations at which a decision is due, and (M, A) what the baseline then does."""
    simulation.reset(seed)
    shape = (simulation.num_worlds, simulation.scenario.vehicles, -1)
    own = np.zeros((*shape[:2], 1), bool)
    own[::2] = copy is not None
    state: Any = None
    held: Any = None
    observations, actions = [], []
    for step in range(simulation.scenario.episode_steps):
        rows = simulation.observation.reshape(shape[0] * shape[1], -1)
        begins = np.full(len(rows), step == 0)
        asked, state = baseline.predict(rows, state, begins, deterministic=True)
        action = asked.reshape(shape)
        if copy is not None:
            answer, held = copy.predict(rows, held, begins, deterministic=True)
            action = np.where(own, answer.reshape(shape), action)
        if step % hold == 0:
            active = simulation.worlds.navigation["active"].ravel()
            observations.append(rows[active].copy())
            actions.append(asked[active])
        simulation.step(action)
    return torch.as_tensor(np.concatenate(observations)), torch.as_tensor(np.concatenate(actions))


def _learn(network: Any, optimizer: Any, seen: list[tuple[torch.Tensor, torch.Tensor]], generator: torch.Generator) -> float:
    """Epochs over all that was seen; the last one's loss."""
    observations, actions = (torch.cat(parts).to(network.device) for parts in zip(*seen, strict=True))
    total = 0.0
    for _ in range(EPOCHS):
        order = torch.randperm(len(observations), generator=generator)
        total = 0.0
        for batch in order.split(BATCH):
            mean = network.mlp_extractor.forward_actor(observations[batch])
            loss = ((mean - actions[batch]) ** 2).sum(dim=1).mean() / 2
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total += float(loss.detach()) * len(batch)
    return total / len(observations)
