"""What a release tells of versions: the files for pip and the entries for other projects' lists agree with pyproject.toml."""

from __future__ import annotations

import re
import sys
import zipfile
from pathlib import Path

from tests.harness.release_venv import requirements, without_torch

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REPOSITORY = Path(__file__).resolve().parents[1]


def dependencies() -> list[str]:
    return tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]


def constraints(name: str) -> set[str]:
    lines = (REPOSITORY / name).read_text(encoding="utf-8").splitlines()
    return {line for line in lines if line and not line.startswith("#")}


def test_ranges_for_consumers_are_those_of_the_package() -> None:
    assert constraints("constraints-consumers.txt") == {each for each in dependencies() if ">" in each}


def test_oldest_versions_are_the_lower_bounds_of_the_package() -> None:
    bounds = (re.fullmatch(r"([\w-]+)>=([\d.]+)(?:,<\d+)?", each) for each in dependencies() if not each.startswith("torch"))
    assert constraints("constraints-lowest.txt") == {f"{bound[1]}=={bound[2]}.*" for bound in bounds if bound}
    assert all(">=" in each for each in dependencies())


def test_entries_for_the_lists_of_environments_name_the_tested_versions() -> None:
    page = (REPOSITORY / "docs" / "release.md").read_text(encoding="utf-8")
    for name in ("Gymnasium", "PettingZoo"):
        (version,) = (line.partition("==")[2] for line in constraints("constraints.txt") if line.startswith(f"{name.lower()}=="))
        assert f"/badge/{name}-v{version}-blue" in page


def test_wheel_without_torch_needs_all_else_and_no_extra(tmp_path: Path) -> None:
    wheel = tmp_path / "tagtrack.whl"
    needs = ("torch<3,>=2.8", "numpy>=1.26", 'ruff; extra == "dev"')
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("tagtrack-1.dist-info/METADATA", "\n".join(f"Requires-Dist: {each}" for each in needs))
    assert requirements(wheel) == ["torch<3,>=2.8", "numpy>=1.26"]
    assert without_torch(requirements(wheel)) == ["numpy>=1.26"]
