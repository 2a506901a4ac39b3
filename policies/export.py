"""Takes the actor out of a Stable-Baselines3 model, so that it can be saved and run without torch.

Covers what this suite trains: PPO and SAC with a multilayer perceptron on a one-dimensional observation. Exploration by
gSDE, feature extractors other than flattening, and observations normalized by a wrapper are refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tagtrack.policies.network import NetworkPolicy

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm


def from_stable_baselines3(
    model: BaseAlgorithm,
    *,
    env_id: str,
    observation_features: Sequence[str],
    action_names: Sequence[str],
    seed: int = 0,
) -> NetworkPolicy:
    """The model's actor as it is now; later training does not change the copy.

    Args:
        model: a PPO or SAC of Stable-Baselines3 with "MlpPolicy", observation (D,), action (A,) in [-1, 1].
        env_id: the environment it was trained on.
        observation_features: (D,) names, in the observation's order.
        action_names: (A,) names, in the action's order.
        seed: of the draws the copy makes when it is not deterministic.
    Raises:
        ValueError: if the model is of another kind, or the names do not fit its spaces.
        ImportError: if Stable-Baselines3 is not installed, naming the command that installs it.
    """
    try:
        from stable_baselines3 import PPO, SAC
        from torch import nn
    except ImportError as error:
        raise ImportError(
            "exporting a model needs Stable-Baselines3 and torch: pip install 'stable-baselines3>=2.7'"
        ) from error
    if not isinstance(model, (PPO, SAC)):
        raise ValueError(f"cannot export a model of {type(model).__name__}: PPO and SAC can be exported")
    _require_spaces(model)
    _require_plain_actor(model)
    actor: Any  # torch types every attribute of a module as "tensor or module"
    if isinstance(model, PPO):
        algorithm, actor = "ppo", model.policy
        body, heads = actor.mlp_extractor.policy_net, {"mean": actor.action_net}
        weights = {"log_std": _to_numpy(actor.log_std)}
    else:
        algorithm, actor = "sac", model.policy.actor
        body, heads = actor.latent_pi, {"mean": actor.mu, "log_std": actor.log_std}
        weights = {}
    layers, activations = list(body)[0::2], list(body)[1::2]
    for name, layer in [*((f"hidden.{index}", layer) for index, layer in enumerate(layers)), *heads.items()]:
        if type(layer) is not nn.Linear or layer.bias is None:
            raise ValueError(f"cannot export layer {name!r}, a {layer}: only linear layers with a bias can be exported")
        weights[f"{name}.weight"] = _to_numpy(layer.weight).T  # torch keeps (outputs, inputs)
        weights[f"{name}.bias"] = _to_numpy(layer.bias)
    policy = NetworkPolicy(
        algorithm=algorithm,
        env_id=env_id,
        observation_features=tuple(observation_features),
        action_names=tuple(action_names),
        hidden=tuple(layer.out_features for layer in layers),
        activation=_activation_name(activations),
        weights=weights,
        seed=seed,
    )
    _require_same_actions(model, policy)
    return policy


def _to_numpy(parameter: Any) -> np.ndarray:
    return parameter.detach().cpu().numpy()


def _activation_name(modules: list[Any]) -> str:
    """The name in ACTIVATIONS of the one activation that all hidden layers share; "tanh" where there is none."""
    from torch import nn

    # By repr, which shows the parameters: ELU(alpha=2.0) is another function than ELU(alpha=1.0).
    names = {
        repr(nn.Tanh()): "tanh",
        repr(nn.ReLU()): "relu",
        repr(nn.LeakyReLU()): "leaky_relu",
        repr(nn.ELU()): "elu",
        repr(nn.SiLU()): "silu",
    }
    found = {repr(module) for module in modules}
    for name in sorted(found):
        if name not in names or len(found) > 1:
            raise ValueError(f"cannot export activation {name}: use one of {', '.join(names)} throughout")
    return names[found.pop()] if found else "tanh"


def _require_spaces(model: BaseAlgorithm) -> None:
    observation: Any = model.observation_space
    action: Any = model.action_space
    if observation.shape is None or len(observation.shape) != 1:
        raise ValueError(f"cannot export a policy with observations {observation}: only a Box of shape (D,) will do")
    if action.shape is None or len(action.shape) != 1 or not (np.all(action.low == -1) and np.all(action.high == 1)):
        raise ValueError(f"cannot export a policy with actions {action}: only a Box of shape (A,) in [-1, 1] will do")
    normalizer = model.get_vec_normalize_env()
    if normalizer is not None and normalizer.norm_obs:
        raise ValueError("cannot export a policy that sees normalized observations: train without VecNormalize")


def _require_plain_actor(model: BaseAlgorithm) -> None:
    from stable_baselines3.common.torch_layers import FlattenExtractor

    actor = getattr(model.policy, "actor", model.policy)
    if actor.use_sde:
        raise ValueError("cannot export a policy that explores by gSDE: train with use_sde=False")
    if type(actor.features_extractor) is not FlattenExtractor:
        name = type(actor.features_extractor).__name__
        raise ValueError(f"cannot export a policy with features extractor {name}: train with the default one")


def _require_same_actions(model: BaseAlgorithm, policy: NetworkPolicy) -> None:
    """Raise if the copy acts otherwise than the model, as it would if a subclass of the policy computes more."""
    features = len(policy.observation_features)
    observation = np.random.default_rng(0).uniform(-1, 1, (16, features)).astype(np.float32)
    expected, _ = model.predict(observation, deterministic=True)
    action, _ = policy.predict(observation, deterministic=True)
    error = float(np.abs(action - expected).max())
    if not error < 1e-4:  # float32 sums in another order differ by about 1e-6; written so that NaN is refused too
        name = type(model.policy).__name__
        raise ValueError(f"cannot export policy class {name}: its actions differ from its network's by {error:.1e}")
