"""A folder of results: the old ones or the new ones, whatever a kill does, and one process at a time."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tagtrack.eval import results_folder
from tagtrack.eval.folder_claim import release
from tagtrack.eval.results_folder import replace_results, require_replaceable

OWN = ("table.md", "track_*.png")


class Killed(BaseException):
    """Stands for the end of the process."""


def write(out: Path, text: str, *names: str) -> None:
    require_replaceable(out, OWN, "test")
    with replace_results(out, OWN) as folder:
        for name in names:
            (folder / name).write_text(text)


def content(out: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in out.iterdir() if path.is_file()}


@pytest.fixture
def out(tmp_path) -> Path:
    write(tmp_path / "out", "old", "table.md", "track_old.png")
    return tmp_path / "out"


@pytest.mark.parametrize("left", [".partial-abc", ".whole-abc"])
def test_what_a_kill_left_does_not_block_the_folder(out, left):
    (out / left).mkdir()
    (out / left / "track_half.png").write_text("half")
    write(out, "new", "table.md")
    assert content(out) == {"table.md": "new"} and len(list(out.iterdir())) == 1


@pytest.mark.parametrize("moves", [0, 1, 2])
def test_a_move_that_was_cut_off_is_finished_by_the_next_command(out, monkeypatch, moves):
    replace, done = os.replace, []

    def kill(source: Path, target: Path) -> None:
        if Path(target).parent == out:
            if len(done) == moves:
                raise Killed
            done.append(target)
        replace(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(results_folder.os, "replace", kill)
        with pytest.raises(Killed):
            write(out, "new", "table.md", "track_a.png", "track_b.png")
    require_replaceable(out, OWN, "test")
    assert content(out) == {"table.md": "new", "track_a.png": "new", "track_b.png": "new"}
    assert len(list(out.iterdir())) == 3


def test_of_two_processes_the_second_is_refused_from_the_start(tmp_path):
    out = tmp_path / "not-there-yet"
    require_replaceable(out, OWN, "test")
    code = "from pathlib import Path\nfrom tagtrack.eval.results_folder import require_replaceable\n"
    code += f"require_replaceable(Path({str(out)!r}), (), 'test')"
    second = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert second.stderr.strip().endswith("is being written by another process; wait for it, or choose another folder")
    release(out)
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


def test_foreign_files_are_still_refused(out):
    (out / ".partial-notes").write_text("a file of somebody's")
    with pytest.raises(ValueError, match=r"holds \.partial-notes, which is no part of a test"):
        require_replaceable(out, OWN, "test")
