"""Whole numbers on command lines: however they are written, and nothing that is not whole."""

from __future__ import annotations

import pytest

from tagtrack.eval.cli import parse
from tagtrack.eval.whole_number import read_whole_number


@pytest.mark.parametrize(
    ("text", "number"),
    [("1000", 1000), ("2_000_000", 2_000_000), ("1e6", 1_000_000), ("1.5E6", 1_500_000), ("3.0", 3), ("-1", -1), ("0e9", 0)],
)
def test_a_whole_number_may_be_written_in_many_ways(text, number):
    assert read_whole_number(text) == number


@pytest.mark.parametrize("text", ["", "many", "2.5", "1e-3", "nan", "inf", "1e400000000000", "1e-400000000000", "9" * 19])
def test_what_is_not_whole_or_absurdly_large_is_refused(text):
    with pytest.raises(ValueError, match="must be a whole number"):
        read_whole_number(text)


def test_numbers_of_a_benchmark_may_be_written_in_powers_of_ten():
    command = parse(["benchmark", "--episodes", "1e3", "--seed", "1e9", "--particles", "4_000", "--from-step", "1e1"])
    assert (command.trial.episodes, command.trial.seed) == (1000, 10**9)
    assert (command.task.particles, command.from_step) == (4000, 10)


def test_a_number_that_is_not_whole_is_shown_with_its_flag(capsys):
    with pytest.raises(SystemExit):
        parse(["benchmark", "--episodes", "2.5"])
    shown = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert "--episodes: must be a whole number of at most 18 digits, got '2.5'" in shown
