"""Environments in other processes: forked ones, many new ones at once, ones that may write nowhere, pickled functions."""

import json
import multiprocessing
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagtrack.envs.kernels import binding, compiling, turns
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import build_task
from tagtrack.envs.vector import TagTrackVectorEnv

# A kernel of ours that takes a second to compile, and whether this process compiled it or found it on disk.
SMALL = """
import numpy as np
from tagtrack.envs.kernels.action_loops import find_broken_action as kernel
kernel(np.zeros((2, 1, 2), np.float32))
print(sum(kernel.stats.cache_misses.values()))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_child_of_a_fork_steps_with_threads_of_its_own() -> None:
    simulation = Simulation(build_task("LeopardShark-v0", particles=20).scenario, 4, threads=2)
    simulation.reset(seed=3)
    simulation.step(np.zeros((4, 1, 2)))  # the threads live
    context = multiprocessing.get_context("fork")
    told = context.Queue()

    def go_on() -> None:
        simulation.step(np.ones((4, 1, 2)))
        told.put(simulation.observation.copy())
        simulation.close()

    child = context.Process(target=go_on)
    child.start()
    try:
        seen = told.get(timeout=60)
        child.join(timeout=60)
        assert child.exitcode == 0
    finally:
        child.kill()
    simulation.step(np.ones((4, 1, 2)))
    np.testing.assert_array_equal(seen, simulation.observation)
    simulation.close()


def test_of_many_new_processes_one_compiles_and_the_others_wait(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    workers = [
        subprocess.Popen(
            [sys.executable, "-c", SMALL], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(3)
    ]
    answers = [worker.communicate(timeout=300) for worker in workers]
    assert sorted(out.strip() for out, _ in answers) == ["0", "0", "1"], answers
    assert (tmp_path / "tagtrack" / turns.LOCK).exists()
    assert sum("TagTrack compiles" in errors for _, errors in answers) == 1


# Two small kernels are wanted at once: how often did this process compile each?
TWO = """
import sys
import numpy as np
import tagtrack.envs.kernels.binding as binding
from tagtrack.envs.kernels.maths import fast_exp, fast_log
binding.cores = lambda: 2
{before}
first, second = binding.bind((fast_exp, np.float32(1)), (fast_log, np.float32(1)))
print(*(sum(kernel.stats.cache_misses.values()) for kernel in (fast_exp, fast_log)))
print(round(first(np.float32(1)), 4), round(second(np.float32(2)), 4))
"""


@pytest.mark.skipif(not turns.can_lock(), reason="processes cannot take turns here")
@pytest.mark.parametrize(
    ("before", "compiled_here"),
    [
        ("", "0 1"),
        ("sys.executable = '/bin/false'", "1 1"),
        ("sys.executable = '/no/python'", "1 1"),
    ],
    ids=["helped", "helper fails", "no interpreter"],
)
def test_of_several_kernels_another_process_compiles_some(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run_python: Callable[..., str], before: str, compiled_here: str
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert run_python(TWO.format(before=before)) == f"{compiled_here}\n2.7183 0.6931\n"
    assert run_python(TWO.format(before=before)) == "0 0\n2.7183 0.6931\n"


def test_the_helping_process_ends_with_the_one_that_asks(tmp_path: Path) -> None:
    """Whoever would have waited for its turn compiles next; the helper has none of its own."""
    (tmp_path / "slow.py").write_text("import time\nclass kernel:\n    compile = staticmethod(lambda types: time.sleep(100))\n")
    helper = subprocess.Popen([sys.executable, "-c", binding._HELPER], stdin=subprocess.PIPE)
    assert helper.stdin is not None
    work = pickle.dumps([("slow", "kernel", ())]).hex()
    helper.stdin.write(f"{json.dumps([str(tmp_path), *sys.path])}\n{work}\n".encode())
    helper.stdin.close()
    assert helper.wait(timeout=60) == binding.LEFT_ALONE


def test_where_nothing_can_be_written_a_temporary_folder_holds_the_code(tmp_path: Path, run_python: Callable[..., str]) -> None:
    """A file stands where each folder would be made, which stops root as well."""
    (tmp_path / "file").write_text("")
    (tmp_path / "tmp").mkdir()
    code = f"""
import os, sys, tempfile
os.environ.update(NUMBA_CACHE_DIR={str(tmp_path / "file" / "cache")!r}, TMPDIR={str(tmp_path / "tmp")!r})
import contextlib, io
told = io.StringIO()
with contextlib.redirect_stderr(told):
    {SMALL.replace(chr(10), chr(10) + "    ")}
print([line for line in told.getvalue().splitlines() if "keeps its compiled code in" in line])
"""
    for misses in ("1", "0"):  # the next process finds it there
        out = run_python(code).splitlines()
        assert out[0] == misses and out[1].count("TagTrack cannot write to") == 1 and str(tmp_path / "tmp") in out[1]


@pytest.mark.parametrize("change", ["others may write", "a link"])
def test_temporary_folder_that_others_could_have_filled_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], change: str
) -> None:
    monkeypatch.setattr(compiling.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(compiling.tempfile, "tempdir", str(tmp_path))
    own = tmp_path / f"tagtrack-{compiling.getpass.getuser()}"
    if change == "a link":
        (tmp_path / "elsewhere").mkdir()
        own.symlink_to(tmp_path / "elsewhere")
    else:
        own.mkdir()
        own.chmod(0o777)
    found = compiling.temporary_cache.__wrapped__(Path("/nowhere"))
    assert found != own and found.parent == tmp_path and str(found) in capsys.readouterr().err


def test_joblib_and_spawned_processes_take_a_simulation() -> None:
    joblib = pytest.importorskip("joblib")
    env = TagTrackVectorEnv(num_envs=2, particles=20, threads=2)
    env.reset(seed=1)
    actions = env.action_space.sample()
    seen = joblib.Parallel(n_jobs=2, backend="loky")(joblib.delayed(_step)(env, actions) for _ in range(2))
    expected = env.step(actions)[0]
    for each in seen:
        np.testing.assert_array_equal(each, expected)
    env.close()


def _step(env: TagTrackVectorEnv, actions: np.ndarray) -> np.ndarray:
    return env.step(actions)[0]


WORKERS = """
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv

if __name__ == "__main__":  # what is imported here, workers do not import
    import tagtrack

    options = {"start_method": "forkserver"}
    make_vec_env("TagTrack/LeopardShark-v0", 2, vec_env_cls=SubprocVecEnv, vec_env_kwargs=options).close()
    print("made")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork server")
def test_workers_of_a_fork_server_know_the_ids_of_their_parent(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(WORKERS, encoding="utf-8")
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout == "made\n", done.stderr


def test_modules_that_a_user_lets_the_fork_server_import_stay() -> None:
    code = "import multiprocessing.forkserver as f; f.set_forkserver_preload(['json']); import tagtrack; "
    code += "print(f._forkserver._preload_modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "['json', 'tagtrack']\n", done.stderr
