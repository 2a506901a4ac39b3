"""Help that fits the terminal: texts flow, whatever lines they have in the sources."""

from __future__ import annotations

import pytest

from tagtrack.eval.cli import COMMANDS, main
from tagtrack.train.cli import main as train

WORDS = [[name] for name in COMMANDS if name != "array"] + [
    ["array", step] for step in ("simulate", "sync", "survey", "locate", "tracks")
]


@pytest.mark.parametrize("words", WORDS, ids=" ".join)
def test_help_is_no_wider_than_the_terminal(monkeypatch, capsys, words):
    monkeypatch.setenv("COLUMNS", "60")
    assert main([*words, "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 10 and max(map(len, lines[1:])) <= 60  # the first one names the program by its path


def test_the_text_of_an_option_breaks_where_it_must_and_not_where_the_source_does(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "400")
    with pytest.raises(SystemExit):
        train(["--help"])
    assert "so that it still learns eight times. (default by environment)" in capsys.readouterr().out


def test_a_list_of_nothing_is_refused_where_it_would_mean_the_default(capsys):
    assert train(["--seeds"]) == 2 and main(["suite", "--tasks", "--quick"]) == 2
    told = capsys.readouterr().err
    assert "--seeds names nothing; give it a value or leave it out" in told and "--tasks names nothing" in told
