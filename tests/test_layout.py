"""The house keeps its order: pyproject.toml matches the folders, and a module imports only what stands below it.

The tables here are the one of CONTRIBUTING.md and, inside ``envs/``, the floors; a new module there needs a floor.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import tagtrack

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REPOSITORY = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))

TOP_FOLDERS = ("envs", "policies", "baselines", "train", "eval", "live")

# Folder -> what it may import of ours, beside itself. Anything below a listed name is included.
MAY_IMPORT = {
    "tagtrack": (),
    "tagtrack.command": (),  # strings, for everybody: what a user types here
    "tagtrack.envs": (),
    "tagtrack.policies": ("tagtrack.envs",),
    "tagtrack.baselines": ("tagtrack.envs", "tagtrack.policies.protocol"),
    "tagtrack.live": ("tagtrack.envs", "tagtrack.policies", "tagtrack.baselines", "tagtrack.eval"),  # aboard nothing of eval
    "tagtrack.eval": (
        "tagtrack.envs", "tagtrack.policies", "tagtrack.baselines", "tagtrack.live.plane", "tagtrack.live.recording"
    ),
    "tagtrack.train": ("tagtrack.envs", "tagtrack.policies", "tagtrack.eval", "tagtrack.live.cli"),  # whose options are completed
}

# Inside envs/, ground floor first: a module may import from its own floor and from those below.
FLOORS = (
    ("kernels", "validation", "workers", "csv_table", "lazy"),
    ("measurement", "message", "tag", "feature", "frame", "model"),
    ("motions", "sensors", "rewards"),
    ("sim", "belief"),  # the truth and what is believed of it: the wall below keeps them apart
    ("scenario",),
    ("layout", "observation", "overrides", "presets"),
    ("world_rule", "world_state"),
    ("sensing", "exchange", "believing", "referee"),
    ("world",),
    ("simulation",),
    ("task", "legend", "spaces", "telling", "specification"),
    ("rendering",),
    ("batch_views",),
    ("single", "vector", "parallel"),
    ("time_of_flight", "range_only", "area_only"),
    ("",),  # envs/__init__.py, which gathers the names that users import
)

# The wall: whoever stands on one side imports nothing from the other, directly or through others. Where the two sides meet, in
# the parameters of a scenario and in the step of a world, a function may be handed both.
BELIEVERS = ("tagtrack.envs.belief", "tagtrack.envs.observation", "tagtrack.envs.believing")
WORLD = ("tagtrack.envs.sim",)
# Names and bounds of the observation follow from a whole scenario, which holds both sides' parameters.
BESIDE_THE_WALL = ("tagtrack.envs.layout",)

ENVS_THIRD_PARTY = {"numpy", "numba", "gymnasium", "pettingzoo"}
TYPES = {"typing_extensions"}  # may be imported for type checkers, which know it, and for them alone
PAINTERS = {"tagtrack.envs.rendering", "tagtrack.envs.legend"}  # alone may import pygame, an extra, inside functions
DISTRIBUTIONS = {
    "stable_baselines3": "stable-baselines3", "sb3_contrib": "sb3-contrib", "pygame": "pygame-ce", "serial": "pyserial",
    "PIL": "pillow",
}  # fmt: skip


@dataclass(frozen=True)
class Import:
    """One import statement's target, and where it stands."""

    importer: str
    target: str
    place: str
    in_function: bool
    for_types_only: bool

    @property
    def top(self) -> str:
        return self.target.partition(".")[0]


def module_name(path: Path) -> str:
    """The name under which a file of the repository is imported: envs/sim/tags.py is tagtrack.envs.sim.tags."""
    parts = list(path.relative_to(REPOSITORY).with_suffix("").parts)
    if parts[-1] == "__init__":
        parts.pop()
    return ".".join(parts if parts[0] == "tagtrack" else ["tagtrack", *parts])


def source_files() -> list[Path]:
    return [path for folder in ("tagtrack", *TOP_FOLDERS) for path in sorted((REPOSITORY / folder).rglob("*.py"))]


SOURCES = {module_name(path): path for path in source_files()}


def is_type_checking(node: ast.If) -> bool:
    return ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


def imports_in(path: Path, importer: str) -> Iterator[Import]:
    """Every import of a file; ``from package import module`` counts as an import of that module."""

    def walk(node: ast.AST, in_function: bool, for_types_only: bool) -> Iterator[Import]:
        for child in ast.iter_child_nodes(node):
            targets: list[str] = []
            if isinstance(child, ast.Import):
                targets = [alias.name for alias in child.names]
            elif isinstance(child, ast.ImportFrom):
                assert child.level == 0, f"{path}:{child.lineno}: relative import"
                names = [f"{child.module}.{alias.name}" for alias in child.names]
                targets = [name if name in SOURCES else str(child.module) for name in names]
            for target in dict.fromkeys(targets):
                yield Import(importer, target, f"{path}:{child.lineno}", in_function, for_types_only)
            function = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            types = isinstance(child, ast.If) and is_type_checking(child)
            yield from walk(child, in_function or function, for_types_only or types)

    yield from walk(ast.parse(path.read_text(encoding="utf-8")), False, False)


IMPORTS = [found for name, path in SOURCES.items() for found in imports_in(path, name)]
OURS = [found for found in IMPORTS if found.top == "tagtrack"]
THIRD_PARTY = [found for found in IMPORTS if found.top not in sys.stdlib_module_names | {"tagtrack", "__future__"}]


def folder_of(module: str) -> str:
    return ".".join(module.split(".")[:2])


def is_within(module: str, package: str) -> bool:
    return module == package or module.startswith(package + ".")


def floor_of(module: str) -> int:
    """Index of a module of envs/ in FLOORS."""
    part = module.split(".")[2] if module.count(".") >= 2 else ""
    for index, parts in enumerate(FLOORS):
        if part in parts:
            return index
    pytest.fail(f"{module} has no floor in FLOORS of tests/test_layout.py: say what it may import")


def complaints(found: list[Import]) -> str:
    return "\n".join(f"{each.place}: {each.importer} imports {each.target}" for each in found)


def test_every_folder_with_modules_is_an_installed_package() -> None:
    packages = PROJECT["tool"]["setuptools"]["packages"]
    folders = {module_name(path / "__init__.py") for path in {source.parent for source in SOURCES.values()}}
    assert sorted(packages) == sorted(folders)
    assert len(packages) == len(set(packages))
    for package in packages:
        assert SOURCES[package].name == "__init__.py", f"{package} has no __init__.py"


def test_package_dir_maps_every_top_folder_into_tagtrack() -> None:
    expected = {"tagtrack": "tagtrack"} | {f"tagtrack.{folder}": folder for folder in TOP_FOLDERS}
    assert PROJECT["tool"]["setuptools"]["package-dir"] == expected


def test_type_checker_sees_the_same_mapping() -> None:
    links = REPOSITORY / ".typecheck" / "tagtrack"
    expected = {folder: REPOSITORY / folder for folder in TOP_FOLDERS}
    expected |= {path.name: path for path in (REPOSITORY / "tagtrack").glob("*.py")}
    assert {link.name: link.resolve() for link in links.iterdir()} == expected
    for link in links.iterdir():
        assert not link.readlink().is_absolute(), f"{link} would break in another folder"


@pytest.mark.parametrize("folder", MAY_IMPORT)
def test_folder_imports_only_what_the_table_allows(folder: str) -> None:
    allowed = (folder, *MAY_IMPORT[folder]) if folder != "tagtrack" else ()
    # The front door itself imports none of ours, so results may read their version from it.
    from_here = [found for found in OURS if folder_of(found.importer) == folder and found.target != "tagtrack"]
    wrong = [found for found in from_here if not any(is_within(found.target, name) for name in (*allowed, "tagtrack.command"))]
    assert not wrong, complaints(wrong)


def test_each_floor_of_envs_is_blind_to_those_above() -> None:
    inside = [found for found in OURS if folder_of(found.importer) == folder_of(found.target) == "tagtrack.envs"]
    wrong = [found for found in inside if floor_of(found.importer) < floor_of(found.target)]
    assert not wrong, complaints(wrong)


def reached_from(package: str) -> set[str]:
    """Modules of ours that a package imports, directly or through others; what type checkers alone see is left out."""
    reached, waiting = set(), [name for name in SOURCES if is_within(name, package)]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += [found.target for found in OURS if found.importer == name and not found.for_types_only]
    return reached


@pytest.mark.parametrize(("side", "other"), [(side, WORLD) for side in BELIEVERS] + [(side, BELIEVERS) for side in WORLD])
def test_wall_keeps_the_truth_and_the_belief_apart(side: str, other: tuple[str, ...]) -> None:
    reached = reached_from(side)
    assert side in reached
    through = sorted(name for name in reached for package in other if is_within(name, package))
    assert not through, f"{side} reaches {', '.join(through)}"


@pytest.mark.parametrize("module", BESIDE_THE_WALL)
def test_layout_of_an_observation_takes_the_truths_parameters_from_the_scenario_alone(module: str) -> None:
    wrong = [found for found in OURS if is_within(found.importer, module) for name in WORLD if is_within(found.target, name)]
    assert not wrong, complaints(wrong)


def test_every_module_of_envs_has_a_floor() -> None:
    for module in SOURCES:
        if is_within(module, "tagtrack.envs"):
            floor_of(module)


def test_front_door_knows_the_environments_by_name_only() -> None:
    found = {each.top for each in IMPORTS if each.importer == "tagtrack"} - {"__future__"} - sys.stdlib_module_names
    assert found == {"gymnasium", "pettingzoo"}


def test_envs_need_only_numpy_numba_gymnasium_and_pettingzoo() -> None:
    def is_allowed(found: Import) -> bool:
        if found.top in TYPES:
            return found.for_types_only
        if found.top == "pygame":
            return found.importer in PAINTERS and (found.in_function or found.for_types_only)
        return found.top in ENVS_THIRD_PARTY

    wrong = [found for found in THIRD_PARTY if folder_of(found.importer) == "tagtrack.envs" and not is_allowed(found)]
    assert not wrong, complaints(wrong)


def test_every_import_is_a_declared_dependency_and_optional_ones_wait_in_functions() -> None:
    def names(requirements: list[str]) -> set[str]:
        return {re.split(r"[\[<>=!~; ]", requirement, maxsplit=1)[0] for requirement in requirements}

    extras = PROJECT["project"]["optional-dependencies"]
    required = names(PROJECT["project"]["dependencies"])
    optional = names([each for name, extra in extras.items() if name != "dev" for each in extra]) | {"h5py"}  # minari[hdf5]

    def is_declared(found: Import) -> bool:
        if found.top in TYPES:
            return found.for_types_only
        name = DISTRIBUTIONS.get(found.top, found.top)
        return name in required or (name in optional and (found.in_function or found.for_types_only))

    wrong = [found for found in THIRD_PARTY if not is_declared(found)]
    assert not wrong, complaints(wrong)


def test_nothing_imports_a_folder_by_its_bare_name() -> None:
    tests = [found for path in sorted((REPOSITORY / "tests").rglob("*.py")) for found in imports_in(path, path.stem)]
    wrong = [found for found in IMPORTS + tests if found.top in TOP_FOLDERS]
    assert not wrong, complaints(wrong)


def test_no_module_is_loaded_under_a_second_name(run_python: Callable[..., str]) -> None:
    modules = [name for name in SOURCES if not name.endswith("__main__")]
    code = "import sys, importlib\nfor name in sys.argv[1:]: importlib.import_module(name)\nprint(*sys.modules)"
    loaded = set(run_python(code, *modules).split())
    assert loaded.issuperset(modules)
    bare = {name for name in loaded if name.partition(".")[0] in TOP_FOLDERS}
    assert not bare


def test_version_is_the_same_in_package_and_citation() -> None:
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "tagtrack.__version__"}
    cited = re.search(r"^version: (.+)$", (REPOSITORY / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert cited is not None
    assert cited.group(1) == tagtrack.__version__
