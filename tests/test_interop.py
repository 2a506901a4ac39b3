"""Other people's libraries: the scripts of examples/interop stay short and run where their library is installed."""

from __future__ import annotations

import importlib
import importlib.util
import json
import re
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDER = REPOSITORY / "examples" / "interop"


def load_matrix() -> ModuleType:
    spec = importlib.util.spec_from_file_location("interop_matrix", FOLDER / "matrix.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["interop_matrix"] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module


matrix = load_matrix()
SCRIPTS = [library.script for library in matrix.LIBRARIES.values()]


def test_every_script_is_in_the_matrix() -> None:
    assert sorted(SCRIPTS) == sorted(path.stem for path in FOLDER.glob("*.py") if path.stem not in ("matrix", "measure"))


@pytest.mark.parametrize("script", SCRIPTS)
def test_script_names_tagtrack_in_two_lines_at_most(script: str) -> None:
    assert 1 <= len(matrix.own_lines(script)) <= matrix.MOST_LINES


def imports(script: str) -> set[str]:
    """Modules that a script imports."""
    found = re.findall(r"^(?:import|from) ([\w.]+)", (FOLDER / f"{script}.py").read_text(encoding="utf-8"), re.MULTILINE)
    return set(found) - set(sys.stdlib_module_names)


@pytest.mark.parametrize("script", SCRIPTS)
def test_script_runs_where_its_library_is_installed(script: str) -> None:
    for name in sorted(imports(script)):
        try:  # a part of a library, as ray.rllib, may need what the library does not
            importlib.import_module(name)
        except ImportError as error:
            pytest.skip(f"{name} cannot be imported ({error}); it is no dependency")
    done = subprocess.run(
        [sys.executable, FOLDER / "measure.py", FOLDER / f"{script}.py"], capture_output=True, text=True, timeout=600
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    told = json.loads(re.findall(r'^\{"steps": .*\}$', done.stdout, re.MULTILINE)[-1])
    assert told["steps"] > 100 and told["seconds"] > 0


def test_page_says_by_name_what_does_not_run() -> None:
    rows = {
        "sb3": {"state": "runs", "version": "2.9.2", "rate": 12345.6},
        "rllib": {"state": "does not install here: ERROR: no ray"},
    }
    page = matrix.write_page(rows)
    assert "| Stable-Baselines3 | 2.9.2 | [sb3.py](../examples/interop/sb3.py) | runs | 12,346 |" in page
    assert "| RLlib |  | [rllib_ppo.py](../examples/interop/rllib_ppo.py) | does not install here: ERROR: no ray |  |" in page
    assert page.count("not run yet") == len(matrix.LIBRARIES) - 2 and "<" not in page.replace("<br>", "")


def test_row_that_was_not_run_keeps_what_the_page_said() -> None:
    before = matrix.write_page({"sb3": {"state": "runs", "version": "2.9.2", "rate": 12345.6}})
    page = matrix.write_page({"skrl": {"state": "runs", "version": "2.1.1", "rate": 10.0}}, before)
    assert "| runs | 12,346 |" in page and "| runs | 10 |" in page
    assert "12,346" not in matrix.write_page({"sb3": {"state": "fails: no sea"}}, before)


def test_second_call_goes_on_with_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = {key: {"state": "runs", "of": matrix.digest(library)} for key, library in matrix.LIBRARIES.items()}
    assert matrix.choose([], runs) == [] and matrix.choose([], {}) == matrix.choose(["all"], runs) == list(matrix.LIBRARIES)
    assert matrix.choose(["skrl"], runs) == ["skrl"]
    missing = {**runs, "rllib": {**runs["rllib"], "state": "fails: no end after 900 s"}, "skrl": {**runs["skrl"], "of": "older"}}
    del missing["sb3"]
    assert matrix.choose([], missing) == ["sb3", "rllib", "skrl"]


def test_what_is_finished_stays_when_the_next_library_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def measure(key: str, wrong: str | None) -> dict[str, Any]:
        if key == "skrl":
            raise KeyboardInterrupt
        return {"state": "runs" if wrong is None else f"does not install here: {wrong}", "rate": 5.0}

    monkeypatch.setattr(matrix, "REPOSITORY", tmp_path)
    monkeypatch.setattr(matrix, "PLACE", tmp_path / ".interop")
    monkeypatch.setattr(matrix, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr(matrix, "make_environment", lambda key: "no ray" if key == "rllib" else None)
    monkeypatch.setattr(matrix, "measure", measure)
    with pytest.raises(KeyboardInterrupt):
        matrix.main([])
    rows = json.loads((tmp_path / ".interop" / "results.json").read_text())
    assert list(rows) == list(matrix.LIBRARIES)[: list(matrix.LIBRARIES).index("skrl")]
    assert rows["rllib"]["state"] == "does not install here: no ray"
    page = (tmp_path / "page.md").read_text()
    assert page.count("| runs | 5 |") == len(rows) - 1 and page.count("not run yet") == len(matrix.LIBRARIES) - len(rows)
    assert sorted(path.name for path in tmp_path.rglob("*") if path.is_file()) == ["page.md", "results.json"]


def test_command_that_takes_too_long_ends_with_all_it_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matrix, "PLACE", tmp_path)
    child = "import pathlib, time; time.sleep(2); pathlib.Path('late').touch()"
    code = f"import subprocess, sys, time; subprocess.Popen([sys.executable, '-c', {child!r}]); time.sleep(60)"
    done = matrix.run([sys.executable, "-c", code], 1.0)
    assert done.returncode == 124 and matrix.last_words(done) == "no end after 1 s"
    time.sleep(2.5)
    assert not (tmp_path / "late").exists()


def test_torch_is_the_pinned_one_everywhere() -> None:
    assert re.fullmatch(r"torch==[\d.]+", matrix.pinned_torch())


def test_error_of_an_installation_is_told_in_its_own_line() -> None:
    done = subprocess.CompletedProcess([], 1, "", "WARNING: x\nERROR: no version of ray\n\nhint: see the page\n")
    assert matrix.last_words(done) == "ERROR: no version of ray"
    assert matrix.last_words(subprocess.CompletedProcess([], 1, "", "")) == "it ended without a word"
