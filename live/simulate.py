"""`tagtrack live simulate`: a fish, water, a receiver and a vehicle that speak as real ones do."""

from __future__ import annotations

import argparse
import contextlib
import heapq
import itertools
import json
import math
import os
import select
import socket
import time
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.command import tagtrack_here
from tagtrack.envs.belief.row import make_scratch
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import Status
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task, build_task, parse_overrides
from tagtrack.envs.world import sail_worlds
from tagtrack.envs.world_rule import world_rule
from tagtrack.live.conventions import Conventions
from tagtrack.live.lines import LONGEST_LINE, BadLine
from tagtrack.live.receivers import Heard, Receiver
from tagtrack.live.recording import COLUMN_OF
from tagtrack.live.steer import make_clock, make_receiver, make_vehicle
from tagtrack.live.vehicles import Fix, VehicleLink

ORIGIN = (-117.95, 33.55)  # longitude and latitude of the middle of the water, off the papers' lagoon
PATIENCE = 30.0  # for an order, where the fish waits for one [s]


def check_play(options: argparse.Namespace, task: Task) -> None:
    """Raise ValueError for a number that cannot be meant, or a receiver that does not tell what the task needs."""
    limits = {"speed": (0.0, 1e5), "latency": (0.0, 3600.0), "loss": (0.0, 1.0), "wait": (0.0, 86_400.0), "steps": (1, 10**9)}
    limits |= {"port": (1024, 65_534), "seed": (0, 2**63 - 1), "episodes": (1, 10**6), "particles": (1, 2**20)}
    for name, (least, most) in limits.items():
        value = getattr(options, name, None)
        if value is not None and not least <= value <= most:
            raise ValueError(f"--{name} must be from {least:g} to {most:g}, got {value}")
    if options.speed == 0 and (options.loss > 0 or options.latency > 0):
        raise ValueError("in lockstep (--speed 0) no line is late or lost; leave --loss and --latency out, or give a --speed")
    if options.receiver != "json" and task.scenario.receiver.readings:
        raise ValueError(
            f"a {options.receiver} tells that a tag is heard and no more; {task.env_id} reads "
            f"{', '.join(task.scenario.receiver.readings)}: --receiver json"
        )


def run(options: argparse.Namespace) -> None:
    """The command."""
    task = build_task(options.env, overrides=parse_overrides([text for group in options.set for text in group], None))
    receiver = make_receiver(options.receiver)
    vehicle = make_vehicle(options.vehicle)
    check_play(options, task)
    if options.report and not Path(options.report).absolute().parent.is_dir():
        raise ValueError(f"--report {options.report}: there is no such folder; make it first")
    mission = Sea(task, options.seed, receiver, vehicle, mathematical=options.headings == "mathematical")
    mission.water.sail(mission.course, 0.0)  # what must be compiled is, before anybody waits
    mission.water.reset(options.seed)
    ears = Port(options.port)
    helm: Port | Terminal = Terminal() if options.pty else Port(options.port + 1)
    specs = f"receiver {options.receiver}:{ears.spec}   vehicle {options.vehicle}:{helm.spec}"
    print(f"{specs}   tags {' '.join(mission.tags)}", flush=True)
    theatre = Theatre(mission, ears, helm, speed=options.speed, latency=options.latency, loss=options.loss, seed=options.seed)
    try:
        theatre.play(options.steps or task.scenario.episode_steps, wait=options.wait)
    finally:
        ears.close()
        helm.close()
    report = mission.report()
    if options.report:
        Path(options.report).write_text(json.dumps(report) + "\n", encoding="utf-8")
    print(json.dumps({name: value for name, value in report.items() if name not in ("fish", "vehicle")}), flush=True)


class Water(Simulation):
    """The truth of one world: fish that swim and a vehicle that goes where it is told."""

    def __init__(self, task: Task) -> None:
        super().__init__(task.scenario, tracks=task.tracks)
        self._orders = np.zeros((1, 1, 2))

    def sail(self, course: float, speed: float) -> None:
        """A step on a course [rad] at a speed [m/s]."""
        self._orders[0, 0] = course, min(max(speed, 0.0), self.scenario.vehicle.max_speed)
        parameters = to_record(world_rule(self.scenario))
        scratch = make_scratch(self.scenario.belief.particles)
        sail_worlds(0, 1, parameters, self._tracks, self._orders, self.worlds, self.outputs, scratch)


class Sea:
    """A simulated mission in the words of a receiver and a vehicle."""

    def __init__(self, task: Task, seed: int, receiver: Receiver, vehicle: VehicleLink, *, mathematical: bool) -> None:
        if task.scenario.vehicles != 1:
            raise ValueError(f"one vehicle is simulated, got vehicles={task.scenario.vehicles}")
        self.task, self.receiver, self.vehicle = task, receiver, vehicle
        self.water = Water(task)
        self.water.reset(seed)
        self.conventions = Conventions(
            headings="mathematical" if mathematical else "nautical", origin=ORIGIN if vehicle.in_degrees else None
        )
        self.tags = [str(1285 + tag) for tag in range(task.scenario.targets)]
        navigation = self.water.worlds.navigation[0, 0]
        self.course, self.speed = float(navigation["heading"]), 0.0
        self._number = itertools.count(1)
        self._names = [COLUMN_OF.get(name, name) for name in task.scenario.receiver.readings]
        self._fish: list[list[float]] = []
        self._vehicle: list[list[float]] = []
        self.orders = 0
        self._write_down()

    @property
    def time(self) -> float:
        """Since the beginning [s]."""
        return float(self.water.worlds.clock["step"][0]) * self.task.scenario.time_step

    def step(self) -> None:
        """Go on as the vehicle was told last."""
        self.water.sail(self.course, self.speed)
        self._write_down()

    def _write_down(self) -> None:
        self._fish.append(self.water.fish_position[0].astype(float).ravel().tolist())
        self._vehicle.append(self.water.vehicle_position[0, 0].tolist())

    def fix(self, epoch: float) -> bytes:
        """What the vehicle says of itself."""
        own = self.water.worlds.navigation[0, 0]
        first, second = self.conventions.place_out(float(own["x"]), float(own["y"]))
        heading = self.conventions.heading_out(float(own["heading"]))
        return self.vehicle.tell(Fix(epoch + self.time, first, second, heading, float(own["speed"])))

    def pings(self, epoch: float) -> list[bytes]:
        """What the receiver says of the last step."""
        lines = []
        for tag, told in enumerate(self.water.worlds.measurements[0, 0]):
            if told["status"] == int(Status.HEARD):
                read = zip(self._names, told["readings"].tolist(), strict=False)
                values = {name: value for name, value in read if np.isfinite(value)}
                arrival = epoch + float(told["arrival"])
                heard = Heard(epoch + float(told["time"]), self.tags[tag], True, arrival, float(told["depth"]), values)
            elif told["status"] == int(Status.MISSED):
                if self.receiver.name != "json":
                    continue
                heard = Heard(epoch + float(told["time"]), self.tags[tag], False, None, float(told["depth"]), {})
            else:
                continue
            lines.append(self.receiver.write(heard, next(self._number)))
        return lines

    def told(self, line: bytes) -> bool:
        """A line that came for the vehicle; whether it was an order."""
        try:
            asked = self.vehicle.obey(line)
        except BadLine:
            return False
        if asked is None:
            return False
        self.course, self.speed = self.conventions.heading_in(asked[0]), asked[1]
        self.orders += 1
        return True

    def report(self) -> dict[str, Any]:
        """What is left of it: the fish's and the vehicle's path."""
        return {
            "env": self.task.env_id, "time_step": self.task.scenario.time_step, "steps": len(self._fish) - 1,
            "orders": self.orders, "tags": self.tags, "origin": self.conventions.origin, "fish": self._fish,
            "vehicle": self._vehicle,
        }  # fmt: skip


class Port:
    """A TCP port of this machine that serves one client after the other."""

    def __init__(self, port: int) -> None:
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._server.bind(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            self._server.close()
            raise OSError(f"port {port} cannot be had ({getattr(error, 'strerror', error)}); choose another --port") from None
        self._server.listen(1)
        self._server.setblocking(False)
        self._client: socket.socket | None = None
        self._rest = b""
        self.spec = f"tcp:127.0.0.1:{port}"

    @property
    def connected(self) -> bool:
        """Whether somebody is there."""
        if self._client is None:
            with contextlib.suppress(BlockingIOError):
                self._client, _ = self._server.accept()
                self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._client.setblocking(False)
        return self._client is not None

    def descriptors(self) -> list[int]:
        return [self._server.fileno() if self._client is None else self._client.fileno()]

    def send(self, data: bytes) -> None:
        if self.connected and self._client is not None:
            try:
                self._client.sendall(data)
            except OSError:
                self._drop()

    def lines(self) -> list[bytes]:
        """Whole lines that have come."""
        if not self.connected or self._client is None:
            return []
        try:
            data = self._client.recv(1 << 16)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._drop()
            return []
        *lines, self._rest = (self._rest + data.replace(b"\r", b"\n"))[-(1 << 20) :].split(b"\n")
        self._rest = self._rest[-LONGEST_LINE:]
        return [line for line in lines if line]

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client, self._rest = None, b""

    def close(self) -> None:
        self._drop()
        self._server.close()


class Terminal:
    """A pseudo-terminal: a serial line without a cable."""

    def __init__(self) -> None:
        import pty
        import tty

        self._end, self._other = pty.openpty()
        tty.setraw(self._other)
        os.set_blocking(self._end, False)
        self._rest = b""
        self.spec = f"serial:{os.ttyname(self._other)}:19200"
        self.connected = True

    def descriptors(self) -> list[int]:
        return [self._end]

    def send(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):
            os.write(self._end, data)

    def lines(self) -> list[bytes]:
        try:
            data = os.read(self._end, 1 << 16)
        except (BlockingIOError, OSError):
            return []
        *lines, self._rest = (self._rest + data.replace(b"\r", b"\n")).split(b"\n")
        return [line for line in lines if line]

    def close(self) -> None:
        os.close(self._end)
        os.close(self._other)


class Theatre:
    """Plays a mission over two connections, in lockstep or against a clock, with lines that come late or get lost."""

    def __init__(
        self, sea: Sea, ears: Port, helm: Port | Terminal, *, speed: float, latency: float, loss: float, seed: int
    ) -> None:
        self.sea, self.ears, self.helm = sea, ears, helm
        self.speed, self.latency, self.loss = speed, latency, loss
        self._rng = np.random.default_rng([seed, 1])
        self._clock = make_clock(speed)
        self.epoch = 0.0  # what the clocks say when the mission begins
        self._coming: list[tuple[float, int, Any, bytes]] = []  # lines under way: when, count, where to (None: our vehicle), what
        self._count = itertools.count()
        self._fresh = True  # whether the vehicle has a fix that it has not told
        self._asked = False

    def play(self, steps: int, *, wait: float) -> None:
        """So many steps, once both ends are there."""
        until = time.monotonic() + wait
        while not (self.ears.connected and self.helm.connected):
            if time.monotonic() > until:
                raise RuntimeError(f"nobody came within {wait:g} s; start {tagtrack_here()} live steer, or give more --wait")
            select.select(self.ears.descriptors() + self.helm.descriptors(), [], [], 0.05)
        if self.speed > 0:
            self.epoch = self._clock()
        for step in range(steps + 1):
            self._speak(first=step == 0)
            if self.speed == 0:
                self._await_order()
            else:
                self._pass_time(self.epoch + (step + 1) * self.sea.task.scenario.time_step)
            if step < steps:
                self.sea.step()
        time.sleep(0.2)  # let the last lines be read

    def _speak(self, *, first: bool) -> None:
        for line in [] if first else self.sea.pings(self.epoch):
            self._post(self.ears, line)
        self._fresh = True
        if not self.sea.vehicle.question or self._asked:
            self._tell()

    def _tell(self) -> None:
        if self._fresh:  # between two steps there is nothing new to tell: the answer comes with the next one
            self._post(self.helm, self.sea.fix(self.epoch))
            self._fresh = self._asked = False

    def _post(self, where: Any, line: bytes) -> None:
        """Send a line on its way."""
        if self.speed == 0:
            where.send(line)
            return
        if self._rng.random() < self.loss:
            return
        when = self._clock() + self.latency * self._rng.uniform(0.5, 1.5)
        heapq.heappush(self._coming, (when, next(self._count), where, line))

    def _listen(self) -> bool:
        """Take up what came from the helm; whether an order came."""
        ordered = False
        for line in self.helm.lines():
            if self.sea.vehicle.asks(line):
                self._asked = True
                self._tell()
            elif self.speed == 0:
                ordered = self.sea.told(line) or ordered
            elif self._rng.random() >= self.loss:
                when = self._clock() + self.latency * self._rng.uniform(0.5, 1.5)
                heapq.heappush(self._coming, (when, next(self._count), None, line))
        return ordered

    def _await_order(self) -> None:
        until = time.monotonic() + PATIENCE
        while not self._listen():
            if time.monotonic() > until:
                raise RuntimeError(f"no order came within {PATIENCE:g} s; did the other end stop?")
            select.select(self.helm.descriptors(), [], [], 0.5)

    def _pass_time(self, until: float) -> None:
        while (now := self._clock()) < until:
            self._listen()
            while self._coming and self._coming[0][0] <= now:
                _, _, where, line = heapq.heappop(self._coming)
                if where is None:
                    self.sea.told(line)
                else:
                    where.send(line)
            ahead = min(until, self._coming[0][0] if self._coming else math.inf) - now
            select.select(self.helm.descriptors(), [], [], max(min(ahead / max(self.speed, 1e-9), 0.02), 0.0005))
