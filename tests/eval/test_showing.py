"""What commands show beside their results: help that fits the terminal, whatever lines it has in the sources; progress."""

from __future__ import annotations

import pytest

from tagtrack.eval import progress
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
    assert main(["benchmark", "--policies", ""]) == 2 and main(["benchmark", "--metrics="]) == 2
    assert main(["aggregate"]) == 2  # no list was named at all
    told = capsys.readouterr().err
    assert (
        "name the folders of some benchmarks" in told
        and "--seeds names nothing; give it a value or leave it out" in told
        and "--tasks names nothing" in told
    )


def test_a_log_hears_of_long_work_each_minute_and_of_short_work_nothing(monkeypatch, capsys):
    with progress.progress_bar(200) as advance:
        advance("circle", 50)
        assert capsys.readouterr().err == ""
        monkeypatch.setattr(progress, "SILENCE", 0.0)
        advance("pursuit", 50)
    assert capsys.readouterr().err == "pursuit: 50 % of all steps\n"
