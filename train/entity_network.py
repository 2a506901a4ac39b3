"""The torch twin of ``policies.entities``: what PPO trains for fleets, and the way to numpy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from tagtrack.policies.entities import EntityPolicy, find_entities


class EntityActor(nn.Module):
    """Mean action (B, A) and a summary (B, 4 W + own) for the critic, of flat observations (B, D)."""

    def __init__(self, names: tuple[str, ...], extras: int, width: int, ahead: float, by_heading: bool | None = None) -> None:
        super().__init__()
        layout = find_entities(names)
        self.own, self.tags = list(layout.own), [list(row) for row in layout.tags]
        self.mates = [list(row) for row in layout.mates]
        self.width, self.extras = width, extras
        self.by_heading = len(self.tags) > 1 if by_heading is None else by_heading
        self.bearing = (layout.tag_names.index("bearing_cos"), layout.tag_names.index("bearing_sin"))
        own, tag, mate = len(layout.own_names), len(layout.tag_names), len(layout.mate_names)
        self.layers = nn.ModuleDict(
            {
                "mate_0": nn.Linear(max(mate, 1), width),
                "mate_1": nn.Linear(width, width),
                "tag_0": nn.Linear(own + tag + 2 * width, width),
                "tag_1": nn.Linear(width, width),
                "point_0": nn.Linear(3 * width, width),
                "point_1": nn.Linear(width, 3),
            }
        )
        if extras:
            self.layers["extra"] = nn.Linear(2 * width, extras)
        for name, layer in self.layers.items():
            gain = 0.01 if name in ("point_1", "extra") else 2.0**0.5
            nn.init.orthogonal_(layer.weight, gain)  # type: ignore[arg-type]
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
        with torch.no_grad():
            head: Any = self.layers["point_1"]
            head.bias[1] = ahead  # an untrained policy pursues
        self.summary_width = 4 * width + own

    def forward(self, flat: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        own = flat[:, self.own]
        tags = torch.stack([flat[:, row] for row in self.tags], dim=1)
        team = self._team(flat)
        count = tags.shape[1]
        context = torch.cat([own, team], dim=1)
        embedded = self._layer("tag_1", self._layer("tag_0", torch.cat([tags, context[:, None].expand(-1, count, -1)], dim=2)))
        all_tags = torch.cat([embedded.mean(dim=1), embedded.amax(dim=1)], dim=1)
        beside = torch.cat([embedded, all_tags[:, None].expand(-1, count, -1)], dim=2)
        proposed = self.layers["point_1"](self._layer("point_0", beside))
        weight = torch.softmax(proposed[..., 0], dim=1)
        ahead, port = proposed[..., 1], proposed[..., 2]
        if self.by_heading:
            cos, sin = tags[..., self.bearing[0]], tags[..., self.bearing[1]]
            ahead, port = ahead * cos - port * sin, ahead * sin + port * cos
        mean = torch.stack([(weight * ahead).sum(dim=1), (weight * port).sum(dim=1)], dim=1)
        if self.extras:
            mean = torch.cat([mean, self.layers["extra"](all_tags)], dim=1)
        return mean, torch.cat([own, team, all_tags], dim=1)

    def _team(self, flat: torch.Tensor) -> torch.Tensor:
        if not self.mates:
            return flat.new_zeros((len(flat), 2 * self.width))
        mates = torch.stack([flat[:, row] for row in self.mates], dim=1)
        known = (mates[..., :1] > 0.5).float()
        embedded = self._layer("mate_1", self._layer("mate_0", mates)) * known
        return torch.cat([embedded.sum(dim=1) / known.sum(dim=1).clamp(min=1.0), embedded.amax(dim=1)], dim=1)

    def _layer(self, name: str, inputs: torch.Tensor) -> torch.Tensor:
        return torch.relu(self.layers[name](inputs))


class _ActorAndCritic(nn.Module):
    """In the place of SB3's extractor: the actor gives its mean, the critic sees the same summary and the flat observation."""

    def __init__(self, names: tuple[str, ...], extras: int, width: int, ahead: float, by_heading: bool | None) -> None:
        super().__init__()
        self.actor = EntityActor(names, extras, width, ahead, by_heading)
        self.twin = EntityActor(names, extras, width, ahead, by_heading)  # the critic's own reading of the entities
        self.critic = nn.Sequential(nn.Linear(self.twin.summary_width, width), nn.ReLU())
        self.latent_dim_pi, self.latent_dim_vf = 2 + extras, width

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        return self.actor(features)[0]

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        return self.critic(self.twin(features)[1])


class EntityActorCritic(ActorCriticPolicy):
    """SB3's Gaussian actor-critic over entities.

    Args:
        names: of the observation's features. width: of all layers. ahead: first bias of the course towards a tag.
        by_heading: whether courses are relative to the own heading; where there are several tags if None.
    """

    def __init__(
        self, *arguments: Any, names: tuple[str, ...], width: int, ahead: float, by_heading: bool | None = None, **options: Any
    ) -> None:
        self.names, self.width, self.ahead, self.by_heading = tuple(names), width, ahead, by_heading
        options |= {"net_arch": [], "ortho_init": False}
        super().__init__(*arguments, **options)

    def _build_mlp_extractor(self) -> None:
        extras = int(np.prod(self.action_space.shape or ())) - 2
        self.mlp_extractor = _ActorAndCritic(self.names, extras, self.width, self.ahead, self.by_heading)  # type: ignore[assignment]

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        self.action_net = nn.Identity()  # the actor gives the mean itself
        make_optimizer: Any = self.optimizer_class
        self.optimizer = make_optimizer(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)

    def freeze_actor(self, frozen: bool) -> None:
        """Let only the critic learn, or both."""
        actor: Any = self.mlp_extractor.actor
        for parameter in (*actor.parameters(), self.log_std):
            parameter.requires_grad_(not frozen)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        data = super()._get_constructor_parameters()
        for name in ("net_arch", "ortho_init"):
            data.pop(name)
        return {**data, "names": self.names, "width": self.width, "ahead": self.ahead, "by_heading": self.by_heading}


def export_entities(model: Any, *, env_id: str, action_names: tuple[str, ...], hold: int) -> EntityPolicy:
    """The actor as it is now, in numpy.

    Raises:
        ValueError: where the copy acts otherwise than the model.
    """
    policy: EntityActorCritic = model.policy
    layout = find_entities(policy.names)
    weights = {"log_std": policy.log_std.detach().cpu().numpy()}
    actor: Any = policy.mlp_extractor.actor
    for name, layer in actor.layers.items():
        plain = name.replace("_", ".")
        weights[f"{plain}.weight"] = layer.weight.detach().cpu().numpy().T  # torch keeps (outputs, inputs)
        weights[f"{plain}.bias"] = layer.bias.detach().cpu().numpy()
    if not layout.mate_names:
        weights["mate.0.weight"] = weights["mate.0.weight"][:0]
    copy = EntityPolicy(
        env_id=env_id,
        observation_features=policy.names,
        action_names=tuple(action_names),
        own_names=layout.own_names,
        tag_names=layout.tag_names,
        mate_names=layout.mate_names,
        width=policy.width,
        hold=hold,
        courses="heading" if actor.by_heading else "line",
        weights=weights,
    )
    rows = np.random.default_rng(0).uniform(-1, 1, (16, len(policy.names))).astype(np.float32)
    with torch.no_grad():
        expected = policy.mlp_extractor.forward_actor(torch.as_tensor(rows, device=policy.device)).cpu().numpy()
    error = float(np.abs(copy._mean(*copy._split(rows.astype(np.float64))) - expected).max())
    if not error < 1e-4:
        raise ValueError(f"the copy in numpy differs from the trained network by {error:.1e}")
    return copy
