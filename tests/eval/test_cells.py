"""Parts of the work come to the same bits whatever runs them, what is killed runs again, and what is finished is kept."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from contextlib import suppress
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from tagtrack.eval.cells import local
from tagtrack.eval.cells.cell import Cell, Done, pack
from tagtrack.eval.cells.engine import Engine
from tagtrack.eval.cells.kept import Kept, cache_folder
from tagtrack.eval.cells.options import EngineOptions
from tagtrack.eval.comparison import compare
from tagtrack.eval.contestants import find_makers
from tagtrack.eval.episode_record import join
from tagtrack.eval.rollout import cells_of, roll_out
from tests.eval.cell_functions import double, kill_the_process_once, note_and_double, refuse, wait_for_the_end


def test_ctrl_c_that_came_before_the_work_is_heeded_when_it_comes(monkeypatch):
    monkeypatch.setattr(local, "_counts", [0])
    monkeypatch.setattr(local, "_interrupted", True)
    with pytest.raises(KeyboardInterrupt):
        local._run(0, pack(cell(2)))
    assert not local._busy


ENGINES = [
    pytest.param(Engine(), id="here"),
    pytest.param(Engine(processes=2), id="processes"),
]


def cell(number, function=double, *more, name="a part"):
    return Cell(name=name, function=function, arguments=(number, *more), units=3)


@pytest.fixture
def kept(tmp_path, monkeypatch) -> Kept:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("tagtrack.eval.cells.cell.ACCOUNTED", {"tests", "builtins", "tagtrack", "pathlib"})
    return Kept()


@pytest.mark.parametrize("engine", ENGINES)
def test_results_come_in_the_order_of_the_cells_and_all_units_are_told(engine):
    told = []
    done = engine.run([cell(k, name=f"part {k}") for k in range(5)], lambda name, units: told.append((name, units)))
    assert [each.value for each in done] == [0, 2, 4, 6, 8]
    assert {name: sum(units for each, units in told if each == name) for name, _ in told} == {f"part {k}": 3 for k in range(5)}


@pytest.mark.parametrize("engine", ENGINES)
def test_what_a_cell_raises_is_raised_and_no_process_outlives_it(engine):
    with pytest.raises(ValueError, match="7 is not to be doubled"):
        engine.run([cell(7, refuse), cell(1, wait_for_the_end), cell(2)][: 3 if engine.processes else 1])
    until = time.monotonic() + 10
    while active_children() and time.monotonic() < until:
        time.sleep(0.05)
    assert not active_children()


def test_a_process_that_is_killed_costs_only_what_it_was_at(tmp_path):
    killer = cell(1, kill_the_process_once, tmp_path / "once")
    done = Engine(processes=2).run([cell(0, double), killer, cell(2, double)])
    assert [each.value for each in done] == [0, 2, 4]


def test_processes_that_are_killed_again_and_again_are_an_error():
    with pytest.raises(OSError, match="ended 3 times before any work was done.*--processes"):
        Engine(processes=2).run([cell(1, kill_the_process_once, None), cell(2)])


def test_what_cannot_travel_is_named_and_runs_here_all_the_same():
    inner = Cell(name="mine", function=lambda number, tell: number, arguments=(4,), units=1)
    assert Engine().run([inner])[0].value == 4
    with pytest.raises(ValueError, match="mine cannot be sent to another process .* move what it is made of to a module"):
        Engine(processes=2).run([inner])


def test_finished_parts_are_kept_until_the_whole_is_done(kept, tmp_path, capsys):
    cells = [cell(1, note_and_double, tmp_path / "log"), cell(7, refuse)]
    with pytest.raises(ValueError):
        Engine(kept=kept).run(cells)
    cells[1] = cell(7)
    again = Kept()
    assert [each.value for each in Engine(kept=again).run(cells)] == [2, 14]
    assert (tmp_path / "log").read_text() == "1\n"  # ran once
    assert "1 of 2 parts were done before" in capsys.readouterr().err
    again.forget()
    assert not list(cache_folder().iterdir())


def test_a_kept_result_that_was_touched_or_is_not_ours_is_not_read(kept):
    parcel = pack(cell(1))
    kept.keep(parcel, Done(2, 0.0))
    assert kept.find(parcel) == Done(2, 0.0)
    (file,) = cache_folder().iterdir()
    whole = file.read_bytes()
    for broken in (whole[:-1], whole[:20], b"", whole.replace(b"\n", b"\n0", 1), pickle.dumps(Done(3, 0.0))):
        file.write_bytes(broken)
        assert kept.find(parcel) is None
    file.write_bytes(whole)
    assert kept.find(pack(cell(2))) is None
    other = file.with_name("0" * 64)
    file.rename(other)  # another cell's result in its place
    other.rename(kept._path(pack(cell(2))))
    assert kept.find(pack(cell(2))) is None


def test_what_runs_a_users_own_code_is_not_kept():
    assert pack(cell(1)).own_code  # of a module of the tests
    assert not pack(Cell(name="", function=len, arguments=(np.ones(3),), units=1)).own_code


def test_nothing_fails_where_nothing_can_be_kept(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    kept = Kept()
    assert Engine(kept=kept).run([cell(3)])[0].value == 6
    kept.forget()


def test_old_leftovers_go(kept, monkeypatch):
    kept.keep(pack(cell(1)), Done(2, 0.0))
    (file,) = cache_folder().iterdir()
    os.utime(file, (0, 0))
    Kept()
    assert not file.exists()


def test_batches_joined_are_the_roll_out(task):
    for spec in ("circle:20", "static_array"):
        maker = find_makers({"": spec}, task, "")[""]
        whole = roll_out(task, maker, episodes=7, seed=5)
        parts = [one.run(lambda units: None).value for one in cells_of("", task, maker, episodes=7, seed=5, batch=3)]
        found = join(parts)
        assert found.error.tobytes() == whole.error.tobytes()
        assert (found.reward is None) == (whole.reward is None)
        assert whole.reward is None or found.reward.tobytes() == whole.reward.tobytes()


def test_a_comparison_in_processes_is_the_one_in_this_process(task, save_run, tmp_path):
    policies = {"circle": "circle:9", "trained": {"a": save_run(tmp_path / "a"), "b": save_run(tmp_path / "b")}}
    here = compare(task, policies, episodes=5, batch=2)
    there = compare(task, policies, episodes=5, batch=2, engine=Engine(processes=2))
    assert here.document({}) == there.document({})
    for name in here.records:
        assert here.records[name].error.tobytes() == there.records[name].error.tobytes()


SMALL = ("--episodes", "6", "--set", "episode_steps=20", "--particles", "40")


@pytest.mark.parametrize(
    "command",
    [
        ("benchmark", "--policies", "pursuit", "circle", "--no-film"),
        ("tune", "--values", "10", "20"),
    ],
    ids=lambda words: words[0],
)
def test_a_command_says_and_writes_the_same_in_processes(evaluate, tmp_path, command):
    name, *words = command
    said = []
    for more in ((), ("--processes", "2")):
        status, out, _ = evaluate(name, *words, *SMALL, *more, "--out", tmp_path / "o")
        assert status == 0
        said.append(out)
    assert said[0] == said[1]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--processes", "0"), "--processes must be at least 1, got 0"),
        (("--address", "far:6379"), "--address far:6379 goes with --engine ray; add that, or leave it out"),
    ],
)
def test_options_that_make_no_sense_are_refused(evaluate, words, complaint):
    assert evaluate("benchmark", *SMALL, *words) == (2, "", f"error: {complaint}\n")


def test_without_ray_the_error_names_the_extra(evaluate, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    status, _, err = evaluate("suite", "--engine", "ray")
    assert (status, err) == (2, 'error: --engine ray needs Ray: pip install "tagtrack[ray]"\n')


def test_what_was_cut_off_begins_where_it_ended(evaluate, tmp_path, monkeypatch):
    """Ctrl-C in the second policy: the same command again runs that one alone."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    ran = []

    def watched(task, contestant, episodes, seed, threads, *, tell):
        ran.append(str(contestant.args[0]))
        if len(ran) == 2:
            raise KeyboardInterrupt
        return roll_out(task, contestant, episodes=episodes, seed=seed)

    watched.__qualname__, watched.__module__ = "_roll_out_batch", "tagtrack.eval.rollout"
    monkeypatch.setattr("tagtrack.eval.rollout._roll_out_batch", watched)
    words = ("benchmark", "--policies", "pursuit", "circle", "stationary", *SMALL, "--no-film", "--out", tmp_path / "b")
    assert evaluate(*words)[0] == 130
    assert evaluate(*words)[0] == 0
    assert ran == ["pursuit", "circle", "circle", "stationary"]
    assert not list(cache_folder().iterdir())


def test_engine_options_stand_in_the_help_of_what_takes_long(evaluate):
    for command in ("benchmark", "suite", "tune", "papers", "tradeoff", "messages"):
        _, out, _ = evaluate(command, "--help")
        assert "--engine" in out and "--processes" in out and "--address" in out
    assert EngineOptions() == EngineOptions(engine="local")


def test_ctrl_c_ends_the_processes(tmp_path, repository):
    """Sent to the command alone, as a supervisor would: its processes end with it."""
    code = f"""
from pathlib import Path
from tagtrack.eval.cells.cell import Cell
from tagtrack.eval.cells.engine import Engine
from tests.eval.cell_functions import wait_for_the_end
if __name__ == "__main__":
    place = Path({str(tmp_path)!r})
    Engine(processes=2).run([Cell(name="", function=wait_for_the_end, arguments=(k, place / str(k)), units=1) for k in range(2)])
"""
    for number in (signal.SIGINT, signal.SIGKILL):
        for file in tmp_path.iterdir():
            file.unlink()
        running = subprocess.Popen([sys.executable, "-c", code], cwd=repository, stderr=subprocess.DEVNULL)
        pids = [_wait_for_text(tmp_path / str(k)) for k in range(2)]
        running.send_signal(number)
        running.wait(30)
        for pid in map(int, pids):
            _wait_until_gone(pid)


def _wait_for_text(file: Path) -> str:
    until = time.monotonic() + 60
    while time.monotonic() < until:
        if file.is_file() and file.read_text().endswith("\n"):
            return file.read_text()
        time.sleep(0.05)
    raise AssertionError(f"{file} was not written")


def _wait_until_gone(pid: int) -> None:
    until = time.monotonic() + 30
    while time.monotonic() < until:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        with suppress(FileNotFoundError):  # gone meanwhile, or a system without /proc
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return
        time.sleep(0.05)
    raise AssertionError(f"process {pid} still runs")
