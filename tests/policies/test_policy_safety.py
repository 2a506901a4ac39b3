"""Loading survives damage, forgery and kills, and never executes what the files hold."""

import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tagtrack.policies.files import load_policy, save_policy


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_damage_is_refused_or_harmless(make_policy, data, same_policy):
    policy = make_policy()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_policy(folder, policy)
        file = folder / data.draw(st.sampled_from(["policy.json", "policy.safetensors"]))
        content = bytearray(file.read_bytes())
        if data.draw(st.booleans(), label="truncate"):
            content = content[: data.draw(st.integers(0, len(content) - 1))]
        else:
            for place in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=4)):
                content[place] = data.draw(st.integers(0, 255))
        file.write_bytes(content)
        try:
            loaded = load_policy(folder)
        except ValueError as error:
            assert str(folder) in str(error)
            assert "\n" not in str(error)
        else:
            assert same_policy(loaded, policy)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_forged_weights_are_refused_or_finite_whatever_their_bytes(make_policy, data, rewrite_weights):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_policy(folder, make_policy())
        content = bytearray((folder / "policy.safetensors").read_bytes())
        for place in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=4)):
            content[place] = data.draw(st.integers(0, 255))
        rewrite_weights(folder, bytes(content))
        try:
            loaded = load_policy(folder)
        except ValueError as error:
            assert str(folder) in str(error)
            assert "\n" not in str(error)
        else:
            assert all(np.isfinite(array).all() for array in loaded.weights.values())


class Payload:
    """Unpickling this writes a file."""

    def __init__(self, marker):
        self.marker = marker

    def __reduce__(self):
        return (Path.touch, (Path(self.marker),))


def test_crafted_pickle_in_place_of_the_weights_is_refused_and_not_run(saved, tmp_path, refusal, rewrite_weights):
    marker = tmp_path / "executed"
    content = pickle.dumps(Payload(marker))
    rewrite_weights(saved, content)
    assert "not readable as safetensors" in refusal(saved)
    assert not marker.exists()
    pickle.loads(content)
    assert marker.exists(), "the payload must be a working one for the test to mean anything"


def start_python(program, folder):
    """A fresh interpreter outside the repository, whose own folders must not be what it imports."""
    return subprocess.Popen(
        [sys.executable, "-c", program, str(folder)],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_loading_needs_no_torch_and_executes_nothing(saved, make_policy):
    program = """
import sys
for name in ("torch", "stable_baselines3", "numba", "scipy"):
    sys.modules[name] = None  # makes importing it an ImportError
from tagtrack.policies.files import load_policy
import numpy.random  # newer numpy imports it only when it is used

def refuse(event, arguments):
    if event in ("exec", "compile", "import", "pickle.find_class", "os.system", "subprocess.Popen", "marshal.loads"):
        raise SystemExit(f"{event} {arguments}")

sys.addaudithook(refuse)
policy = load_policy(sys.argv[1])
action, _ = policy.predict(numpy.ones((1, 3), numpy.float32), deterministic=True)
print(*action[0].tolist())
"""
    with start_python(program, saved) as process:
        output, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    expected, _ = make_policy().predict(np.ones((1, 3), np.float32), deterministic=True)
    assert [float(number) for number in output.split()] == pytest.approx(expected[0].tolist())


def test_process_killed_while_saving_again_and_again_leaves_a_policy(saved, make_policy):
    program = """
import dataclasses, sys
from tagtrack.policies.files import load_policy, save_policy
policy = load_policy(sys.argv[1])
print("saving", flush=True)
while True:
    policy = dataclasses.replace(policy, weights={name: array + 1 for name, array in policy.weights.items()})
    save_policy(sys.argv[1], policy)
"""
    for seconds in (0.003, 0.017, 0.04):
        with start_python(program, saved) as process:
            assert process.stdout.readline() == "saving\n"
            time.sleep(seconds)
            assert process.poll() is None
            process.kill()
        assert load_policy(saved).hidden == make_policy().hidden
