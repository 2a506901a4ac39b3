"""What is saved is what is loaded; what is missing or made for another environment is named."""

import hashlib
import json
import os

import numpy as np
import pytest
from safetensors.numpy import load_file

from tagtrack.policies.files import load_policy, save_policy

OBSERVATION = np.random.default_rng(0).normal(size=(9, 3)).astype(np.float32)


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
@pytest.mark.parametrize("hidden", [(), (7,), (5, 4)])
@pytest.mark.parametrize("activation", ["tanh", "silu"])
def test_loaded_policy_is_the_saved_one(tmp_path, make_policy, algorithm, hidden, activation, same_policy):
    policy = make_policy(algorithm=algorithm, hidden=hidden, activation=activation, seed=3)
    save_policy(tmp_path / "new" / "run", policy)
    loaded = load_policy(tmp_path / "new" / "run", seed=3)
    assert same_policy(policy, loaded)
    np.testing.assert_array_equal(policy.predict(OBSERVATION)[0], loaded.predict(OBSERVATION)[0])


def test_folder_holds_two_files_that_other_tools_read(saved, make_policy):
    assert sorted(os.listdir(saved)) == ["policy.json", "policy.safetensors"]
    description = json.loads((saved / "policy.json").read_text())
    assert description["format_version"] == 1
    assert description["algorithm"] == "ppo"
    assert description["env_id"] == "TagTrack/Pond-v0"
    assert description["observation_features"] == ["distance", "bearing", "silence"]
    assert description["action_names"] == ["course", "speed"]
    assert description["hidden"] == [5, 4]
    assert description["activation"] == "tanh"
    assert description["squash"] == "clip"
    content = (saved / "policy.safetensors").read_bytes()
    assert description["weights_sha256"] == hashlib.sha256(content).hexdigest()
    assert load_file(saved / "policy.safetensors").keys() == make_policy().weights.keys()


def test_saving_again_replaces_the_policy(saved, make_policy, same_policy):
    policy = make_policy(algorithm="sac", weight_seed=1)
    save_policy(saved, policy)
    assert same_policy(load_policy(saved), policy)


@pytest.mark.parametrize("killed_at", [1, 2])
def test_save_killed_at_either_rename_leaves_the_old_policy(saved, make_policy, monkeypatch, killed_at, same_policy):
    renames = []

    def rename_until_killed(source, target):
        renames.append(target)
        if len(renames) >= killed_at:
            raise KeyboardInterrupt
        os.rename(source, target)

    monkeypatch.setattr("tagtrack.policies.files.os.replace", rename_until_killed)
    with pytest.raises(KeyboardInterrupt):
        save_policy(saved, make_policy(weight_seed=1))
    monkeypatch.undo()
    assert same_policy(load_policy(saved), make_policy())
    assert sorted(os.listdir(saved)) == ["policy.json", "policy.safetensors"]
    # ... and the next save is as safe: the old weights are still the ones a kill would leave.
    save_policy(saved, make_policy(weight_seed=2))
    assert same_policy(load_policy(saved), make_policy(weight_seed=2))


def test_other_policy_s_weights_are_not_taken_for_an_interrupted_save(saved, make_policy, refusal):
    old_weights = (saved / "policy.safetensors").read_bytes()
    save_policy(saved, make_policy(env_id="TagTrack/Lake-v0", weight_seed=1))
    (saved / "policy.safetensors").write_bytes(old_weights)
    assert "weights_sha256 differs" in refusal(saved)


def test_folder_that_does_not_exist_is_named(tmp_path, refusal):
    assert "is not a folder: give the folder of a run" in refusal(tmp_path / "typo", kind=FileNotFoundError)


def test_file_in_place_of_a_folder_is_named(saved, refusal):
    assert "is not a folder" in refusal(saved / "policy.json", kind=FileNotFoundError)


@pytest.mark.parametrize("name", ["policy.json", "policy.safetensors"])
def test_folder_without_policy_is_named(saved, name, refusal):
    (saved / name).unlink()
    assert f"holds no policy ({name} is missing)" in refusal(saved, kind=FileNotFoundError)


def test_policy_for_another_observation_is_refused_with_both_ids_and_the_first_difference(saved, refusal):
    message = refusal(saved, ("distance", "range_rate", "silence"), env_id="TagTrack/Lake-v0")
    assert (
        "trained on 'TagTrack/Pond-v0', where observation 1 is 'bearing'; TagTrack/Lake-v0 has 'range_rate'" in message
    )
    assert "use a policy trained on TagTrack/Lake-v0" in message


@pytest.mark.parametrize(
    ("features", "message"),
    [
        (("distance", "bearing"), "observation 2 is 'silence'; this environment has nothing there"),
        (("distance", "bearing", "silence", "speed"), "observation 3 is nothing; this environment has 'speed' there"),
        (("bearing", "distance", "silence"), "observation 0 is 'distance'; this environment has 'bearing' there"),
    ],
)
def test_layout_that_is_shorter_or_longer_or_in_another_order_is_refused(saved, features, message, refusal):
    assert message in refusal(saved, features)


def test_policy_for_other_actions_is_refused(saved, refusal):
    message = refusal(saved, action_names=("course",))
    assert "action 1 is 'speed'; this environment has nothing there" in message


def test_policy_runs_on_another_environment_of_the_same_layout(saved, make_policy, same_policy):
    loaded = load_policy(saved, ["distance", "bearing", "silence"], action_names=["course", "speed"], env_id="Other-v0")
    assert same_policy(loaded, make_policy())
