"""`tagtrack eval`: one command each for comparing, filming, tuning, timing, checking, calibrating and repeating the papers."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from typing import Any

from tagtrack.command import listing, tagtrack_here
from tagtrack.eval.parsing import parse_options

# Command -> where its options stand, and what it does. Only the one that is named is imported: the others' numba can wait.
COMMANDS = {
    "benchmark": ("tagtrack.eval.benchmark:Benchmark", "policies on the same fish: table, JSON, pictures, report.html"),
    "video": ("tagtrack.eval.video:Video", "one episode of some policies as an animated GIF"),
    "watch": ("tagtrack.eval.video:Watch", "a policy in a window, while it runs"),
    "suite": ("tagtrack.eval.suite:Suite", "every environment by one protocol, and one score"),
    "aggregate": ("tagtrack.eval.aggregate:Aggregate", "one ratio over several tasks, from benchmarks"),
    "tune": ("tagtrack.eval.tune:Tune", "the number of a baseline that tracks best"),
    "tradeoff": ("tagtrack.eval.tradeoff:Tradeoff", "knowing where the fish is against keeping away from it"),
    "headroom": ("tagtrack.eval.headroom:Headroom", "how much better than a policy one could steer"),
    "messages": ("tagtrack.eval.messages:Messages", "what talking is worth to a fleet"),
    "consistency": ("tagtrack.eval.check_consistency:Consistency", "is the belief as sure as it may be?"),
    "speed": ("tagtrack.eval.speed.command:Speed", "env steps and particle updates a second"),
    "calibrate": ("tagtrack.eval.field.tag_clock.calibrate:Calibrate", "the clock of a tag, from recorded arrivals"),
    "papers": ("tagtrack.eval.papers.command:Papers", "the papers' experiments in simulation, beside what is printed"),
    "array": ("tagtrack.eval.field.array.command:Array", "moored receivers: clocks, places, positions, tracks"),
    "minari": ("tagtrack.eval.minari_sets:Minari", "data sets for offline learning"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; returns its exit status: 0, 2 for a mistake in the input, 130 after Ctrl-C."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("-h", "--help"):
        print(help_text())
        return 0 if given else 2
    try:
        parse(given).run()
    except SystemExit as stop:  # tyro has shown the help or what is wrong
        return int(stop.code or 0)
    except KeyboardInterrupt:
        print("\nstopped; nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever read it has seen enough
        return 1
    except (ValueError, OSError, ImportError) as error:
        print(f"error: {_one_line(error)}", file=sys.stderr)
        return 2
    return 0


def help_text() -> str:
    """What `tagtrack eval --help` shows."""
    commands = listing({name: text for name, (_, text) in COMMANDS.items()})
    return (
        f"usage: tagtrack eval COMMAND ...\n\nCompare policies on the same fish, and what belongs to it.\n\n{commands}\n\n"
        "tagtrack eval COMMAND --help says more."
    )


def parse(arguments: Sequence[str]) -> Any:
    """The command that a command line asks for. Raises ValueError for one that there is not."""
    name, *rest = arguments
    if name not in COMMANDS:
        from tagtrack.envs.validation import unknown

        raise unknown("command", name, COMMANDS)
    return parse_options(find_command(name), rest, prog=f"{tagtrack_here()} eval {name}")


def find_command(name: str) -> Any:
    """The dataclass with the options of a command."""
    module, _, kind = COMMANDS[name][0].partition(":")
    return getattr(importlib.import_module(module), kind)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
