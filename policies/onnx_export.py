"""A learned policy as an ONNX graph, for runtimes that are not Python (extra ``onnx``)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.policies.files import replace_file
from tagtrack.policies.network import NetworkPolicy

OPSET = 17
OPERATORS = {"tanh": "Tanh", "relu": "Relu", "leaky_relu": "LeakyRelu", "elu": "Elu"}
LARGEST_DIFFERENCE = 1e-5  # of an action, that is checked


def save_onnx(policy: Any, path: str | os.PathLike[str]) -> float:
    """Write the deterministic policy as a graph from ``observation`` (B, D) to ``action`` (B, A), both float32.

    The names of features and actions are in its metadata. What it gives for 1,000 random observations is compared with numpy's.

    Returns:
        The largest difference of an action.
    Raises:
        ValueError: for a fleet's policy, or a graph that does not give the same. ImportError: without onnx.
    """
    if not isinstance(policy, NetworkPolicy):
        raise ValueError("only policies of single vehicles are written as ONNX; a fleet's runs in numpy (policies/entities.py)")
    try:
        import onnx
    except ImportError:
        raise ImportError('ONNX files need onnx: pip install "tagtrack[onnx]"') from None
    model = build_graph(policy)
    onnx.checker.check_model(model)
    difference = compare(policy, model)
    if not difference <= LARGEST_DIFFERENCE:
        raise ValueError(f"the graph differs from the policy by up to {difference:g}; nothing was written")
    with replace_file(Path(path)) as partial:
        partial.write_bytes(model.SerializeToString())
    return difference


def build_graph(policy: NetworkPolicy) -> Any:
    """The ONNX model."""
    from onnx import TensorProto, helper, numpy_helper

    nodes, constants, flow = [], [], "observation"
    layers = [*(f"hidden.{k}" for k in range(len(policy.hidden))), "mean"]
    for layer in layers:
        for part in ("weight", "bias"):
            constants.append(numpy_helper.from_array(np.ascontiguousarray(policy.weights[f"{layer}.{part}"]), f"{layer}.{part}"))
        nodes.append(helper.make_node("Gemm", [flow, f"{layer}.weight", f"{layer}.bias"], [f"{layer}.sum"]))
        flow = f"{layer}.sum"
        if layer != "mean":
            nodes += _activate(helper, policy.activation, flow, layer)
            flow = f"{layer}.out"
    if policy.squash == "tanh":
        nodes.append(helper.make_node("Tanh", [flow], ["action"]))
    else:
        constants += [numpy_helper.from_array(np.array(bound, np.float32), name) for name, bound in (("low", -1), ("high", 1))]
        nodes.append(helper.make_node("Clip", [flow, "low", "high"], ["action"]))
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["batch", len(policy.observation_features)])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["batch", len(policy.action_names)])],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=9, producer_name="tagtrack")
    told = {
        "env_id": policy.env_id,
        "observation_features": "\n".join(policy.observation_features),
        "action_names": "\n".join(policy.action_names),
    }
    helper.set_model_props(model, told)
    return model


def _activate(helper: Any, activation: str, flow: str, layer: str) -> list[Any]:
    if activation in OPERATORS:
        return [helper.make_node(OPERATORS[activation], [flow], [f"{layer}.out"])]
    gate = f"{layer}.gate"  # silu
    return [helper.make_node("Sigmoid", [flow], [gate]), helper.make_node("Mul", [flow, gate], [f"{layer}.out"])]


def compare(policy: NetworkPolicy, model: Any) -> float:
    """Largest difference of an action over random observations."""
    from onnx.reference import ReferenceEvaluator

    rows = np.random.default_rng(0).normal(0.0, 1.0, (1000, len(policy.observation_features))).astype(np.float32)
    found: Any = ReferenceEvaluator(model).run(None, {"observation": rows})
    return float(np.abs(found[0] - policy.predict(rows, deterministic=True)[0]).max())
