"""``tagtrack`` is the three command lines under one name."""

from __future__ import annotations

import sys

import pytest

import tagtrack
from tagtrack.live.console import COMMANDS, main


@pytest.mark.parametrize(
    ("words", "status", "shown"),
    [
        ([], 2, "usage: tagtrack COMMAND"),
        (["--help"], 0, "recorded missions and vehicles at sea"),
        (["--version"], 0, tagtrack.__version__),
        (["swim"], 2, "unknown command 'swim'; known: train, eval, live"),
        *(([name, "--help"], 0, name) for name in COMMANDS),
    ],
)
def test_commands(monkeypatch, capsys, words: list[str], status: int, shown: str) -> None:
    monkeypatch.setattr(sys, "argv", ["tagtrack", *words])
    assert main() == status
    said = capsys.readouterr()
    assert shown in said.out + said.err
