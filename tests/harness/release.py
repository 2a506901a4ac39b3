"""What a release must be, gone through: versions, a wheel and an sdist, an empty venv of each Python, strict types.

    python -m tests.harness.release [--python PYTHON ...] [--constraint FILE ...] [--keep DIR]

The wheel is built from the sdist and installed where nothing else is, in each Python with each file of versions: constraints.txt
(tested), constraints-consumers.txt (the newest ones allowed), constraints-lowest.txt (the oldest, on Python 3.11). Downloads some
400 MB the first time. What a program cannot check is printed as a list at the end.
"""

from __future__ import annotations

import argparse
import datetime
import itertools
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

from tests.harness.release_venv import Checks, try_out

ROOT = Path(__file__).resolve().parents[2]
BY_HAND = (
    "CHANGELOG.md: [Unreleased] is renamed to the version with its date, and an empty [Unreleased] begins",
    "an id whose dynamics, observation or reward changed has a new -vN",
    "make test, make test ARGS='-m slow', make kill, make fuzz ARGS=1e5 and make soak ARGS=3600 have passed on this commit",
    "the tables of the README stand beside the commands that made them, and those were run on this commit",
    "a tag vVERSION on the commit, signed",
    "the lists of environments of Gymnasium and PettingZoo: their entries, with all that they need, stand in docs/release.md",
)


def check_versions(checks: Checks) -> str:
    """One version everywhere; a citation that names it."""
    import tagtrack

    version = tagtrack.__version__
    checks.note(f"version {version} is a semantic one", bool(re.fullmatch(r"\d+\.\d+\.\d+(-[\w.]+)?", version)))
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    cited = re.search(r"^version: (\S+)$", citation, re.MULTILINE)
    checks.note("CITATION.cff names it", cited is not None and cited[1] == version)
    told = all(f"\n{key}:" in citation for key in ("title", "authors", "license"))
    checks.note("CITATION.cff has a title, authors and a licence", told)
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    checks.note("CHANGELOG.md tells what is new", f"## [{version}]" in changes or "## [Unreleased]" in changes)
    changed = subprocess.run(["git", "status", "--porcelain"], cwd=ROOT, capture_output=True, text=True).stdout
    checks.note("all is committed", not changed, changed.strip()[:200])
    return version


def build(checks: Checks, place: Path, version: str) -> Path:
    """The wheel, made from the sdist, which was made from the files that git knows."""
    source = place / "source"
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, files.split("\0")):
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, source / name)
    dist = place / "dist"
    code = f"from setuptools import build_meta; build_meta.build_sdist({str(dist)!r})"
    checks.run("an sdist is built", sys.executable, "-c", code, cwd=source)
    (sdist,) = dist.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
        archive.extractall(place / "unpacked", filter="data")
    kept = ("LICENSE", "CITATION.cff", "CHANGELOG.md", "Makefile", "constraints.txt", "tests/conftest.py", "envs/scenario.py")
    for name in kept:
        checks.note(f"the sdist holds {name}", name in names)
    (unpacked,) = (place / "unpacked").iterdir()
    pip = (sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation")
    checks.run("a wheel is built from it", *pip, "-w", dist, unpacked)
    (wheel,) = dist.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        tops = {name.partition("/")[0] for name in archive.namelist()}
        inside = set(archive.namelist())
    checks.note("the wheel installs nothing but tagtrack", tops == {"tagtrack", f"tagtrack-{version}.dist-info"}, str(tops))
    wanted = {"tagtrack/py.typed", "tagtrack/policies/box/LeopardShark/policy.json"}
    checks.note("the wheel is typed and has policies", wanted <= inside)
    return wheel


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.harness.release", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--python", nargs="+", default=[sys.executable], help="of the empty venvs (this one)")
    tested = [ROOT / "constraints.txt"]
    parser.add_argument("--constraint", nargs="+", type=Path, default=tested, help="versions to install (constraints.txt)")
    parser.add_argument("--keep", metavar="DIR", type=Path, help="where wheel and sdist are left (nowhere)")
    asked = parser.parse_args()
    checks = Checks()
    with tempfile.TemporaryDirectory(prefix="tagtrack-release-") as folder:
        place = Path(folder)
        version = check_versions(checks)
        wheel = build(checks, place, version)
        for python, constraints in itertools.product(asked.python, asked.constraint):
            print(f"\n{python} with {constraints.name}")
            try_out(checks, place, wheel, python, constraints.resolve(), version)
        if asked.keep:
            shutil.copytree(place / "dist", asked.keep, dirs_exist_ok=True)
    print(f"\n{datetime.date.today()}, version {version}. By hand:")
    print("".join(f"[ ] {line}\n" for line in BY_HAND), end="")
    for line in checks.left_out:
        print(f"not tried: {line}")
    failed = "".join(f"\n    {what}" for what in checks.failed)
    print(f"{len(checks.failed)} failed:{failed}" if checks.failed else "all that was checked is good")
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())
