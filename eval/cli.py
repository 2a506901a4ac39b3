"""`python -m eval`: one command each for comparing, tuning, timing, checking, calibrating and repeating the papers."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from tagtrack.eval.aggregate import Aggregate
from tagtrack.eval.benchmark import Benchmark
from tagtrack.eval.check_consistency import Consistency
from tagtrack.eval.field.array.command import Array
from tagtrack.eval.field.tag_clock.calibrate import Calibrate
from tagtrack.eval.headroom import Headroom
from tagtrack.eval.messages import Messages
from tagtrack.eval.minari_sets import Minari
from tagtrack.eval.papers.command import Papers
from tagtrack.eval.speed.command import Speed
from tagtrack.eval.tradeoff import Tradeoff
from tagtrack.eval.tune import Tune

Command = (
    Annotated[Benchmark, tyro.conf.subcommand("benchmark")]
    | Annotated[Aggregate, tyro.conf.subcommand("aggregate")]
    | Annotated[Tune, tyro.conf.subcommand("tune")]
    | Annotated[Tradeoff, tyro.conf.subcommand("tradeoff")]
    | Annotated[Headroom, tyro.conf.subcommand("headroom")]
    | Annotated[Messages, tyro.conf.subcommand("messages")]
    | Annotated[Consistency, tyro.conf.subcommand("consistency")]
    | Annotated[Speed, tyro.conf.subcommand("speed")]
    | Annotated[Calibrate, tyro.conf.subcommand("calibrate")]
    | Annotated[Papers, tyro.conf.subcommand("papers")]
    | Annotated[Array, tyro.conf.subcommand("array")]
    | Annotated[Minari, tyro.conf.subcommand("minari")]
)
DESCRIPTION = (
    "Compare policies on the same fish, tune baselines, estimate what is left to gain, weigh what talking is worth, check the "
    "belief, time the simulation, calibrate tags, repeat the papers' experiments, locate tags by moored receivers, "
    "write data sets for offline learning."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; returns its exit status: 0, 2 for a mistake in the input, 130 after Ctrl-C."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        parse(given or ["--help"]).run()
    except SystemExit as stop:  # tyro has shown the help or what is wrong
        return int(stop.code or 0) if given else 2
    except KeyboardInterrupt:
        print("\nstopped; nothing was written", file=sys.stderr)
        return 130
    except (ValueError, OSError, ImportError) as error:
        print(f"error: {_one_line(error)}", file=sys.stderr)
        return 2
    return 0


def parse(arguments: Sequence[str]) -> Command:
    """The command that a command line asks for."""
    return tyro.cli(
        Command,
        args=arguments,
        prog="python -m eval",
        description=DESCRIPTION,
        config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
    )


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
