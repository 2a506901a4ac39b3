"""A learned policy as a multilayer perceptron that needs numpy alone, so that a vehicle can run it without torch.

It is the actor of PPO (a Gaussian with one log standard deviation an action, clipped to the action's bounds) or of SAC
(a Gaussian whose log standard deviation depends on the observation, squashed by tanh). Critics are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

SQUASHES = {"ppo": "clip", "sac": "tanh"}  # algorithm -> how its Gaussian is brought into [-1, 1]

ACTIVATIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0),
    "leaky_relu": lambda x: np.maximum(x, np.float32(0.01) * x),
    "elu": lambda x: np.where(x > 0, x, np.expm1(np.minimum(x, 0))),
    # By tanh, because exp(-x) overflows in float32 below -88.
    "silu": lambda x: np.float32(0.5) * x * (1 + np.tanh(np.float32(0.5) * x)),
}

# SAC's actor is trained with its log standard deviation held between these (Haarnoja et al. 2018, their code).
LOG_STD_MIN, LOG_STD_MAX = -20.0, 2.0


def weight_shapes(*, features: int, hidden: tuple[int, ...], actions: int, squash: str) -> dict[str, tuple[int, ...]]:
    """Name and shape of each weight array; matrices are (inputs, outputs), for `observation @ weight + bias`."""
    widths = (features, *hidden)
    shapes: dict[str, tuple[int, ...]] = {}
    for layer, (inputs, outputs) in enumerate(zip(widths, hidden, strict=False)):
        shapes[f"hidden.{layer}.weight"] = (inputs, outputs)
        shapes[f"hidden.{layer}.bias"] = (outputs,)
    shapes["mean.weight"] = (widths[-1], actions)
    shapes["mean.bias"] = (actions,)
    if squash == "tanh":
        shapes["log_std.weight"] = (widths[-1], actions)
        shapes["log_std.bias"] = (actions,)
    else:
        shapes["log_std"] = (actions,)
    return shapes


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkPolicy:
    """The actor of PPO or SAC; memoryless, so its state is None.

    Raises:
        ValueError: if a field, or a weight's name, shape, type or value, does not fit the others.
    """

    algorithm: str  # a key of SQUASHES
    env_id: str  # the environment it was trained on
    observation_features: tuple[str, ...]  # (D,) names, in the observation's order
    action_names: tuple[str, ...]  # (A,) names, in the action's order
    hidden: tuple[int, ...]  # widths of the hidden layers; empty: a linear policy
    activation: str  # a key of ACTIVATIONS
    weights: Mapping[str, np.ndarray] = field(repr=False)  # float32, as `weight_shapes` says; copied
    seed: int = 0  # of the draws made when not deterministic
    _layers: tuple[tuple[np.ndarray, np.ndarray], ...] = field(init=False, repr=False)
    _generator: np.random.Generator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        _require_choice("algorithm", self.algorithm, SQUASHES)
        _require_choice("activation", self.activation, ACTIVATIONS)
        if not _is_name(self.env_id):
            raise ValueError(f"env_id must be the id of an environment, got {self.env_id!r}")
        _require_names("observation_features", self.observation_features)
        _require_names("action_names", self.action_names)
        if not isinstance(self.hidden, tuple) or not all(type(width) is int and width > 0 for width in self.hidden):
            raise ValueError(f"hidden must be a tuple of positive layer widths, got {self.hidden!r}")
        shapes = weight_shapes(
            features=len(self.observation_features),
            hidden=self.hidden,
            actions=len(self.action_names),
            squash=self.squash,
        )
        require_weights(self.weights, shapes)
        weights = {name: np.array(self.weights[name], order="C") for name in shapes}
        for array in weights.values():
            array.setflags(write=False)
        layers = tuple(
            (weights[f"{name}.weight"].astype(np.float64), weights[f"{name}.bias"].astype(np.float64))
            for name in (*(f"hidden.{layer}" for layer in range(len(self.hidden))), "mean")
        )
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "_layers", layers)
        object.__setattr__(self, "_generator", np.random.default_rng(self.seed))

    @property
    def squash(self) -> str:
        """How an action is brought into [-1, 1]: "clip" or "tanh"."""
        return SQUASHES[self.algorithm]

    def predict(
        self,
        observation: np.ndarray,
        state: Any = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = False,
    ) -> tuple[np.ndarray, None]:
        """The mean action, or a draw from the policy's own generator; as `Policy.predict` says.

        Sums are float64 and the action is rounded to float32 at the end, because a sum in float32 depends on the size of the
        batch in its last digits, and a particle filter soon turns a last digit into another episode.

        Raises:
            ValueError: if the observation has another shape, or is NaN or infinite somewhere (the feature is named).
        """
        latent = self._checked_rows(observation)
        activate = ACTIVATIONS[self.activation]
        *hidden, (mean_weight, mean_bias) = self._layers
        for weight, bias in hidden:
            latent = activate(latent @ weight + bias)
        action = latent @ mean_weight + mean_bias
        if not deterministic:
            action += np.exp(self._log_std(latent)) * self._generator.standard_normal(action.shape)
        action = (np.tanh(action) if self.squash == "tanh" else np.clip(action, -1, 1)).astype(np.float32)
        return (action[0] if np.ndim(observation) == 1 else action), None

    def _log_std(self, latent: np.ndarray) -> np.ndarray:
        """(A,) or (B, A) log standard deviation before the squash."""
        if self.squash == "clip":
            return self.weights["log_std"]
        log_std = latent @ self.weights["log_std.weight"] + self.weights["log_std.bias"]
        return np.clip(log_std, LOG_STD_MIN, LOG_STD_MAX)

    def _checked_rows(self, observation: np.ndarray) -> np.ndarray:
        """(B, D) float64 rows of a (B, D) or (D,) observation."""
        rows = np.asarray(observation, dtype=np.float64)
        features = len(self.observation_features)
        if rows.ndim not in (1, 2) or rows.shape[-1] != features:
            raise ValueError(
                f"observation has shape {rows.shape}, but the policy trained on {self.env_id} "
                f"takes (B, {features}) or ({features},)"
            )
        rows = np.atleast_2d(rows)
        finite = np.isfinite(rows)
        if not finite.all():
            world, feature = (int(index) for index in np.argwhere(~finite)[0])
            raise ValueError(
                f"observation feature {feature} ({self.observation_features[feature]!r}) of world {world} "
                f"is {rows[world, feature]}: a policy needs finite observations"
            )
        return rows


def _require_choice(name: str, value: Any, choices: Mapping[str, Any]) -> None:
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"unknown {name} {value!r}: choose one of {', '.join(choices)}")


def _is_name(value: Any) -> bool:
    """True for text that can stand in a one-line message."""
    return isinstance(value, str) and value != "" and value.isprintable()


def _require_names(name: str, values: Any) -> None:
    if not isinstance(values, tuple) or not values or not all(_is_name(value) for value in values):
        raise ValueError(f"{name} must be a tuple of one or more names, got {values!r}")
    if len(set(values)) < len(values):
        twice = next(value for value in values if values.count(value) > 1)
        raise ValueError(f"{name} must differ from each other, got {twice!r} twice")


def require_weights(weights: Mapping[str, np.ndarray], shapes: dict[str, tuple[int, ...]]) -> None:
    for name in shapes:
        if name not in weights:
            raise ValueError(f"weight {name!r} is missing")
    for name in weights:
        if name not in shapes:
            raise ValueError(f"weight {name!r} is not part of this network")
    for name, shape in shapes.items():
        array = weights[name]
        if array.dtype != np.float32:
            raise ValueError(f"weight {name!r} must be float32, got {array.dtype}")
        if array.shape != shape:
            raise ValueError(f"weight {name!r} must have shape {shape}, got {array.shape}")
        finite = np.isfinite(array)
        if not finite.all():
            raise ValueError(f"weight {name!r} must be finite, got {array[~finite][0]}")
