"""The examples in docstrings are true.

pytest's own collector would import the folders under their bare names, so the modules are found here, as ``tagtrack``.
"""

from __future__ import annotations

import doctest
import importlib
import pkgutil
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDERS = ("tagtrack", "envs", "policies", "baselines", "train", "eval")


def module_names() -> list[str]:
    """All of ``tagtrack``. The folders are mapped, not nested, so a walk from ``tagtrack.__path__`` would miss them."""
    names = []
    for folder in FOLDERS:
        package = "tagtrack" if folder == "tagtrack" else f"tagtrack.{folder}"
        found = pkgutil.walk_packages([str(REPOSITORY / folder)], package + ".")
        names += [package, *(module.name for module in found)]
    return names


@pytest.mark.parametrize("name", module_names())
def test_examples_in_docstrings_are_true(name: str) -> None:
    failed, _ = doctest.testmod(importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert failed == 0
