"""``tagtrack`` is the three command lines under one name."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import tagtrack
from tagtrack.command import COMMANDS, SHELLS, main, tagtrack_here
from tagtrack.eval.cli import COMMANDS as EVALUATIONS
from tagtrack.eval.cli import find_command


@pytest.mark.parametrize(
    ("words", "status", "shown"),
    [
        ([], 2, "usage: tagtrack COMMAND"),
        (["--help"], 0, "recorded missions and vehicles at sea"),
        (["--version"], 0, tagtrack.__version__),
        (["swim"], 2, "unknown command 'swim'; known: train, eval, live"),
        (["completion", "fish"], 2, "name a shell: tagtrack completion bash|zsh|tcsh"),
        (["eval", "benchmrak"], 2, "unknown command 'benchmrak'; did you mean benchmark?"),
        *(([name, "--help"], 0, name) for name in COMMANDS),
    ],
)
def test_commands(monkeypatch, capsys, words: list[str], status: int, shown: str) -> None:
    monkeypatch.setattr(sys, "argv", ["tagtrack", *words])
    assert main() == status
    said = capsys.readouterr()
    assert shown in said.out + said.err


@pytest.mark.parametrize("name", EVALUATIONS)
def test_every_command_of_the_table_is_there(name: str) -> None:
    assert find_command(name).__doc__ and callable(find_command(name).run)


@pytest.mark.parametrize(
    ("words", "heavy"), [("--help", "gymnasium tyro numpy"), ("eval benchmark --help", "gymnasium numba numpy")]
)
def test_help_loads_nothing_that_takes_its_time(run_python: Callable[..., str], words: str, heavy: str) -> None:
    code = (
        "import contextlib, io, os, sys\n"
        "sys.argv = [os.path.join(os.path.dirname(sys.executable), 'tagtrack'), *sys.argv[1:]]\n"
        "from tagtrack.command import main\n"
        "with contextlib.redirect_stdout(io.StringIO()): assert main() == 0\n"
        "print(*sys.modules)"
    )
    assert not set(heavy.split()) & set(run_python(code, *words.split()).split())


def test_ids_are_registered_for_every_command_that_runs_something(run_python: Callable[..., str]) -> None:
    code = (
        "import os, sys\n"
        "sys.argv = [os.path.join(os.path.dirname(sys.executable), 'tagtrack'), 'eval', 'speed']\n"
        "import tagtrack, gymnasium; print(gymnasium.spec('TagTrack/LeopardShark-v0').id)"
    )
    assert run_python(code).strip() == "TagTrack/LeopardShark-v0"


def test_hints_name_the_command_by_the_path_that_leads_to_it(monkeypatch, tmp_path: Path) -> None:
    script = tmp_path / "venv/bin/tagtrack"
    script.parent.mkdir(parents=True)
    script.write_text("#!/bin/sh\n")
    script.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(script.with_name("python")))
    monkeypatch.setenv("PATH", os.defpath)
    monkeypatch.chdir(tmp_path)
    assert tagtrack_here() == "venv/bin/tagtrack"
    monkeypatch.chdir(script.parents[1])
    assert tagtrack_here() == "bin/tagtrack"
    monkeypatch.chdir("/")
    assert os.path.samefile(tagtrack_here(), script)
    monkeypatch.setenv("PATH", str(script.parent))
    assert tagtrack_here() == "tagtrack"
    script.unlink()
    assert tagtrack_here().endswith("python -m tagtrack")


@pytest.mark.parametrize("shell", SHELLS)
def test_shells_complete_commands_and_options(monkeypatch, capsys, shell: str) -> None:
    monkeypatch.setattr(sys, "argv", ["tagtrack", "completion", shell])
    assert main() == 0
    script = capsys.readouterr().out
    for word in ("benchmark", "policies", "hyper", "rehearse"):
        assert word in script


@pytest.mark.parametrize("columns", [40, 60, 80])
def test_lists_of_commands_fit_the_terminal(monkeypatch, capsys, columns: int) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    for words in (["--help"], ["eval", "--help"]):
        monkeypatch.setattr(sys, "argv", ["tagtrack", *words])
        assert main() == 0
        lines = capsys.readouterr().out.partition("\nexamples")[0].splitlines()
        assert max(len(line) for line in lines if line.startswith("  ")) <= columns


CONSOLE = Path(sys.executable).with_name("tagtrack")


@pytest.mark.skipif(not CONSOLE.exists(), reason="there is no console command beside this Python")
def test_a_module_in_the_working_folder_is_found(tmp_path):
    (tmp_path / "zigzag.py").write_text("class Zigzag: pass\n")
    done = subprocess.run(
        [CONSOLE, "eval", "benchmark", "--policies", "zigzag:Zigzag"], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2 and "No module named" not in done.stderr and "Zigzag" in done.stderr


@pytest.mark.skipif(not CONSOLE.exists(), reason="there is no console command beside this Python")
@pytest.mark.parametrize("words", [["--help"], ["eval", "--help"], ["train", "--help"], ["live", "--help"]], ids=" ".join)
def test_a_reader_who_stops_reading_is_no_error(words):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb") as closed:
        done = subprocess.run([CONSOLE, *words], stdout=closed, stderr=subprocess.PIPE, text=True, timeout=120)
    assert done.stderr == ""


@pytest.mark.skipif(not CONSOLE.exists(), reason="there is no console command beside this Python")
def test_results_are_written_though_nobody_reads_the_table(tmp_path):
    read, write = os.pipe()
    os.close(read)
    words = ["eval", "benchmark", "--policies", "pursuit", "--episodes", "1", "--particles", "20", "--set", "episode_steps=8"]
    with os.fdopen(write, "wb") as closed:
        command = [CONSOLE, *words, "--no-film", "--out", "out"]
        done = subprocess.run(command, cwd=tmp_path, stdout=closed, stderr=subprocess.PIPE, text=True, timeout=300)
    assert done.returncode == 0 and "rror" not in done.stderr
    assert (tmp_path / "out" / "benchmark.json").exists() and (tmp_path / "out" / "report.html").exists()
