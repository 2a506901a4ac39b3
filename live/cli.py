"""`python -m live`: recorded missions and vehicles at sea. The standard library reads the arguments: aboard there is no other."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

DESCRIPTION = "The filter and a policy on real missions: a log once more, a vehicle at sea, or one that is simulated."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; returns its exit status: 0, 2 for a mistake in the input, 130 after Ctrl-C."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        options = make_parser().parse_args(given or ["--help"])
        importlib.import_module(f"tagtrack.live.{options.module}").run(options)
    except SystemExit as stop:  # argparse has said what is wrong
        return int(stop.code or 0) if given else 2
    except KeyboardInterrupt:
        print("\nstopped", file=sys.stderr)
        return 130
    except BrokenPipeError:
        return 1
    except (ValueError, OSError, ImportError, RuntimeError) as error:
        print(f"error: {' '.join(str(error).split()) or type(error).__name__}", file=sys.stderr)
        return 2
    return 0


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m live", description=DESCRIPTION, allow_abbrev=False)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_replay(commands)
    return parser


def add_task(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """Options that name a task and its filter."""
    parser.add_argument("--env", metavar="ID", required=required, help="environment whose sensor fits: LeopardShark-v0 ...")
    parser.add_argument("--filter", metavar="NAME", help="another filter of the papers: standard, levy, combined_brownian ...")
    parser.add_argument("--particles", metavar="N", type=int, help="of each belief (the environment's own)")
    parser.add_argument(
        "--set", metavar="NAME=VALUE", nargs="+", action="append", default=[], help="parameters: belief.receiver.bearing_sigma=2"
    )
    parser.add_argument("--tags", metavar="NAME", nargs="+", help="tags to track")
    parser.add_argument("--seed", metavar="N", type=int, help="of the filter's random numbers (0, or the log's own)")
    add_conventions(parser)


def add_conventions(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--headings", choices=("nautical", "mathematical"), help="degrees clockwise from north (default), or radians from east"
    )
    parser.add_argument("--speeds", choices=("m/s", "knots"), help="(m/s)")
    parser.add_argument("--origin", metavar=("LON", "LAT"), nargs=2, type=float, help="of the plane, for lon,lat (the first fix)")


def _add_replay(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "replay",
        help="a recorded mission through the filter",
        description="A recorded mission through the filter: estimates.csv, summary.json, map.png.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="""a log is csv or JSON lines:
  navigation  t [s], x, y [m] (or lon, lat), heading [degrees clockwise from north], speed [m/s]
  readings    t [s], tag, bearing_units, strength, range [m], arrival [s], depth [m], heard (0: asked in vain)
in one file or two; `python -m eval benchmark --record 1` writes one.

example: python -m live replay --log nav.csv pings.csv --env RangeOnly-v0 --out replayed""",
    )
    parser.set_defaults(module="replay")
    parser.add_argument("--log", metavar="FILE", nargs="+", required=True, help="the log's files, or a folder that was recorded")
    add_task(parser, required=False)
    parser.add_argument("--reference", metavar="FILE", help="csv t,x,y[,tag] of where the tags truly were (a recorded log's own)")
    parser.add_argument("--calibration", metavar="FILE", help="what eval calibrate wrote: arrivals become ranges")
    parser.add_argument("--compare", metavar="NAME", nargs="+", help="filters to set side by side: standard brownian levy ...")
    parser.add_argument("--seeds", metavar="N", type=int, default=5, help="repetitions of each in --compare (5)")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder to write; an earlier replay's is replaced")
