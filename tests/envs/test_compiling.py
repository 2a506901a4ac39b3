"""The cache of compiled code is thrown away when a source of it changed, and only then; its search of the text misses nothing."""

import ast
import shutil
from pathlib import Path

import numba
import pytest

from tagtrack.envs.belief.hindsight import is_worth_telling
from tagtrack.envs.kernels.compiling import PACKAGE, compiled_sources, source_stamp, stamp_sources

NAME = "tagtrack.envs"
COMPILING = f"{NAME}.kernels.compiling"
HARMLESS = {"typeof"}  # of numba: compiles nothing


@pytest.fixture
def package(tmp_path):
    """A copy of the sources, to edit."""
    return Path(shutil.copytree(PACKAGE, tmp_path / "envs", ignore=shutil.ignore_patterns("__pycache__")))


def imported_by(path):
    """(module, name) of every import of a file, name None where the module itself is imported."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            yield from ((alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from ((node.module, alias.name) for alias in node.names)


def files_of(module):
    """The file of a module of the package, as a list, empty where there is none."""
    place = PACKAGE.joinpath(*module.split(".")[2:])
    return [path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()]


def test_every_file_that_can_compile_is_in_the_stamp():
    stamped = compiled_sources(PACKAGE)
    for path in PACKAGE.rglob("*.py"):
        if path.relative_to(PACKAGE).as_posix() in stamped:
            continue
        compilers = {module for module, name in imported_by(path) if module == COMPILING or (module.startswith("numba") and name)}
        assert not compilers, f"{path} imports from {compilers}, but holds no decorator that the stamp knows as a kernel's"
        used = {
            node.attr
            for node in ast.walk(ast.parse(path.read_bytes()))
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "numba"
        }
        assert used <= HARMLESS, f"{path} uses numba's {used - HARMLESS}, but is not in the stamp"


def test_numba_goes_by_its_own_name():
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.Import):
                assert not any(alias.name.startswith("numba") and alias.asname for alias in node.names), path


def test_whatever_a_stamped_file_imports_is_in_the_stamp():
    stamped = compiled_sources(PACKAGE)
    seen = 0
    for source in stamped:
        for module, name in imported_by(PACKAGE / source):
            if module != NAME and not module.startswith(NAME + "."):
                continue
            imported = files_of(f"{module}.{name}") or files_of(module)
            assert imported, f"{source} imports {module}, which is no file"
            for path in imported:
                assert path.relative_to(PACKAGE).as_posix() in stamped, f"{source} imports {module}, which is not in the stamp"
            seen += 1
    assert seen > len(stamped)


@pytest.mark.parametrize("name", ["presets.py", "scenario.py", "single.py", "simulation.py", "task.py", "rendering.py"])
def test_an_edit_of_what_compiles_nothing_keeps_the_stamp(package, name):
    with (package / name).open("a") as file:
        file.write("\nEDITED = True\n")
    assert stamp_sources(package) == source_stamp()


@pytest.mark.parametrize(
    "name",
    [
        "kernels/maths.py", "kernels/calling.py", "measurement.py", "sim/vehicle.py", "sensors/stereo.py", "belief/row.py",
        "world.py",
    ],
)  # fmt: skip
def test_an_edit_of_what_compiled_code_is_made_from_changes_the_stamp(package, name):
    with (package / name).open("a") as file:
        file.write("\nEDITED = True\n")
    assert stamp_sources(package) != source_stamp()


@pytest.mark.parametrize(
    "line",
    [
        "from tagtrack.envs.tides.moon import PERIOD",
        "from tagtrack.envs.tides import (\n    moon,\n)",
        "import tagtrack.envs.tides.moon",
        "def late():\n    from tagtrack.envs.tides.moon import PERIOD",
    ],
)
def test_constants_of_a_new_folder_are_in_the_stamp_once_a_kernel_imports_them(package, line):
    (package / "tides").mkdir()
    (package / "tides/__init__.py").write_text("")
    (package / "tides/moon.py").write_text("PERIOD = 44714.0\n")
    assert stamp_sources(package) == source_stamp()
    with (package / "sim/vehicle.py").open("a") as file:
        file.write(f"\n{line}\n")
    assert "tides/moon.py" in compiled_sources(package)
    before = stamp_sources(package)
    (package / "tides/moon.py").write_text("PERIOD = 44712.0\n")
    assert stamp_sources(package) != before


@pytest.mark.parametrize("decorator", ["compiled", "numba.njit(cache=True)", "cfunc(signature, cache=True)", "intrinsic"])
def test_a_new_file_with_a_kernel_is_in_the_stamp(package, decorator):
    (package / "tides.py").write_text(f"@{decorator}\ndef rise(time):\n    return time\n")
    assert "tides.py" in compiled_sources(package)


def test_a_part_of_kernels_refuses_calls_from_python_whether_compiled_or_not():
    for _ in range(2):
        with pytest.raises(TypeError, match="is_worth_telling is a part of compiled kernels.*@compiled"):
            is_worth_telling(1, True)
        is_worth_telling.compile((numba.int64, numba.boolean))
