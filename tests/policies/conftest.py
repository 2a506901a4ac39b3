"""A small policy with known names and random weights, saved to disk, and ways to forge its files."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file, save

from tagtrack.policies.files import load_policy, save_policy
from tagtrack.policies.network import SQUASHES, NetworkPolicy, weight_shapes

FEATURES = ("distance", "bearing", "silence")
ACTIONS = ("course", "speed")


@pytest.fixture
def make_policy() -> Callable[..., NetworkPolicy]:
    def make(
        *,
        algorithm: str = "ppo",
        env_id: str = "TagTrack/Pond-v0",
        observation_features: tuple[str, ...] = FEATURES,
        action_names: tuple[str, ...] = ACTIONS,
        hidden: tuple[int, ...] = (5, 4),
        activation: str = "tanh",
        seed: int = 0,
        weight_seed: int = 0,
    ) -> NetworkPolicy:
        shapes = weight_shapes(
            features=len(observation_features), hidden=hidden, actions=len(action_names), squash=SQUASHES[algorithm]
        )
        generator = np.random.default_rng(weight_seed)
        return NetworkPolicy(
            algorithm=algorithm,
            env_id=env_id,
            observation_features=observation_features,
            action_names=action_names,
            hidden=hidden,
            activation=activation,
            weights={name: generator.normal(0, 0.5, shape).astype(np.float32) for name, shape in shapes.items()},
            seed=seed,
        )

    return make


@pytest.fixture
def saved(tmp_path, make_policy) -> Path:
    """A folder with a good policy."""
    save_policy(tmp_path / "run", make_policy())
    return tmp_path / "run"


@pytest.fixture
def same_policy() -> Callable[[NetworkPolicy, NetworkPolicy], bool]:
    def same(one: NetworkPolicy, other: NetworkPolicy) -> bool:
        fields = ("algorithm", "env_id", "observation_features", "action_names", "hidden", "activation")
        return all(getattr(one, name) == getattr(other, name) for name in fields) and all(
            np.array_equal(one.weights[name], other.weights[name]) for name in one.weights
        )

    return same


@pytest.fixture
def refusal() -> Callable[..., str]:
    def message_of(folder: Path, *arguments, kind: type[Exception] = ValueError, **keywords) -> str:
        """The message of loading's error, which must be one line that names the folder."""
        with pytest.raises(kind) as caught:
            load_policy(folder, *arguments, **keywords)
        message = str(caught.value)
        assert "\n" not in message
        assert str(folder) in message
        return message

    return message_of


@pytest.fixture
def rewrite_description() -> Callable[..., None]:
    def rewrite(folder: Path, **changes) -> None:
        """Forge policy.json, its own sum included; a change to `...` removes the key."""
        content = json.loads((folder / "policy.json").read_text()) | changes
        content = {key: value for key, value in content.items() if value is not ...}
        described = {key: value for key, value in content.items() if not key.endswith("_sha256")}
        content["description_sha256"] = hashlib.sha256(json.dumps(described, sort_keys=True).encode()).hexdigest()
        (folder / "policy.json").write_text(json.dumps(content))

    return rewrite


@pytest.fixture
def rewrite_weights(rewrite_description) -> Callable[[Path, bytes], None]:
    def rewrite(folder: Path, content: bytes) -> None:
        """Forge policy.safetensors and its sum in policy.json."""
        (folder / "policy.safetensors").write_bytes(content)
        rewrite_description(folder, weights_sha256=hashlib.sha256(content).hexdigest())

    return rewrite


@pytest.fixture
def forge_weights(rewrite_weights) -> Callable[..., None]:
    def forge(folder: Path, **changes: np.ndarray) -> None:
        """Add or change arrays in policy.safetensors, its sum included; a change to `...` removes the array."""
        weights = load_file(folder / "policy.safetensors") | changes
        rewrite_weights(folder, save({name: array for name, array in weights.items() if array is not ...}))

    return forge
