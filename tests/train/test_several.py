"""`train --seeds`: the runs are what single ones come to, and what is finished or begun is not lost."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from tagtrack.train import session
from tests.train.conftest import SMALL, rows_in, steps_in

STEPS = ("--steps", "64", "--hyper", "rollout=32")
WITHOUT_TIMES = ("steps", "train_error_m", "validation_error_m", "best_error_m")


def contents(run: Path) -> dict[str, object]:
    """All that a run comes to, but for what tells of time or place."""
    files = ("policy.safetensors", "untrained/policy.safetensors", "table.md")
    course = [[row[name] for name in WITHOUT_TIMES] for row in rows_in(run)]
    return {**{name: (run / name).read_bytes() for name in files}, "course": course}


@pytest.fixture(scope="module")
def single(tmp_path_factory) -> Path:
    """Two runs that were trained one by one."""
    folder = tmp_path_factory.mktemp("single")
    for seed in ("0", "1"):
        command = [sys.executable, "-m", "tagtrack.train", *SMALL, *STEPS, "--seed", seed, "--out", f"seed{seed}"]
        done = subprocess.run(command, cwd=folder, env=os.environ, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.parametrize("processes", ["1", "2"])
def test_seeds_are_the_runs_that_single_commands_train(train, tmp_path, single, processes):
    status, out, _ = train(*SMALL, *STEPS, "--seeds", "0", "1", "--processes", processes, "--out", "both")
    assert status == 0
    for name in ("seed0", "seed1"):
        assert contents(tmp_path / "both" / name) == contents(single / name)
        assert json.loads((tmp_path / "both" / name / "config.json").read_text())["out"] == f"both/{name}"
    assert "learned is 2 training runs" in " ".join(out.split())
    assert "--policies three_step learned=both/seed0,both/seed1" in out
    told = {"seed0", "seed1", "seed0.log", "seed1.log", "table.md", "learning_curves.png"}
    assert {path.name for path in (tmp_path / "both").iterdir()} == told
    assert "trained 64 steps" in (tmp_path / "both/seed1.log").read_text()


def test_the_same_command_trains_only_what_is_not_finished(train, tmp_path, single, monkeypatch):
    shutil.copytree(single / "seed0", tmp_path / "both/seed0")
    half = tmp_path / "both/.learning_curves.0123456789abcdef.png"
    half.write_bytes(b"what a kill has left")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "both/seed0").rglob("*") if path.name != ".lock"}
    status, out, _ = train(*SMALL, *STEPS, "--seeds", "0", "1", "--processes", "1", "--out", "both")
    assert status == 0 and out.startswith("trained before: seed0\n")
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert not half.exists()
    assert contents(tmp_path / "both/seed1") == contents(single / "seed1")
    seeds = ("--seeds", "1", "0")
    assert train(*SMALL, *STEPS, *seeds, "--out", "both")[1].startswith("trained before: seed1, seed0\n")


def test_a_run_that_was_cut_off_goes_on_and_comes_to_the_same(train, tmp_path, single, monkeypatch):
    learn = session.learn

    def break_off(model, training):
        training._on_rollout_start = lambda whole=training._on_rollout_start: (whole(), training.rows[1:] and interrupt())[0]
        return learn(model, training)

    def interrupt():
        raise KeyboardInterrupt

    monkeypatch.setattr(session, "learn", break_off)
    status, _, error = train(*SMALL, *STEPS, "--seeds", "0", "1", "--processes", "1", "--out", "both")
    assert (status, error) == (130, "\nbroken off; the same command again goes on with what was saved\n")
    assert not (tmp_path / "both/seed1").exists(), "Ctrl-C ends all, not one"
    assert 0 < len(steps_in(tmp_path / "both/seed0")) < len(steps_in(single / "seed0"))
    monkeypatch.setattr(session, "learn", learn)
    assert train(*SMALL, *STEPS, "--seeds", "0", "1", "--processes", "1", "--out", "both")[0] == 0
    for name in ("seed0", "seed1"):
        assert contents(tmp_path / "both" / name) == contents(single / name)


def test_a_run_that_fails_is_told_and_costs_no_other(train, tmp_path):
    (tmp_path / "both/seed0").mkdir(parents=True)
    (tmp_path / "both/seed0/thesis.tex").touch()
    status, out, _ = train(*SMALL, *STEPS, "--seeds", "0", "1", "--processes", "1", "--out", "both")
    assert status == 2
    assert "seed0: error: --out both/seed0 exists and is not a run" in out and "both/seed0.log" in out
    assert (tmp_path / "both/seed1/table.md").is_file() and not (tmp_path / "both/table.md").exists()


def test_a_folder_of_other_runs_is_refused_before_anything_runs(train, tmp_path, single):
    shutil.copytree(single / "seed0", tmp_path / "both/seed0")
    status, _, error = train(*SMALL, *STEPS, "--hyper", "gamma=0.9", "--seeds", "1", "0", "--out", "both")
    assert status == 2 and not (tmp_path / "both/seed1").exists()
    assert "both/seed0 was trained with hyper=['rollout=32'], not ['rollout=32', 'gamma=0.9']; choose another --out" in error


def test_a_single_run_gets_no_others_into_its_folder_and_those_below_are_named(train, tmp_path, single):
    shutil.copytree(single / "seed0", tmp_path / "runs/one")
    status, _, error = train(*SMALL, *STEPS, "--seeds", "0", "1", "--out", "runs/one")
    assert status == 2 and "--out runs/one holds a run;" in error and not list((tmp_path / "runs/one").glob("seed*"))
    status, _, error = train("--resume", "runs")
    assert status == 2 and "--resume runs/one with one" in error and error.count("\n") == 1


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="no folder here that refuses root as well")
@pytest.mark.parametrize("seeds", [(), ("--seeds", "0", "1")], ids=["one", "several"])
def test_a_place_that_cannot_be_is_refused_before_anything_runs(train, tmp_path, seeds):
    status, _, error = train(*SMALL, *STEPS, *seeds, "--out", "/proc/mine")
    assert status == 2 and "--out /proc/mine cannot be written (/proc: " in error
    (tmp_path / "file").write_text("")
    status, _, error = train(*SMALL, *STEPS, *seeds, "--out", "file")
    assert status == 2 and "--out file is a file; choose a folder" in error


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--seeds", "1", "1"), "--seeds must be different ones, got 1 1"),
        (("--seeds", "1", "2", "--seed", "3"), "--seeds goes without --seed and --resume"),
        (("--processes", "2"), "--engine, --processes and --address go with --seeds"),
        (("--seeds", "1", "-2"), "seed must be from 0"),
    ],
)
def test_what_makes_no_sense_is_refused(train, tmp_path, words, complaint):
    status, _, error = train(*SMALL, *STEPS, *words, "--out", "both")
    assert status == 2 and complaint in error
    assert not (tmp_path / "both").exists()


def test_ctrl_c_lets_the_processes_save_what_they_have(tmp_path):
    words = [*SMALL, "--steps", "1e6", "--hyper", "rollout=64", "--seeds", "0", "1", "--processes", "2", "--out", "both"]
    running = subprocess.Popen(
        [sys.executable, "-m", "tagtrack.train", *words], cwd=tmp_path, env=os.environ, stderr=subprocess.PIPE, text=True
    )
    runs = [tmp_path / "both" / name for name in ("seed0", "seed1")]
    until = time.monotonic() + 120
    while time.monotonic() < until and not all(steps_in(run) for run in runs):
        time.sleep(0.1)
    running.send_signal(signal.SIGINT)
    _, error = running.communicate(timeout=120)
    assert running.returncode == 130 and error.endswith("broken off; the same command again goes on with what was saved\n")
    for run in runs:
        assert "go on with" in run.with_name(f"{run.name}.log").read_text()
        assert steps_in(run)[-1] == json.loads((run / "checkpoint/latest.json").read_text())["steps"]


@pytest.mark.skipif(shutil.which("pgrep") is None, reason="there is no pgrep to find the processes by")
def test_a_process_that_is_killed_costs_no_run(tmp_path):
    """With one process of the pool all end; the runs that they were at go on from their checkpoints."""
    words = [*SMALL, "--steps", "4096", "--hyper", "rollout=64", "--seeds", "0", "1", "--processes", "2", "--out", "both"]
    running = subprocess.Popen([sys.executable, "-m", "tagtrack.train", *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    runs = [tmp_path / "both" / name for name in ("seed0", "seed1")]
    until = time.monotonic() + 120
    while time.monotonic() < until and not all(steps_in(run) for run in runs):
        time.sleep(0.05)
    assert not (runs[0] / "table.md").exists()
    children = subprocess.run(["pgrep", "-P", str(running.pid), "-f", "spawn_main"], capture_output=True, text=True)
    os.kill(int(children.stdout.split()[0]), signal.SIGKILL)
    _, error = running.communicate(timeout=240)
    assert running.returncode == 0, error
    for run in runs:
        assert steps_in(run)[-1] == 4096 and steps_in(run) == sorted(set(steps_in(run))) and (run / "table.md").is_file()


def test_files_that_stand_where_a_run_would_be_taken_in_stay(train, tmp_path):
    (tmp_path / "both/seed1").mkdir(parents=True)
    (tmp_path / "both/seed1/thesis.txt").write_text("years of work")
    status, _, error = train(*SMALL, *STEPS, "--seeds", "0", "1", "--engine", "ray", "--out", "both")
    assert status == 2 and "seed1 holds files and no run; choose another --out" in error
    assert (tmp_path / "both/seed1/thesis.txt").read_text() == "years of work"


class Killing:
    """A progress bar that ends a node of a cluster once every run has got going."""

    def __init__(self, runs: int, kill) -> None:
        self.runs, self.kill, self.begun = runs, kill, set()

    def __call__(self, total):
        return self

    def __enter__(self):
        return self.advance

    def __exit__(self, *error):
        return None

    def advance(self, name, steps):
        self.begun.add(name)
        if len(self.begun) == self.runs and self.kill is not None:
            kill, self.kill = self.kill, None
            kill()


@pytest.fixture
def cluster() -> Iterator[tuple[str, Callable[[], None]]]:
    """The address of a Ray cluster of two nodes with a core each, and what kills one of them: not the driver's."""
    ray = pytest.importorskip("ray", reason='the engine ray needs Ray: pip install "tagtrack[ray]"')
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    working = [nodes.add_node(num_cpus=1) for _ in range(2)]

    def kill() -> None:
        own = ray.get_runtime_context().get_node_id()
        nodes.remove_node(next(node for node in working if node.node_id != own), allow_graceful=False)

    yield nodes.address, kill
    nodes.shutdown()


def train_on(cluster, train, monkeypatch, seeds: Sequence[int]) -> None:
    """Train several seeds on a cluster of which a node is killed when all cores are at work."""
    address, kill = cluster
    bar = Killing(2, kill)
    monkeypatch.setattr("tagtrack.train.several.progress_bar", bar)
    words = (*SMALL, *STEPS, "--seeds", *map(str, seeds), "--engine", "ray", "--address", address)
    status, out, error = train(*words, "--out", "both")
    assert (status, bar.kill) == (0, None), out + error


def test_seeds_on_two_nodes_of_which_one_is_killed_are_the_same_runs(train, tmp_path, single, cluster, monkeypatch):
    train_on(cluster, train, monkeypatch, [0, 1])
    for name in ("seed0", "seed1"):
        assert contents(tmp_path / "both" / name) == contents(single / name)
    assert train("--resume", "both/seed0")[0] == 0, "what came back is this user's own"
    assert not [path for path in (tmp_path / "both").iterdir() if path.name.startswith(".")]


@pytest.mark.slow
def test_five_seeds_on_two_nodes_of_which_one_is_killed_are_five_local_runs(train, tmp_path, cluster, monkeypatch):
    seeds = [str(seed) for seed in range(5)]
    assert train(*SMALL, *STEPS, "--seeds", *seeds, "--out", "local")[0] == 0
    train_on(cluster, train, monkeypatch, range(5))
    for seed in seeds:
        assert contents(tmp_path / f"both/seed{seed}") == contents(tmp_path / f"local/seed{seed}")
    assert (tmp_path / "both/table.md").read_bytes() == (tmp_path / "local/table.md").read_bytes()


def test_a_cluster_that_does_not_answer_is_named(train, tmp_path):
    pytest.importorskip("ray", reason='the engine ray needs Ray: pip install "tagtrack[ray]"')
    words = (*SMALL, *STEPS, "--seeds", "0", "1", "--engine", "ray", "--address", "127.0.0.1:1")
    status, _, error = train(*words, "--out", "both")
    assert (status, error.partition(" (")[0]) == (2, "error: no Ray cluster answers at 127.0.0.1:1")
