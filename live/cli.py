"""`tagtrack live`: recorded missions and vehicles at sea. The standard library reads the arguments: aboard there is no other."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from tagtrack.command import tagtrack_here

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
    except BrokenPipeError:  # whoever read it has seen enough
        return 1
    except (ValueError, OSError, ImportError, RuntimeError) as error:
        print(f"error: {' '.join(str(error).split()) or type(error).__name__}", file=sys.stderr)
        return 2
    return 0


def whole_number(text: str) -> int:
    """A whole number as people write it: 4000, 1e6."""
    number = float(text)
    if not number.is_integer():
        raise argparse.ArgumentTypeError(f"must be a whole number, as 4000 or 1e6, got {text!r}")
    return int(number)


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=f"{tagtrack_here()} live", description=DESCRIPTION, allow_abbrev=False)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_replay(commands)
    _add_steer(commands)
    _add_compile(commands)
    _add_simulate(commands)
    _add_rehearse(commands)
    _add_range_test(commands)
    _add_export(commands)
    return parser


def add_task(parser: argparse.ArgumentParser, *, required: bool, speeds: bool = True) -> None:
    """Options that name a task and its filter."""
    parser.add_argument("--env", metavar="ID", required=required, help="environment whose sensor fits: LeopardShark-v0 ...")
    parser.add_argument("--filter", metavar="NAME", help="another filter of the papers: standard, levy, combined_brownian ...")
    parser.add_argument("--particles", metavar="N", type=whole_number, help="of each belief (the environment's own)")
    parser.add_argument(
        "--set", metavar="NAME=VALUE", nargs="+", action="append", default=[], help="parameters: belief.receiver.bearing_sigma=2"
    )
    parser.add_argument("--tags", metavar="NAME", nargs="+", help="tags to track")
    parser.add_argument("--seed", metavar="N", type=whole_number, help="of the filter's random numbers (0, or the log's own)")
    add_conventions(parser, speeds=speeds)


def add_conventions(parser: argparse.ArgumentParser, *, speeds: bool) -> None:
    parser.add_argument(
        "--headings", choices=("nautical", "mathematical"), help="degrees clockwise from north (default), or radians from east"
    )
    if speeds:
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
in one file or two; `tagtrack eval benchmark --record 1` writes one.

example: tagtrack live replay --log nav.csv pings.csv --env RangeOnly-v0 --out replayed""",
    )
    parser.set_defaults(module="replay")
    parser.add_argument("--log", metavar="FILE", nargs="+", required=True, help="the log's files, or a folder that was recorded")
    add_task(parser, required=False)
    parser.add_argument("--reference", metavar="FILE", help="csv t,x,y[,tag] of where the tags truly were (a recorded log's own)")
    parser.add_argument("--calibration", metavar="FILE", help="what eval calibrate wrote: arrivals become ranges")
    parser.add_argument("--compare", metavar="NAME", nargs="+", help="filters to set side by side: standard brownian levy ...")
    parser.add_argument("--seeds", metavar="N", type=whole_number, default=5, help="repetitions of each in --compare (5)")
    parser.add_argument("--out", metavar="DIR", required=True, help="folder to write; an earlier replay's is replaced")


def _add_steer(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "steer",
        help="a policy aboard, between a receiver and a vehicle",
        description="Steer a vehicle by what its receiver hears. Each line goes to a journal before anything follows from it.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="""receivers  tbr (Thelma), vr2c, rxlive (Innovasea), json
vehicles   iver, goby, json
sources    - (standard input), a file that grows, udp:PORT, tcp:HOST:PORT, serial:DEVICE:BAUD

example: tagtrack live steer --env AreaOnly-v0 --policy circle:200 --tags 1285 \\
             --receiver tbr:serial:/dev/ttyUSB0:115200 --vehicle goby:tcp:localhost:54000 --log mission1""",
    )
    parser.set_defaults(module="steer")
    add_task(parser, required=False, speeds=False)
    parser.add_argument("--policy", metavar="POLICY", help="baseline (three_step, circle:40 ...) or folder of a training run")
    parser.add_argument("--receiver", metavar="KIND:SOURCE", help="who hears, and where its lines come from")
    parser.add_argument("--vehicle", metavar="KIND:SOURCE", help="who is steered, and where its lines come from and go to")
    parser.add_argument("--log", metavar="DIR", help="folder of the journal")
    parser.add_argument("--resume", metavar="DIR", help="go on with a mission that was stopped or killed")
    parser.add_argument("--box", metavar="'X,Y X,Y X,Y'", help="corners of the box that the vehicle stays in (none)")
    parser.add_argument("--safe", choices=("hold", "stop", "home"), help="where navigation is too old (hold)")
    parser.add_argument("--home", metavar=("X", "Y"), nargs=2, type=float, help="where home is (the first fix)")
    parser.add_argument("--depth", metavar="M", type=float, help="that the vehicle is told [m] (0)")
    parser.add_argument("--stale", metavar="S", type=float, help="how old navigation may be [s] (15, or 2.5 steps of the task)")
    parser.add_argument("--late", metavar="S", type=float, help="by how much readings may come late [s] (60)")
    parser.add_argument("--stamp", choices=("receiver", "host"), help="whose clock times pings (receiver)")
    parser.add_argument("--feet", action="store_true", default=None, help="depths in feet, for Remote Helm below 5")
    parser.add_argument("--degrees", action="store_true", default=None, help="a json vehicle tells lon,lat")
    parser.add_argument("--no-checksum", dest="checksum", action="store_false", default=None, help="Innovasea's lines unchecked")
    parser.add_argument("--speed", metavar="X", type=float, help="of the clock, in a simulation; 0: lockstep (1)")
    parser.add_argument("--duration", metavar="S", type=float, help="stop after so long [s] (never)")
    parser.add_argument("--json", action="store_true", help="status as JSON, for programs")
    parser.add_argument("--picture", metavar="FILE", help="a chart, drawn anew every minute")


def _add_compile(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "compile",
        help="compile ahead what `steer` needs, so that it starts in two seconds",
        description="Compile for this machine what a mission needs; half a minute, once, and again after an update.",
    )
    parser.set_defaults(module="compile_ahead")
    add_task(parser, required=True)
    parser.add_argument("--policy", metavar="POLICY", default="circle", help="as steer's (circle)")


def _add_simulate(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "simulate",
        help="a simulated fish, receiver and vehicle that speak as real ones do",
        description="Play an episode of the environment over loopback: the receiver at port P, the vehicle at P + 1.",
    )
    parser.set_defaults(module="simulate")
    _add_scenario(parser)
    parser.add_argument("--headings", choices=("nautical", "mathematical"), default="nautical", help="of json (nautical)")
    parser.add_argument("--port", metavar="P", type=int, default=54000, help="of the receiver; the vehicle's is the next (54000)")
    parser.add_argument("--speed", metavar="X", type=float, default=1.0, help="of time; 0: each step waits for an order (1)")
    parser.add_argument("--steps", metavar="N", type=whole_number, help="(the environment's own)")
    parser.add_argument("--wait", metavar="S", type=float, default=60.0, help="for the other end [s] (60)")
    parser.add_argument("--report", metavar="FILE", help="JSON of where fish and vehicle truly were")


def _add_rehearse(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "rehearse",
        help="both ends together: whole missions over loopback, beside the environment's own",
        description="Play missions over loopback and set their errors beside those of the environment's own episodes.",
    )
    parser.set_defaults(module="rehearse")
    _add_scenario(parser)
    parser.add_argument("--policy", metavar="POLICY", default="circle", help="baseline or folder of a training run (circle)")
    parser.add_argument("--particles", metavar="N", type=whole_number, help="of each belief (the environment's own)")
    parser.add_argument("--episodes", metavar="N", type=whole_number, default=10, help="(10)")
    parser.add_argument("--speed", metavar="X", type=float, default=0.0, help="of time; 0: lockstep (0)")
    parser.add_argument("--port", metavar="P", type=int, default=55000, help="the first of those that are used (55000)")


def _add_scenario(parser: argparse.ArgumentParser) -> None:
    """Options of a simulated episode and of how its two ends speak."""
    parser.add_argument("--env", metavar="ID", required=True, help="environment")
    parser.add_argument("--set", metavar="NAME=VALUE", nargs="+", action="append", default=[], help="parameters of the scenario")
    parser.add_argument("--seed", metavar="N", type=whole_number, default=0, help="of the (first) episode (0)")
    parser.add_argument("--receiver", choices=("tbr", "vr2c", "rxlive", "json"), default="json", help="(json)")
    parser.add_argument("--vehicle", choices=("iver", "goby", "json"), default="json", help="(json)")
    parser.add_argument("--pty", action="store_true", help="the vehicle on a pseudo-terminal instead")
    parser.add_argument("--latency", metavar="S", type=float, default=0.0, help="of every line, +- half, as simulated [s] (0)")
    parser.add_argument("--loss", metavar="SHARE", type=float, default=0.0, help="of lines that get lost (0)")


def _add_range_test(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "range-test",
        help="reception against distance, as the water of a scenario",
        description="How many pings of a tag at known places were heard from how far: counts, shares, a curve, a picture.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="""example, a buoy past which a boat tows a tag:
  tagtrack live range-test --log buoy.csv pings.csv --reference boat.csv --interval 10
moored receivers:
  tagtrack live range-test --detections det.csv --receivers rec.csv --reference boat.csv --interval 30""",
    )
    parser.set_defaults(module="range_test")
    parser.add_argument("--log", metavar="FILE", nargs="+", help="log of the receiver's platform: navigation and readings")
    parser.add_argument("--detections", metavar="FILE", help="of moored receivers, instead: t_unix_s,receiver,tag, VUE ...")
    parser.add_argument("--receivers", metavar="FILE", help="their places: receiver,x,y")
    parser.add_argument("--reference", metavar="FILE", required=True, help="csv t,x,y of where the tag was")
    parser.add_argument("--interval", metavar="S", type=float, required=True, help="mean time from one ping to the next [s]")
    parser.add_argument("--tag", metavar="NAME", help="(the only one)")
    parser.add_argument("--bin", metavar="M", type=float, default=50.0, help="width of a bin of distance [m] (50)")
    parser.add_argument("--out", metavar="DIR", help="folder for range_test.json and range_test.png (none)")


def _add_export(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "export",
        help="a learned policy as ONNX, for other languages",
        description="Write a policy as an ONNX graph from observation (B, D) to action (B, A), checked against numpy.",
    )
    parser.set_defaults(module="export")
    parser.add_argument("--policy", metavar="RUN", required=True, help="folder of a training run, or learned")
    parser.add_argument("--env", metavar="ID", default="LeopardShark-v0", help="for learned: which one (LeopardShark-v0)")
    parser.add_argument("--out", metavar="FILE", required=True, help="file to write, as policy.onnx")
