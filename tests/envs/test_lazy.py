"""Packages whose names load their modules when they are first asked for."""

from importlib import import_module

import pytest

PACKAGES = ("tagtrack.envs", "tagtrack.eval", "tagtrack.eval.field", "tagtrack.live")


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_is_found_and_listed(name):
    package = import_module(name)
    assert set(package.__all__) <= set(dir(package))
    for public in package.__all__:
        assert getattr(package, public) is not None


@pytest.mark.parametrize("name", PACKAGES)
def test_a_name_that_no_module_has_is_refused(name):
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        getattr(import_module(name), "nothing")  # noqa: B009


def test_what_sails_aboard_loads_neither_eval_nor_numba_before_it_is_asked(run_python):
    code = "import sys, tagtrack.live; print([m for m in sys.modules if m.startswith(('numba', 'tagtrack.eval'))])"
    assert run_python(code).strip() == "[]"
