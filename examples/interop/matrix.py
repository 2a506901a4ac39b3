"""Runs a script of each library that people train with, in an environment of its own, and writes docs/interop.md.

    make interop                       those that have not run yet, or whose script or pins have changed since
    make interop ARGS="rllib skrl"     these, once more; the others' rows stay
    make interop ARGS=all              all of them, once more

First all environments are made, then the scripts run one after the other, so that their speeds come from one quarter of an hour.
Libraries that agree with constraints.txt are tried with these versions, the others within the ranges of
constraints-consumers.txt. What is finished is kept in .interop, so a call that was stopped goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tagtrack.policies.files import replace_file

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
PLACE = REPOSITORY / ".interop"  # environments and results; not part of the repository
PAGE = REPOSITORY / "docs" / "interop.md"
PINS, RANGES = REPOSITORY / "constraints.txt", REPOSITORY / "constraints-consumers.txt"
MOST_LINES = 2  # that name TagTrack
TORCH_INDEX = os.environ.get("TORCH_INDEX", "https://download.pytorch.org/whl/cpu")
QUIET = {"TQDM_DISABLE": "1", "OMP_NUM_THREADS": "1", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
RUNS = "runs"
REPEATS = 3  # of which the fastest counts: compiling and other load only make them slower


@dataclass(frozen=True, kw_only=True)
class Library:
    """One row: what to install, which script to run."""

    name: str
    script: str
    packages: tuple[str, ...]  # their versions are told
    constraints: Path = PINS


LIBRARIES = {
    "sb3": Library(name="Stable-Baselines3", script="sb3", packages=("stable-baselines3",)),
    "sb3-contrib": Library(name="sb3-contrib", script="sb3_contrib_recurrent", packages=("sb3-contrib",)),
    "rl_zoo3": Library(name="rl_zoo3", script="rl_zoo3_train", packages=("rl_zoo3",), constraints=RANGES),
    "cleanrl": Library(name="a CleanRL script", script="cleanrl_ppo", packages=("torch",)),
    "torchrl": Library(name="TorchRL", script="torchrl_collect", packages=("torchrl",)),
    "rllib": Library(name="RLlib", script="rllib_ppo", packages=("ray[rllib]",), constraints=RANGES),
    "tianshou": Library(name="Tianshou", script="tianshou_ppo", packages=("tianshou[eval]",), constraints=RANGES),
    "skrl": Library(name="skrl", script="skrl_ppo", packages=("skrl",)),
    "agilerl": Library(name="AgileRL", script="agilerl_ppo", packages=("agilerl", "peft"), constraints=RANGES),
    "supersuit": Library(name="SuperSuit", script="supersuit_sb3", packages=("supersuit",)),
    "minari": Library(name="Minari and d3rlpy", script="minari_d3rlpy", packages=("minari[create,hdf5]", "d3rlpy")),
}


def own_lines(script: str) -> list[str]:
    """The lines of a script that name TagTrack: what its user writes because of us."""
    text = (HERE / f"{script}.py").read_text(encoding="utf-8")
    code = re.sub(r'^""".*?"""', "", text, count=1, flags=re.DOTALL)
    return [line.strip() for line in code.splitlines() if "tagtrack" in line.lower()]


def pinned_torch() -> str:
    """As constraints.txt has it. Asked for everywhere: no library may trade the CPU build for gigabytes of CUDA."""
    found = re.search(r"^torch==\S+", PINS.read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None
    return found[0]


def python_of(key: str) -> str:
    """The interpreter of a library's environment."""
    return str(PLACE / key / "bin" / "python")


def recipe(library: Library) -> str:
    """What its environment is made of."""
    return "\n".join((platform.python_version(), *library.packages, library.constraints.read_text(encoding="utf-8")))


def make_environment(key: str) -> str | None:
    """Install what a library needs, once; what is wrong, in a line, or None."""
    library = LIBRARIES[key]
    ready = PLACE / key / ".ready"
    if ready.exists() and ready.read_text(encoding="utf-8") == recipe(library):
        return None
    made = run([sys.executable, "-m", "venv", "--clear", str(PLACE / key)], 300)
    if not made.returncode:
        made = install(python_of(key), library)
    if made.returncode:
        return last_words(made)
    ready.write_text(recipe(library), encoding="utf-8")
    return None


def install(python: str, library: Library) -> subprocess.CompletedProcess[str]:
    """torch comes first, and alone: its CPU build satisfies what asks for torch later."""
    pip = [python, "-m", "pip", "--disable-pip-version-check", "install", "-q", "--no-compile"]  # most is never imported
    index = ["--no-deps", "--index-url", TORCH_INDEX, "--retries", "0", "--timeout", "10"]
    torch = run([*pip, *index, pinned_torch()], 900)
    if torch.returncode:  # no network there, or no build for this machine: the default index has one
        torch = run([*pip, "-c", str(PINS), pinned_torch()], 1800)
    if torch.returncode:
        return torch
    return run([*pip, "-c", str(library.constraints), pinned_torch(), "-e", str(REPOSITORY), *library.packages], 1800)


def run(command: Sequence[str], seconds: float) -> subprocess.CompletedProcess[str]:
    """Run a command; one that takes too long has failed. With it end the processes that it started."""
    environment = {**os.environ, **QUIET}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=PLACE, env=environment, start_new_session=True
    ) as process:
        try:
            out, error = process.communicate(timeout=seconds)
        except BaseException as why:
            os.killpg(process.pid, signal.SIGKILL)
            if not isinstance(why, subprocess.TimeoutExpired):  # but Ctrl-C, or a kill
                raise
            return subprocess.CompletedProcess(command, 124, "", f"no end after {seconds:.0f} s")
    return subprocess.CompletedProcess(command, process.returncode, out, error)


def last_words(done: subprocess.CompletedProcess[str]) -> str:
    """The line that says what went wrong, fit for a table."""
    lines = [line.strip() for line in (done.stderr or done.stdout).splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR: ")]
    return (errors or lines or ["it ended without a word"])[0 if errors else -1][:160].replace("|", "/")


def measure(key: str, wrong: str | None) -> dict[str, Any]:
    """A row of the table: version, steps a second, or what is ``wrong`` with the environment, or with the run."""
    library = LIBRARIES[key]
    row: dict[str, Any] = {"of": digest(library)}
    if wrong is not None:
        return {**row, "state": f"does not install here: {wrong}"}
    row["version"] = find_versions(python_of(key), library.packages)
    command = [python_of(key), str(HERE / "measure.py"), str(HERE / f"{library.script}.py")]
    rates = []
    for _ in range(REPEATS):
        done = run(command, 900)
        found = re.findall(r'^\{"steps": .*\}$', done.stdout, re.MULTILINE)
        if done.returncode or not found:
            return {**row, "state": f"fails: {last_words(done)}"}
        told = json.loads(found[-1])
        rates.append(told["steps"] / told["seconds"])
    return {**row, "state": RUNS, "rates": rates, "rate": max(rates)}


def digest(library: Library) -> str:
    """Of all that a row depends on, TagTrack's own code apart: another digest, and the row is missing."""
    script = (HERE / f"{library.script}.py").read_text(encoding="utf-8")
    return hashlib.sha256((script + recipe(library)).encode()).hexdigest()[:16]


def find_versions(python: str, packages: Sequence[str]) -> str:
    """Of each package, with its name."""
    names = [re.split(r"[\[<>=]", package)[0] for package in packages]
    code = "import sys, importlib.metadata as m; print(', '.join(f'{name} {m.version(name)}' for name in sys.argv[1:]))"
    return run([python, "-c", code, *names], 60).stdout.strip()


def write_page(rows: Mapping[str, Mapping[str, Any]], before: str = "") -> str:
    """The page, in Markdown; libraries without a row keep what the page said ``before``."""
    table = ["| library | version | script | state | steps/s |", "|---|---|---|---|---|"]
    for key, library in LIBRARIES.items():
        script = f"[{library.script}.py](../examples/interop/{library.script}.py)"
        old = [line for line in before.splitlines() if line.startswith("|") and script in line]
        if key not in rows and old:
            table.append(old[0])
            continue
        row = rows.get(key, {"state": "not run yet"})
        rate = f"{row['rate']:,.0f}" if "rate" in row else ""
        table.append(f"| {library.name} | {row.get('version', '')} | {script} | {row['state']} | {rate} |")
    lines = []
    for library in LIBRARIES.values():
        lines += [f"{library.name}:", "", "```py", *own_lines(library.script), "```", ""]
    page = (HERE / "page.md").read_text(encoding="utf-8")
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}"
    for name, text in {"TABLE": "\n".join(table), "LINES": "\n".join(lines).strip(), "MACHINE": machine}.items():
        page = page.replace(f"<{name}>", text)
    return page


def choose(names: Sequence[str], rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Which libraries to run: the named ones, all, or those of which no row tells how they run now."""
    if "all" in names:
        return list(LIBRARIES)
    return list(names) or [
        key for key, library in LIBRARIES.items()
        if rows.get(key, {}).get("state") != RUNS or rows[key].get("of") != digest(library)
    ]  # fmt: skip


def main(names: Sequence[str]) -> int:
    """Run the named libraries, or what is missing; 0 where all of these run."""
    unknown = [name for name in names if name not in (*LIBRARIES, "all")]
    if unknown:
        print(f"error: unknown library {unknown[0]!r}; known: all, {', '.join(LIBRARIES)}", file=sys.stderr)
        return 2
    PLACE.mkdir(exist_ok=True)
    results = PLACE / "results.json"
    rows = json.loads(results.read_text(encoding="utf-8")) if results.exists() else {}
    chosen = choose(names, rows)
    wrong = {}
    for number, key in enumerate(chosen, 1):
        begun = time.monotonic()
        wrong[key] = make_environment(key)
        print(f"{number:2}/{len(chosen)} {key}: {wrong[key] or 'installed'} ({time.monotonic() - begun:.0f} s)", flush=True)
    for key in chosen:
        rows[key] = measure(key, wrong[key])
        rate = f", {rows[key]['rate']:,.0f} steps/s" if "rate" in rows[key] else ""
        print(f"{LIBRARIES[key].name:20} {rows[key].get('version', ''):20} {rows[key]['state']}{rate}", flush=True)
        with replace_file(results) as partial:
            partial.write_text(json.dumps(rows, indent=1), encoding="utf-8")
        page = write_page(rows, PAGE.read_text(encoding="utf-8") if PAGE.exists() else "")
        with replace_file(PAGE) as partial:
            partial.write_text(page, encoding="utf-8")
    print(f"{PAGE.relative_to(REPOSITORY)} tells of all; once more: make interop ARGS=all, or the names of some")
    return int(any(rows[key]["state"] != RUNS for key in chosen))


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    sys.exit(main(sys.argv[1:]))
