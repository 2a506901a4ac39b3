"""``tagtrack train``, ``tagtrack eval``, ``tagtrack live``: the three command lines under one name."""

from __future__ import annotations

import importlib
import sys

COMMANDS = {
    "train": "train a policy (PPO, SAC)",
    "eval": "compare, tune and check policies; repeat the papers; locate tags by moored receivers",
    "live": "recorded missions and vehicles at sea",
}
HELP = "usage: tagtrack COMMAND ...\n\n" + "\n".join(f"  {name:<7}{text}" for name, text in COMMANDS.items())
HELP += "\n\ntagtrack COMMAND --help says more."


def main() -> int:
    """Run the command that is named first."""
    given = sys.argv[1:]
    if not given or given[0] in ("-h", "--help"):
        print(HELP)
        return 0 if given else 2
    if given[0] == "--version":
        import tagtrack

        print(tagtrack.__version__)
        return 0
    if given[0] not in COMMANDS:
        print(f"error: unknown command {given[0]!r}; known: {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    try:
        return int(importlib.import_module(f"tagtrack.{given[0]}.cli").main(given[1:]))
    except ImportError as missing:  # a package, or numba's leave to compile
        print(f"error: {missing}", file=sys.stderr)
        return 2
    except SystemExit as stop:  # the help was shown
        return int(stop.code or 0)
