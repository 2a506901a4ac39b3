"""``tagtrack train``, ``tagtrack eval``, ``tagtrack live``: the three command lines under one name.

Strings and the standard library alone: `--help` has to answer at once, and a vehicle has nothing else.
"""

from __future__ import annotations

import importlib
import os
import shlex
import shutil
import sys
import textwrap
from pathlib import Path

COMMANDS = {
    "train": "train a policy (PPO, SAC)",
    "eval": "compare, film, tune and check policies; repeat the papers; locate tags by moored receivers",
    "live": "recorded missions and vehicles at sea",
}
COMPLETION = "completion"
SHELLS = ("bash", "zsh", "tcsh")
EXAMPLES = """examples
  tagtrack train --env LeopardShark-v0 --steps 1e5
  tagtrack eval benchmark --policies three_step learned
  source <(tagtrack completion bash)"""


def help_text() -> str:
    """What `tagtrack --help` shows."""
    shells = f"print what makes a shell complete these commands: {', '.join(SHELLS)}"
    more = {COMPLETION: shells, "--version": "print the version"}
    return f"usage: tagtrack COMMAND ...\n\n{listing(COMMANDS | more)}\n\ntagtrack COMMAND --help says more.\n\n{EXAMPLES}"


def listing(entries: dict[str, str]) -> str:
    """Names and what they are, a line or more for each, no wider than the terminal."""
    width = max(shutil.get_terminal_size().columns, 30)
    column = 4 + max(map(len, entries))
    lines = []
    for name, text in entries.items():
        lines.append(textwrap.fill(text, width, initial_indent=f"  {name:<{column - 2}}", subsequent_indent=" " * column))
    return "\n".join(lines)


def main() -> int:
    """Run the command that is named first; whoever reads what it prints may stop reading."""
    try:
        status = run(sys.argv[1:])
        sys.stdout.flush()
        return status
    except KeyboardInterrupt:  # while modules were still being loaded
        print("\nstopped; nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        print_no_more()
        return 1


def print_no_more() -> None:
    """Nobody reads what is printed: it goes nowhere from now on, nor does Python's own last flush fail."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def run(given: list[str]) -> int:
    """The exit status of a command line."""
    if not given or given[0] in ("-h", "--help"):
        print(help_text())
        return 0 if given else 2
    if given[0] == "--version":
        import tagtrack

        print(tagtrack.__version__)
        return 0
    if given[0] == COMPLETION:
        return complete(given[1:])
    if given[0] not in COMMANDS:
        print(f"error: unknown command {given[0]!r}; known: {', '.join(COMMANDS)}, {COMPLETION}", file=sys.stderr)
        return 2
    try:
        return int(importlib.import_module(f"tagtrack.{given[0]}.cli").main(given[1:]))
    except ImportError as missing:  # a package, or numba's leave to compile
        print(f"error: {missing}", file=sys.stderr)
        return 2
    except SystemExit as stop:  # the help was shown
        return int(stop.code or 0)


def complete(given: list[str]) -> int:
    """Print the script that completes ``tagtrack`` in a shell."""
    if len(given) != 1 or given[0] not in SHELLS:
        print(f"error: name a shell: tagtrack {COMPLETION} {'|'.join(SHELLS)}", file=sys.stderr)
        return 2
    print(importlib.import_module("tagtrack.train.completion").completion_script(given[0]))
    return 0


def tagtrack_here() -> str:
    """What a user types for ``tagtrack`` where they are: the name alone if the shell finds this installation's, else a path."""
    beside = Path(sys.executable).parent / "tagtrack"
    found = shutil.which("tagtrack")
    if found is not None and (not beside.exists() or os.path.samefile(found, beside)):
        return "tagtrack"
    if beside.exists():
        relative = os.path.relpath(beside)
        return shlex.quote(str(beside) if relative.startswith("..") else relative)
    return f"{shlex.quote(sys.executable)} -m tagtrack"
