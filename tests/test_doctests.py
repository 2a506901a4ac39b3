"""The examples in docstrings are true, and every one of them is run.

pytest's own collector would import the folders under their bare names, so the modules are found here, as ``tagtrack``.
"""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDERS = ("tagtrack", "envs", "policies", "baselines", "train", "eval", "live")
EXAMPLE = re.compile(r"^ *>>> ", re.MULTILINE)


def examples() -> dict[str, int]:
    """Name of each module that has examples, and their number, as its text has it."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((REPOSITORY / folder).rglob("*.py")):
            parts = path.relative_to(REPOSITORY / folder).with_suffix("").parts
            name = ".".join(["tagtrack", *([] if folder == "tagtrack" else [folder]), *parts]).removesuffix(".__init__")
            if count := len(EXAMPLE.findall(path.read_text(encoding="utf-8"))):
                found[name] = count
    return found


EXAMPLES = examples()


def test_there_are_examples() -> None:
    assert {"tagtrack.envs.belief.filter", "tagtrack.envs.overrides"} <= EXAMPLES.keys()


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_in_docstrings_are_true(name: str) -> None:
    failed, attempted = doctest.testmod(importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert failed == 0
    assert attempted == EXAMPLES[name], "doctest does not look where some of the examples stand"
