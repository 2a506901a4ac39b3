"""An ONNX graph gives what numpy gives, for every activation and both algorithms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tagtrack.live.cli import main
from tagtrack.policies.box import boxed_policy
from tagtrack.policies.files import load_policy
from tagtrack.policies.network import ACTIVATIONS, SQUASHES, NetworkPolicy, weight_shapes
from tagtrack.policies.onnx_export import save_onnx

onnx = pytest.importorskip("onnx", reason='ONNX files need onnx: pip install "tagtrack[onnx]"')


def policy_of(activation: str, algorithm: str, hidden: tuple[int, ...] = (7, 5)) -> NetworkPolicy:
    rng = np.random.default_rng(3)
    shapes = weight_shapes(features=6, hidden=hidden, actions=2, squash=SQUASHES[algorithm])
    return NetworkPolicy(
        algorithm=algorithm, env_id="TagTrack/X-v0", observation_features=tuple("abcdef"), action_names=("ahead", "port"),
        hidden=hidden, activation=activation,
        weights={name: rng.normal(0, 0.7, shape).astype(np.float32) for name, shape in shapes.items()},
    )  # fmt: skip


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("algorithm", SQUASHES)
def test_the_graph_gives_what_numpy_gives(tmp_path: Path, activation: str, algorithm: str) -> None:
    policy = policy_of(activation, algorithm)
    assert save_onnx(policy, tmp_path / "policy.onnx") < 1e-5
    model = onnx.load(tmp_path / "policy.onnx")
    told = {prop.key: prop.value for prop in model.metadata_props}
    assert told["observation_features"].split("\n") == list("abcdef") and told["env_id"] == "TagTrack/X-v0"
    rows = np.random.default_rng(1).normal(size=(5, 6)).astype(np.float32)
    from onnx.reference import ReferenceEvaluator

    (action,) = ReferenceEvaluator(model).run(None, {"observation": rows})
    np.testing.assert_allclose(action, policy.predict(rows, deterministic=True)[0], atol=1e-5)


def test_a_linear_policy_and_a_fleets(tmp_path: Path) -> None:
    assert save_onnx(policy_of("tanh", "ppo", hidden=()), tmp_path / "linear.onnx") < 1e-5
    with pytest.raises(ValueError, match="only policies of single vehicles"):
        save_onnx(load_policy(boxed_policy("LeopardShark-v0", vehicles=3)), tmp_path / "fleet.onnx")


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "--policy", "learned", "--out", str(tmp_path / "p.onnx")]) == 0
    assert "differ from numpy's by at most" in capsys.readouterr().out
    assert main(["export", "--policy", str(tmp_path), "--out", str(tmp_path / "q.onnx")]) == 2
