"""A file is replaced whole or not at all."""

import errno
import os
from pathlib import Path

import pytest

from tagtrack.policies.files import remove_leftovers, replace_file, save_policy


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_write_that_fails_midway_leaves_the_old_file_and_nothing_else(tmp_path, error):
    file = tmp_path / "table.md"
    file.write_text("old")
    with pytest.raises(error), replace_file(file) as partial:
        partial.write_text("half")
        raise error
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["table.md"]


def test_old_file_stands_until_the_block_ends(tmp_path):
    file = tmp_path / "curve.png"
    file.write_text("old")
    with replace_file(file) as partial:
        partial.write_text("new")
        assert partial.parent == tmp_path
        assert partial.suffix == ".png"
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert os.listdir(tmp_path) == ["curve.png"]


def test_full_disk_is_said_by_the_file_s_own_name(tmp_path):
    file = tmp_path / "table.md"
    with (
        pytest.raises(OSError, match=r"no space left to write, free some and try again: '.*table\.md'"),
        replace_file(file),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert os.listdir(tmp_path) == []


def test_full_disk_while_saving_leaves_no_half_policy(tmp_path, make_policy, monkeypatch):
    def full(*arguments, **keywords):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="no space left"):
        save_policy(tmp_path, make_policy())
    assert os.listdir(tmp_path) == []


def test_missing_folder_is_named(tmp_path):
    with (
        pytest.raises(FileNotFoundError, match="make the folder .*nowhere first"),
        replace_file(tmp_path / "nowhere" / "a"),
    ):
        pass


def test_block_that_writes_nothing_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError), replace_file(tmp_path / "a.csv"):
        pass


def test_what_a_kill_left_is_removed_and_nothing_else(tmp_path):
    for name in ("policy.json", ".lock", ".notes.txt", ".policy.abc.json"):
        (tmp_path / name).write_text("of somebody")
    before = sorted(os.listdir(tmp_path))
    writings = [replace_file(tmp_path / name) for name in ("policy.json", "model.of.1.zip", "key")]
    for writing in writings:  # never left: the process was killed
        writing.__enter__().write_text("half")
    assert len(os.listdir(tmp_path)) == len(before) + 3
    remove_leftovers(tmp_path)
    assert sorted(os.listdir(tmp_path)) == before
