"""Each way in which `policy.json` or `policy.safetensors` can be wrong is refused in one line that names it."""

import json

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file


@pytest.mark.parametrize(
    "content", [b"", b"{", b'{"algorithm": "ppo"', b"\xff\xfe", b"[" * 100_000, b'{"hidden": ' + b"9" * 5000 + b"}"]
)
def test_broken_json_is_refused(saved, content, refusal):
    (saved / "policy.json").write_bytes(content)
    assert "policy.json is not readable as JSON" in refusal(saved)


@pytest.mark.parametrize("content", ["[]", "null", '"ppo"', "1"])
def test_json_that_is_no_object_is_refused(saved, content, refusal):
    (saved / "policy.json").write_text(content)
    assert "must hold a JSON object" in refusal(saved)


@pytest.mark.parametrize(
    "key",
    [
        "format_version",
        "algorithm",
        "env_id",
        "observation_features",
        "action_names",
        "hidden",
        "activation",
        "squash",
        "weights_sha256",
        "previous_weights_sha256",
    ],
)
def test_missing_key_is_named(saved, key, refusal, rewrite_description):
    rewrite_description(saved, **{key: ...})
    assert f"policy.json has no {key!r}" in refusal(saved)


def test_unknown_key_is_named(saved, refusal, rewrite_description):
    rewrite_description(saved, normalizer="mean")
    assert "policy.json has an unknown key 'normalizer': remove it" in refusal(saved)


@pytest.mark.parametrize("version", [0, 2, 1.5, "1"])
def test_unknown_format_version_is_named_with_the_one_that_is_read(saved, version, refusal, rewrite_description):
    rewrite_description(saved, format_version=version)
    assert f"has format version {version!r}, this program reads 1: use the version" in refusal(saved)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"algorithm": "dqn"}, "unknown algorithm 'dqn': choose one of ppo, sac"),
        ({"activation": "__import__('os')"}, "choose one of tanh, relu, leaky_relu, elu, silu"),
        ({"squash": "tanh"}, "squash of ppo must be 'clip', got 'tanh'"),
        ({"algorithm": ["ppo"]}, "'algorithm' must be str, got list"),
        ({"format_version": True}, "'format_version' must be int, got bool"),
        ({"hidden": 5}, "'hidden' must be list, got int"),
        ({"hidden": [5, -4]}, "hidden must be a tuple of positive layer widths"),
        ({"hidden": [5, True]}, "hidden must be a tuple of positive layer widths"),
        ({"hidden": [5, 10**30]}, "must have shape"),
        ({"hidden": [5]}, "is not part of this network"),
        ({"observation_features": ["distance", 1, "silence"]}, "observation_features must be a tuple"),
        ({"observation_features": ["distance", "bearing"]}, "must have shape (2, 5), got (3, 5)"),
        ({"action_names": ["course"]}, "must have shape"),
        ({"env_id": "clear\x1b[2J"}, "env_id must be the id"),
    ],
)
def test_description_of_no_policy_is_refused(saved, changes, message, refusal, rewrite_description):
    rewrite_description(saved, **changes)
    assert message in refusal(saved)


def test_description_edited_by_hand_is_refused(saved, refusal):
    file = saved / "policy.json"
    file.write_text(file.read_text().replace("bearing", "heading"))
    assert "was changed after it was saved" in refusal(saved)


def test_truncated_weights_are_refused(saved, refusal):
    file = saved / "policy.safetensors"
    file.write_bytes(file.read_bytes()[:-1])
    assert "weights_sha256 differs" in refusal(saved)


def test_weights_with_one_number_changed_are_refused(saved, refusal):
    weights = load_file(saved / "policy.safetensors")
    weights["mean.bias"] = weights["mean.bias"] + 1
    save_file(weights, saved / "policy.safetensors")
    assert "policy.safetensors is not the file that policy.json describes" in refusal(saved)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\xff" * 64, (10).to_bytes(8, "little") + b"not a json"])
def test_weights_that_are_no_safetensors_are_refused_though_the_sum_fits(saved, content, refusal, rewrite_weights):
    rewrite_weights(saved, content)
    assert "policy.safetensors is not readable as safetensors" in refusal(saved)


@pytest.mark.parametrize("dtype", ["BF16", "F8_E4M3"])
def test_number_type_that_numpy_lacks_is_refused(saved, dtype, refusal, rewrite_weights):
    size = 4 if dtype == "BF16" else 2
    header = json.dumps({"log_std": {"dtype": dtype, "shape": [2], "data_offsets": [0, size]}}).encode()
    rewrite_weights(saved, len(header).to_bytes(8, "little") + header + bytes(size))
    assert "policy.safetensors is not readable as safetensors" in refusal(saved)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros(3, np.float32), "weight 'mean.bias' must have shape (2,), got (3,)"),
        (np.zeros((2, 1), np.float32), "weight 'mean.bias' must have shape (2,), got (2, 1)"),
        (np.zeros(2, np.float64), "weight 'mean.bias' must be float32, got float64"),
        (np.zeros(2, np.int32), "weight 'mean.bias' must be float32, got int32"),
        (np.array([0, np.nan], np.float32), "weight 'mean.bias' must be finite, got nan"),
        (np.array([-np.inf, 0], np.float32), "weight 'mean.bias' must be finite, got -inf"),
    ],
)
def test_weights_that_do_not_fit_are_named_though_the_sum_fits(saved, array, message, refusal, forge_weights):
    forge_weights(saved, **{"mean.bias": array})
    assert message in refusal(saved)


def test_surplus_weight_is_named(saved, refusal, forge_weights):
    forge_weights(saved, extra=np.zeros(1, np.float32))
    assert "weight 'extra' is not part of this network" in refusal(saved)


def test_missing_weight_is_named(saved, refusal, forge_weights):
    forge_weights(saved, log_std=...)
    assert "weight 'log_std' is missing" in refusal(saved)
