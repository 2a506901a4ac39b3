"""A wheel in an empty venv of some Python: installed with what it depends on, imported, driven, trained with, type-checked.

Where that Python has no CPU build of torch, the wheel is tried without torch and Stable-Baselines3: environments, heuristics,
learned policies and benchmarks need neither. What was left out is told as such.
"""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TORCH_INDEX = "https://download.pytorch.org/whl/cpu"
NEEDS_TORCH = ("torch", "stable-baselines3")
STRANGER = ROOT / "tests" / "harness" / "typed"
SMALL = ("--set", "episode_steps=10", "--particles", "40", "--episodes", "4")
TRAIN = (
    "train", "--steps", "64", "--num-envs", "8", "--particles", "32", "--validation-episodes", "2", "--set", "episode_steps=8",
)  # fmt: skip


class Checks:
    """A line for each check; what failed, and what could not be tried."""

    def __init__(self) -> None:
        self.failed: list[str] = []
        self.left_out: list[str] = []

    def note(self, what: str, good: bool, why: str = "") -> None:
        print(f"{'ok    ' if good else 'FAILED'}  {what}{'' if good or not why else f': {why}'}", flush=True)
        if not good:
            self.failed.append(what)

    def leave_out(self, what: str) -> None:
        print(f"less    {what}", flush=True)
        self.left_out.append(what)

    def run(self, what: str, *command: str | Path, cwd: Path = ROOT) -> str:
        done = subprocess.run([str(word) for word in command], cwd=cwd, capture_output=True, text=True)
        self.note(what, done.returncode == 0, " ".join((done.stderr or done.stdout).split())[-300:])
        return done.stdout


def requirements(wheel: Path) -> list[str]:
    """What a wheel depends on, its extras aside."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        lines = archive.read(name).decode().splitlines()
    return [line.partition(": ")[2] for line in lines if line.startswith("Requires-Dist: ") and "extra ==" not in line]


def without_torch(needed: list[str]) -> list[str]:
    """The requirements that remain where there is no torch."""
    return [each for each in needed if not each.startswith(NEEDS_TORCH)]


def try_out(checks: Checks, place: Path, wheel: Path, python: str, constraints: Path, version: str) -> None:
    """Install the wheel where nothing is, and use it from a folder where nothing lies."""
    venv, empty = place / "venv", place / "empty"
    for folder in (venv, empty):
        shutil.rmtree(folder, ignore_errors=True)
    empty.mkdir()
    checks.run(f"an empty venv of {python}", python, "-m", "venv", venv)
    inside, tagtrack = venv / "bin" / "python", venv / "bin" / "tagtrack"
    pip = (inside, "-m", "pip", "install", "-q", "--disable-pip-version-check", "--constraint", constraints)
    torch = (*pip, "--no-deps", "--only-binary=:all:", "--index-url", TORCH_INDEX, "torch")
    whole = subprocess.run([str(word) for word in torch], capture_output=True).returncode == 0
    if whole:
        checks.run("the wheel and what it depends on", *pip, wheel)
        checks.run("its dependencies agree", inside, "-m", "pip", "check")
    else:
        checks.leave_out(f"no CPU build of torch for {python}: no training there, nor any check of types")
        checks.run("what the wheel depends on, without torch", *pip, *without_torch(requirements(wheel)))
        checks.run("the wheel", *pip, "--no-deps", wheel)
    told = checks.run("tagtrack --version", tagtrack, "--version", cwd=empty)
    checks.note("it tells its version", told.strip() == version, told)
    for program in ("driver.py", "consumer.py"):
        shutil.copy2(STRANGER / program, empty / program)
    print(checks.run("environments run", inside, "-W", "error::DeprecationWarning", "driver.py", cwd=empty), end="")
    benchmark = ("eval", "benchmark", *SMALL, "--out", "b", "--policies", "pursuit", "learned")
    checks.run("tagtrack eval benchmark", tagtrack, *benchmark, cwd=empty)
    if whole:
        checks.run("tagtrack train", tagtrack, *TRAIN, "--out", "run", cwd=empty)
        checks.run("its run takes part in a benchmark", tagtrack, *benchmark, "run", cwd=empty)
        check_types(checks, inside, pip, empty)


def check_types(checks: Checks, inside: Path, pip: tuple[str | Path, ...], empty: Path) -> None:
    """A stranger's program passes the strictest checkers beside the installed wheel, and does what it says."""
    checks.run("mypy and pyright", *pip, "mypy", "pyright")
    checks.run("a strict program passes mypy", inside, "-m", "mypy", "--strict", "consumer.py", cwd=empty)
    # pyright asks the `python` of the path where packages lie, not the one that started it.
    checks.run("a program passes pyright", inside, "-m", "pyright", "--pythonpath", inside, "consumer.py", cwd=empty)
    checks.run("it runs", inside, "consumer.py", cwd=empty)
