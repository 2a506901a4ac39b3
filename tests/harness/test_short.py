"""The harnesses for a few seconds each; ``make kill``, ``make fuzz`` and ``make soak`` run them for as long as is wished."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.harness.fuzz import KINDS, fuzz
from tests.harness.kill import kill
from tests.harness.soak import TASKS, soak


@pytest.mark.parametrize("kind", KINDS)
def test_nonsense_is_refused_or_harmless(kind):
    fuzz(kind, 60)


def test_nonsense_that_does_not_end_is_named(repository):
    code = "import time\nfrom tests.harness import fuzz\nfuzz.PATIENCE = 0.1\nwith fuzz.ended('lines', 7): time.sleep(100)"
    done = subprocess.run([sys.executable, "-c", code], cwd=repository, capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stdout) == (1, "lines: no end after 0.1 s: 7\n")


def test_what_a_stranger_does_first_runs(run_python, tmp_path, repository):
    """The release check runs the same beside each wheel."""
    assert "gymnasium" in run_python((repository / "tests" / "harness" / "typed" / "driver.py").read_text(), cwd=tmp_path)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills are made in forked processes")
def test_a_killed_command_goes_on_to_the_same_results():
    assert kill(4, seed=1, names=["eval consistency", "array locate"]) == {"eval consistency": 2, "array locate": 2}


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills are made in forked processes")
def test_a_killed_training_goes_on_to_the_same_results():
    assert kill(6, seed=1, names=["train", "train sac", "eval benchmark"])


@pytest.mark.parametrize("name", [*list(TASKS)[:2], "fleet, tdma"])
def test_worlds_stay_finite_and_alike_on_two_threads(name):
    assert soak(name, 1.0, seed=3, worlds=64, particles=100, again=1.0) > (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_all_worlds_stay_finite_and_alike(name):
    assert soak(name, 10.0, seed=4, worlds=64, particles=100, again=1.0) > (0, 0)
