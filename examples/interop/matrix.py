"""Runs a script of each library that people train with, in an environment of its own, and writes docs/interop.md.

    make interop                       all of them
    make interop ARGS="rllib skrl"     some; the others' rows stay

Libraries that agree with constraints.txt share one environment; those whose pins refuse it have one each, within the ranges of
constraints-consumers.txt.
"""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys
import venv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
PLACE = REPOSITORY / ".interop"  # environments and results; not part of the repository
PAGE = REPOSITORY / "docs" / "interop.md"
MOST_LINES = 2  # that name TagTrack
SHARED = "tested"
TORCH_INDEX = os.environ.get("TORCH_INDEX", "https://download.pytorch.org/whl/cpu")


@dataclass(frozen=True, kw_only=True)
class Library:
    """One row: what to install, which script to run."""

    name: str
    script: str
    packages: tuple[str, ...]  # the first one's version is told
    environment: str = SHARED


LIBRARIES = {
    "sb3": Library(name="Stable-Baselines3", script="sb3", packages=("stable-baselines3",)),
    "sb3-contrib": Library(name="sb3-contrib", script="sb3_contrib_recurrent", packages=("sb3-contrib",)),
    "cleanrl": Library(name="a CleanRL script", script="cleanrl_ppo", packages=("torch",)),
    "torchrl": Library(name="TorchRL", script="torchrl_collect", packages=("torchrl",)),
    "skrl": Library(name="skrl", script="skrl_ppo", packages=("skrl",)),
    "supersuit": Library(name="SuperSuit", script="supersuit_sb3", packages=("supersuit",)),
    "minari": Library(name="Minari and d3rlpy", script="minari_d3rlpy", packages=("minari[create,hdf5]", "d3rlpy")),
    "rl_zoo3": Library(name="rl_zoo3", script="rl_zoo3_train", packages=("rl_zoo3",), environment="rl_zoo3"),
    "tianshou": Library(name="Tianshou", script="tianshou_ppo", packages=("tianshou[eval]",), environment="tianshou"),
    "rllib": Library(name="RLlib", script="rllib_ppo", packages=("ray[rllib]",), environment="rllib"),
    "agilerl": Library(name="AgileRL", script="agilerl_ppo", packages=("agilerl", "peft"), environment="agilerl"),
}


def own_lines(script: str) -> list[str]:
    """The lines of a script that name TagTrack: what its user writes because of us."""
    text = (HERE / f"{script}.py").read_text(encoding="utf-8")
    code = re.sub(r'^""".*?"""', "", text, count=1, flags=re.DOTALL)
    return [line.strip() for line in code.splitlines() if "tagtrack" in line.lower()]


@lru_cache
def make_environment(name: str) -> str | None:
    """Install what its libraries need, once; what is wrong, in a line, or None."""
    together = [each.packages for each in LIBRARIES.values() if each.environment == name]
    packages = sorted({package for packages in together for package in packages})
    folder = PLACE / name
    python = folder / "bin" / "python"
    if not python.exists():
        venv.create(folder, with_pip=True, clear=True)
    pip = [str(python), "-m", "pip", "--disable-pip-version-check", "install", "-q"]
    ranges = REPOSITORY / ("constraints.txt" if name == SHARED else "constraints-consumers.txt")
    pinned = ["-c", str(REPOSITORY / "constraints.txt"), "torch"]
    cpu = run([*pip, "--no-deps", "--index-url", TORCH_INDEX, "--retries", "0", "--timeout", "10", *pinned], 600)
    torch = run([*pip, *pinned], 1200) if cpu.returncode else cpu
    own = run([*pip, "-c", str(ranges), "-e", str(REPOSITORY), *packages], 1200) if not torch.returncode else torch
    return None if not own.returncode else last_words(own)


def run(command: Sequence[str], seconds: float) -> subprocess.CompletedProcess[str]:
    """Run a command; one that takes too long has failed."""
    quiet = {"TQDM_DISABLE": "1", "OMP_NUM_THREADS": "1", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
    try:
        return subprocess.run(
            command, capture_output=True, text=True, timeout=seconds, cwd=PLACE, env={**os.environ, **quiet}
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 124, "", f"no end after {seconds:.0f} s")


def last_words(done: subprocess.CompletedProcess[str]) -> str:
    """The line that says what went wrong."""
    lines = [line.strip() for line in (done.stderr or done.stdout).splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR: ")]
    return (errors or lines or ["it ended without a word"])[0 if errors else -1][:160]


def measure(library: Library) -> dict[str, Any]:
    """A row of the table: version, steps a second, or what is wrong."""
    row: dict[str, Any] = {"lines": own_lines(library.script)}
    wrong = make_environment(library.environment)
    if wrong is not None:
        return {**row, "state": f"does not install here: {wrong}"}
    python = str(PLACE / library.environment / "bin" / "python")
    command = [python, str(HERE / "measure.py"), str(HERE / f"{library.script}.py")]
    done = run(command, 600)
    if "TagTrack compiles" in done.stderr:  # once; that is not what a step costs
        done = run(command, 600)
    row["version"] = find_version(python, library.packages)
    found = re.findall(r'^\{"steps": .*\}$', done.stdout, re.MULTILINE)
    if done.returncode or not found:
        return {**row, "state": f"fails: {last_words(done)}"}
    told = json.loads(found[-1])
    return {**row, "state": "runs", **told, "rate": told["steps"] / told["seconds"]}


def find_version(python: str, packages: Sequence[str]) -> str:
    """Of each package that is installed."""
    names = [re.split(r"[\[<>=]", package)[0] for package in packages]
    code = "import sys; from importlib.metadata import version; print(*[version(name) for name in sys.argv[1:]])"
    return run([python, "-c", code, *names], 60).stdout.strip().replace(" ", ", ")


def write_page(rows: Mapping[str, Mapping[str, Any]]) -> str:
    """The page, in Markdown."""
    table = ["| library | version | script | state | steps/s |", "|---|---|---|---|---|"]
    for key, library in LIBRARIES.items():
        row = rows.get(key, {"state": "not run yet"})
        rate = f"{row['rate']:,.0f}" if "rate" in row else ""
        script = f"[{library.script}.py](../examples/interop/{library.script}.py)"
        table.append(f"| {library.name} | {row.get('version', '')} | {script} | {row['state']} | {rate} |")
    lines = []
    for library in LIBRARIES.values():
        lines += [f"{library.name}:", "", "```py", *own_lines(library.script), "```", ""]
    page = (HERE / "page.md").read_text(encoding="utf-8")
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}"
    for name, text in {"TABLE": "\n".join(table), "LINES": "\n".join(lines).strip(), "MACHINE": machine}.items():
        page = page.replace(f"<{name}>", text)
    return page


def main(names: Sequence[str]) -> int:
    """Run the named libraries, or all; 0 where all of these run."""
    unknown = [name for name in names if name not in LIBRARIES]
    if unknown:
        print(f"error: unknown library {unknown[0]!r}; known: {', '.join(LIBRARIES)}", file=sys.stderr)
        return 2
    PLACE.mkdir(exist_ok=True)
    results = PLACE / "results.json"
    rows = json.loads(results.read_text(encoding="utf-8")) if results.exists() else {}
    chosen = list(names) or list(LIBRARIES)
    for name in chosen:
        rows[name] = measure(LIBRARIES[name])
        rate = f", {rows[name]['rate']:,.0f} steps/s" if "rate" in rows[name] else ""
        print(f"{LIBRARIES[name].name:20} {rows[name].get('version', ''):20} {rows[name]['state']}{rate}", flush=True)
        results.write_text(json.dumps(rows, indent=1), encoding="utf-8")
        PAGE.write_text(write_page(rows), encoding="utf-8")
    print(f"wrote {PAGE.relative_to(REPOSITORY)}")
    return int(any(rows[name]["state"] != "runs" for name in chosen))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
