"""`tagtrack live steer`: a policy aboard, between a receiver and a vehicle."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import math
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tagtrack.command import tagtrack_here
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.task import build_task, parse_overrides
from tagtrack.live.conventions import Conventions
from tagtrack.live.helm import Helm, Orders, describe_counts, parse_corners
from tagtrack.live.journal import JOURNAL_FILE, Journal, mend, read_events
from tagtrack.live.receivers import RECEIVERS, JsonReceiver, Receiver, RxLive, Tbr, Vr2c
from tagtrack.live.sources import Source, open_source, wait_for
from tagtrack.live.tracker import Tracker
from tagtrack.live.vehicles import VEHICLES, Iver, JsonVehicle, Order, VehicleLink

TICK = 0.25  # how often nothing but time is looked at [s]
TELL = 1.0  # between two lines of status, questions and safe actions [s]
DRAW = 60.0  # between two pictures [s]
DAY = 86400.0
FORMAT = 1  # of the journal
ASKED = (
    "env", "filter", "particles", "set", "tags", "seed", "policy", "headings", "origin", "box", "safe", "home", "depth", "late",
    "stale", "stamp", "speed", "receiver", "vehicle", "feet", "checksum", "degrees",
)  # fmt: skip
DEFAULTS: dict[str, Any] = {
    "safe": "hold", "depth": 0.0, "late": 60.0, "stamp": "receiver", "speed": 1.0, "feet": False, "checksum": True,
    "degrees": False,
}  # fmt: skip
LEAST_STALE = 15.0  # [s]


def run(options: argparse.Namespace) -> None:
    """The command."""
    folder, asked = resume_mission(options) if options.resume else begin_mission(options)
    if options.duration is not None and not options.duration > 0:
        raise ValueError(f"--duration must be a positive number of seconds, got {options.duration}")
    picture = find_picture(options.picture)
    helm, receiver_source, vehicle_source = prepare(asked)
    warm_up(asked)
    receiver = open_source(receiver_source)  # before there is a journal: who begins again must not find one
    vehicle = open_source(vehicle_source)
    folder.mkdir(parents=True, exist_ok=True)
    journal = Journal(folder / JOURNAL_FILE, fresh=not options.resume)
    last = -math.inf
    if options.resume:
        mend(folder / JOURNAL_FILE)
        count, last = replay_journal(folder / JOURNAL_FILE, helm)
        print(f"resumed after {count} lines", file=sys.stderr)
    else:
        journal.note({"mission": asked, "format": FORMAT})
    clock = make_clock(asked["speed"], least=last)
    loop = Loop(helm, journal, receiver, vehicle, clock=clock, speed=asked["speed"], json_lines=options.json)
    loop.picture = picture
    try:
        loop.run(options.duration)
    finally:
        journal.close()
        receiver.close()
        vehicle.close()
        dropped = helm.dropped + receiver.counts + vehicle.counts
        told = [f"{helm.fixes} fixes, {helm.heard_lines} lines of the receiver; dropped: {describe_counts(dropped)}"]
        told += [f"go on: {tagtrack_here()} live steer --resume {folder}"]
        with contextlib.suppress(OSError):
            print("\n".join(told), file=sys.stderr)


def begin_mission(options: argparse.Namespace) -> tuple[Path, dict[str, Any]]:
    """Folder and header of a new mission. Raises ValueError for what it cannot do without."""
    for name in ("env", "policy", "receiver", "vehicle", "tags", "log"):
        if getattr(options, name) is None:
            raise ValueError(f"a new mission needs --{name}; one that was begun goes on with --resume DIR")
    path = Path(options.log) / JOURNAL_FILE
    if path.exists():
        raise ValueError(f"{path} is there already; go on with it (--resume {options.log}), or choose another folder")
    if Path(options.log).exists() and not Path(options.log).is_dir():
        raise ValueError(f"--log {options.log} is a file; choose a folder")
    given = {name: getattr(options, name) for name in ASKED}
    return Path(options.log), {name: DEFAULTS.get(name) if value is None else value for name, value in given.items()}


def resume_mission(options: argparse.Namespace) -> tuple[Path, dict[str, Any]]:
    """Folder and header of a mission that goes on. Raises ValueError for options that would change what it is about."""
    folder = Path(options.resume)
    asked = read_header(folder)
    for name in ASKED:
        given = getattr(options, name)
        if given in (None, []) or given == asked[name]:
            continue
        if name not in ("receiver", "vehicle"):  # whose ports may have changed
            raise ValueError(f"--{name.replace('_', '-')} cannot be changed with --resume; begin a new mission (--log)")
        asked[name] = given
    if options.log is not None and Path(options.log) != folder:
        raise ValueError(f"a mission that is resumed is logged where it was, in {folder}; leave --log out")
    return folder, asked


def find_picture(path: str | None) -> Path | None:
    """Where to draw. Raises ValueError, ImportError where that cannot be."""
    if path is None:
        return None
    if not Path(path).absolute().parent.is_dir():
        raise ValueError(f"--picture {path}: there is no such folder; make it first")
    importlib.import_module("matplotlib.figure")
    return Path(path)


def prepare(asked: dict[str, Any]) -> tuple[Helm, str, str]:
    """The helm of a mission, and the sources of its receiver and vehicle. Raises ValueError for whatever does not fit."""
    kind, receiver_source = _divide(asked["receiver"], RECEIVERS, "--receiver")
    other, vehicle_source = _divide(asked["vehicle"], VEHICLES, "--vehicle")
    if receiver_source == vehicle_source:
        raise ValueError(f"receiver and vehicle cannot both be {receiver_source}; give each a source of its own")
    receiver = make_receiver(kind, check=asked["checksum"])
    vehicle = make_vehicle(other, feet=asked["feet"], degrees=asked["degrees"])
    orders = make_orders(asked, in_degrees=vehicle.in_degrees, mathematical_allowed=other == "json")
    return Helm(orders, receiver, vehicle), receiver_source, vehicle_source


def make_receiver(kind: str, *, check: bool = True) -> Receiver:
    if kind == "tbr":
        return Tbr()
    return JsonReceiver() if kind == "json" else {"vr2c": Vr2c, "rxlive": RxLive}[kind](check=check)


def make_vehicle(kind: str, *, feet: bool = False, degrees: bool = False) -> VehicleLink:
    if kind == "iver":
        return Iver(feet=feet)
    return JsonVehicle(degrees=degrees) if kind == "json" else VEHICLES[kind]()


def make_orders(asked: dict[str, Any], *, in_degrees: bool, mathematical_allowed: bool) -> Orders:
    """What a mission is about, checked as far as it can be before it begins. Raises ValueError."""
    check_asked(asked)
    overrides = parse_overrides([text for group in asked["set"] for text in group], None)
    if asked["filter"] is not None:
        overrides["belief"] = asked["filter"]
    task = build_task(asked["env"], overrides=overrides, particles=asked["particles"])
    task = task._replace(scenario=with_overrides(task.scenario, {"targets": len(asked["tags"])}))
    headings = asked["headings"] or "nautical"
    if headings != "nautical" and not mathematical_allowed:
        raise ValueError("only json vehicles may tell mathematical headings; leave --headings out")
    if asked["origin"] and not in_degrees:
        raise ValueError("--origin is for vehicles that tell longitude and latitude; this one tells metres")
    box = () if asked["box"] is None else parse_corners(asked["box"])
    if asked["box"] is not None and not box:
        raise ValueError("--box is empty; name its corners, or leave it out")
    origin = tuple(asked["origin"]) if asked["origin"] else None
    if in_degrees and origin is None and box:
        origin = (sum(corner[0] for corner in box) / len(box), sum(corner[1] for corner in box) / len(box))
    stale = max(LEAST_STALE, 2.5 * task.scenario.time_step) if asked["stale"] is None else asked["stale"]
    return Orders(
        task=task,
        tags=tuple(asked["tags"]),
        policy=asked["policy"],
        conventions=Conventions(headings=headings, origin=origin),
        box=box,
        safe=asked["safe"],
        home=tuple(asked["home"]) if asked["home"] else None,
        depth=asked["depth"],
        late=asked["late"],
        stale=stale,
        seed=asked["seed"] or 0,
        step=task.scenario.time_step if asked["speed"] == 0 else 0.0,
        stamp=asked["stamp"],
    )


def check_asked(asked: dict[str, Any]) -> None:
    """Raise ValueError for a number that cannot be meant."""
    limits = {"depth": (0.0, 11_000.0), "late": (0.0, 3600.0), "stale": (0.1, 1e9), "speed": (0.0, 1e5), "seed": (0, 2**63 - 1)}
    for name, (least, most) in limits.items():
        value = asked[name]
        if value is not None and not least <= value <= most:
            raise ValueError(f"--{name} must be from {least:g} to {most:g}, got {value}")
    if asked["particles"] is not None and asked["particles"] < 1:
        raise ValueError(f"--particles must be at least 1, got {asked['particles']}")
    for name in ("home", "origin"):
        if asked[name] and not all(map(math.isfinite, asked[name])):
            raise ValueError(f"--{name} must be two numbers, got {asked[name]}")


def _divide(spec: str, known: Any, option: str) -> tuple[str, str]:
    kind, colon, source = spec.partition(":")
    if kind not in known or not colon or not source:
        example = f"{next(iter(known))}:tcp:localhost:5000"
        raise ValueError(f"{option} is KIND:SOURCE, as {example}; kinds are {', '.join(known)}, got {spec!r}")
    return kind, source


def make_clock(speed: float, *, least: float = -math.inf) -> Callable[[], float]:
    """The host's clock, which never jumps, and is never before ``least`` [s].

    Of simulated vehicles it runs faster, alike in all processes since midnight.
    """
    if speed in (0.0, 1.0):
        begun, at = max(time.time(), least), time.monotonic()
        return lambda: begun + (time.monotonic() - at)
    midnight = time.time() // DAY * DAY
    return lambda: midnight + speed * (time.time() - midnight)


def read_header(folder: Path) -> dict[str, Any]:
    """What a mission was begun with. Raises FileNotFoundError, ValueError."""
    path = folder / JOURNAL_FILE
    if not path.is_file():
        raise FileNotFoundError(f"{folder} holds no {JOURNAL_FILE}; begin a mission with --log {folder}")
    first = next(read_events(path), None)
    if first is None or first.get("format") != FORMAT or not isinstance(first.get("mission"), dict):
        raise ValueError(f"{path} does not begin as a journal of this version; begin a new mission")
    asked = dict(first["mission"])
    if missing := [name for name in ASKED if name not in asked]:
        raise ValueError(f"{path} does not say {missing[0]}; begin a new mission")
    texts = ("env", "policy", "receiver", "vehicle", "safe", "stamp")
    numbers, or_null = ("depth", "late", "speed"), ("particles", "seed", "stale")
    wrong = [name for name in texts if not isinstance(asked[name], str)]
    wrong += [name for name in ("filter", "headings", "box") if not (asked[name] is None or isinstance(asked[name], str))]
    wrong += [name for name in numbers if type(asked[name]) not in (int, float)]
    wrong += [name for name in or_null if not (asked[name] is None or type(asked[name]) in (int, float))]
    wrong += [] if _is_list(asked["tags"], str) and asked["tags"] else ["tags"]
    wrong += [] if isinstance(asked["set"], list) and all(_is_list(group, str) for group in asked["set"]) else ["set"]
    wrong += [name for name in ("home", "origin") if not (asked[name] is None or _is_place(asked[name]))]
    if wrong:
        raise ValueError(f"{path} is damaged: it begins with {wrong[0]} = {asked[wrong[0]]!r:.80}; begin a new mission")
    return asked


def _is_place(value: Any) -> bool:
    return _is_list(value, (int, float)) and len(value) == 2 and all(abs(each) < 1e9 for each in value)


def _is_list(value: Any, kind: Any) -> bool:
    return isinstance(value, list) and all(isinstance(each, kind) and not isinstance(each, bool) for each in value)


def replay_journal(path: Path, helm: Helm) -> tuple[int, float]:
    """Let all that came before come again, and send nothing. Returns the number of lines, and the last one's time [s]."""
    count, last = 0, -math.inf
    for event in read_events(path):
        if "t" in event:
            last = max(last, event["t"])
        if "from" in event:
            count += 1
            handle(helm, event["from"], event["line"].encode("latin-1"), event["t"])
    return count, last


def handle(helm: Helm, who: str, line: bytes, now: float) -> Order | None:
    """What follows from a line."""
    if who == "receiver":
        helm.hear(line, now)
        return None
    return helm.steer(line, now)


def warm_up(asked: dict[str, Any]) -> None:
    """Load what is compiled, on a mission that is thrown away: the first order must not wait for it."""
    orders = make_orders({**asked, "box": None, "home": None, "origin": None}, in_degrees=True, mathematical_allowed=True)
    tracker = Tracker(orders.task, tags=orders.tags, policy=orders.policy)
    receiver = tracker.task.scenario.belief.receiver
    for k in range(3):
        t = k * tracker.time_step
        tracker.navigate(t, 0.0, 0.0, 0.0, 0.0)
        tracker.steer(t)
        readings: dict[str, Any] = {name: 1.0 for name in receiver.readings}
        tracker.hear(t + 0.5 * tracker.time_step, orders.tags[0], **readings)
    tracker.last_estimates()


class Loop:
    """Waits for lines, writes them down, lets the helm decide, sends what it says."""

    def __init__(
        self,
        helm: Helm,
        journal: Journal,
        receiver: Source,
        vehicle: Source,
        *,
        clock: Callable[[], float],
        speed: float = 1.0,
        json_lines: bool = False,
        tell: bool = True,
    ) -> None:
        self.helm, self.journal, self.receiver, self.vehicle = helm, journal, receiver, vehicle
        self.clock, self.speed, self.json_lines, self.tells = clock, speed, json_lines, tell
        self.picture: Path | None = None
        self._stopped = self._journal_broken = False
        self._asked = self._told = self._drawn = -1e9
        self._track: deque[tuple[float, float]] = deque(maxlen=20_000)  # where the vehicle was, a place a second [m]

    def run(self, duration: float | None) -> None:
        """Until it is stopped, nothing will come any more, or so many seconds have passed."""
        begun = time.monotonic()
        former: dict[int, Any] = {}
        if threading.current_thread() is threading.main_thread():
            former = {number: signal.signal(number, self.stop) for number in (signal.SIGTERM, signal.SIGHUP)}
        try:
            while not (self._stopped or self._over(begun, duration)):
                self._turn()
        except KeyboardInterrupt:
            pass
        finally:
            self._leave()
            for number, handler in former.items():
                signal.signal(number, handler)

    def _leave(self) -> None:
        """However it ends, the vehicle is told to stop: nobody will look after its last order."""
        now = self.clock()
        order = self.helm.stop(now)
        if order is None:
            return
        data = self.helm.vehicle.order(order)
        with contextlib.suppress(OSError):
            if not self._journal_broken:
                self._note("to", "vehicle", data, now, safe="end")
            self.vehicle.write(data)
            self.journal.sync()

    def stop(self, *_: Any) -> None:
        """End ``run`` soon."""
        self._stopped = True

    def _over(self, begun: float, duration: float | None) -> bool:
        return self.vehicle.ended or (duration is not None and time.monotonic() - begun > duration)

    def _turn(self) -> None:
        wall = time.monotonic()
        if self.helm.vehicle.question and wall - self._asked > TELL / max(self.speed, 1.0):
            self._ask(wall)
        wait_for([self.receiver, self.vehicle], TICK / max(self.speed, 1.0))
        for line in self.vehicle.read():
            self._hear()  # what came before counts before
            now = self.clock()
            self._note("from", "vehicle", line, now)
            order = self.helm.steer(line, now)
            if order is not None:
                self._send(self.helm.vehicle.order(order), now)
                if self.helm.vehicle.question:
                    self._ask(wall)
        self._hear()
        self._look(time.monotonic())

    def _hear(self) -> None:
        for line in self.receiver.read():
            now = self.clock()
            self._note("from", "receiver", line, now)
            self.helm.hear(line, now)

    def _look(self, wall: float) -> None:
        """Once a second: is navigation too old, and what do people see?"""
        if wall - self._told < TELL:
            return
        self._told = wall
        self.journal.sync()
        now = self.clock()
        order = self.helm.watch(now)
        if order is not None:
            self._send(self.helm.vehicle.order(order), now, safe=self.helm.reason)
        if self.tells:
            with contextlib.suppress(OSError):  # whoever read it has gone
                self._tell(now)
        if self.helm.tracker is not None and self.helm.fixes:
            pose = self.helm.tracker.pose
            self._track.append((pose.x, pose.y))
        if self.picture is not None and wall - self._drawn > DRAW:
            self._drawn = wall
            self._draw()

    def _ask(self, wall: float) -> None:
        self._asked = wall
        self.vehicle.write(self.helm.vehicle.question)

    def _note(self, way: str, who: str, line: bytes, now: float, **more: str) -> None:
        try:
            self.journal.note({"t": now, way: who, "line": line.decode("latin-1"), **more})
        except OSError as error:  # nothing may follow from what is not written down
            self._journal_broken = True
            raise OSError(f"{self.journal.path} cannot be written ({error.strerror or error}); make room and --resume") from None

    def _send(self, data: bytes, now: float, **more: str) -> None:
        self._note("to", "vehicle", data, now, **more)
        if not self.vehicle.write(data):
            self.helm.counts["order that did not go out"] += 1

    def _tell(self, now: float) -> None:
        status = self.helm.status(now)
        for name, source in (("receiver", self.receiver), ("vehicle", self.vehicle)):
            for reason, count in source.counts.items():
                if count:
                    status["dropped"][f"{name}: {reason}"] = count
        if self.json_lines:
            print(json.dumps(status), file=sys.stderr, flush=True)
            return
        end = "\x1b[K\r" if sys.stderr.isatty() else "\n"
        print(describe(status), end=end, file=sys.stderr, flush=True)

    def _draw(self) -> None:
        from tagtrack.live.chart import draw_chart

        helm, picture = self.helm, self.picture
        if helm.tracker is not None and helm.fixes and picture is not None:
            told = picture, list(self._track), helm.tracker.in_metres(helm.tracker.last_estimates())
            threading.Thread(target=try_to_draw, args=(draw_chart, told), daemon=True).start()


def try_to_draw(draw: Callable[..., None], told: tuple[Any, ...]) -> None:
    """A picture that cannot be drawn costs no mission."""
    with contextlib.suppress(Exception):
        draw(*told)


def describe(status: dict[str, Any]) -> str:
    """A line of status for people."""
    parts = [time.strftime("%H:%M:%S", time.gmtime(status["t"]))]
    age = status["navigation_age_s"]
    parts.append("no navigation yet" if age is None else f"navigation {age:.0f} s old")
    for tag in status.get("tags", []):
        since = tag["heard_s_ago"]
        heard = "never heard" if since is None else f"heard {since:.0f} s ago"
        parts.append(f"{tag['tag']} {heard}, {tag['x']:.10g}, {tag['y']:.10g} +-{tag['sd']:g} m{' LOST' if tag['lost'] else ''}")
    if "course" in status:
        why = f" ({status['reason']})" if status["reason"] else ""
        parts.append(f"course {status['course']:g} speed {status['speed']:g}{why}")
    if dropped := sum(status["dropped"].values()):
        parts.append(f"{dropped} lines dropped")
    return " | ".join(parts)
