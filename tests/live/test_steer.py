"""A mission as a user runs it: two processes over loopback, kills at any moment, and what is refused before anything is sent."""

from __future__ import annotations

import errno
import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagtrack.envs.task import build_task
from tagtrack.live.chart import draw_chart
from tagtrack.live.helm import Helm
from tagtrack.live.journal import JOURNAL_FILE, Journal, mend, read_events
from tagtrack.live.rehearse import SILENT, own_errors, rehearse
from tagtrack.live.sources import Source
from tagtrack.live.steer import (
    Loop,
    handle,
    make_orders,
    make_receiver,
    make_vehicle,
    prepare,
    read_header,
    replay_journal,
)
from tagtrack.live.tracker import Estimate

Live = Callable[..., tuple[int, str, str]]
PYTHON = (sys.executable, "-m", "tagtrack.live")


def free_port() -> int:
    """A port that is free, as is the next one."""
    for port in random.Random(os.getpid() + time.monotonic_ns()).sample(range(20_000, 60_000, 2), 200):
        with socket.socket() as first, socket.socket() as second:
            try:
                first.bind(("127.0.0.1", port))
                second.bind(("127.0.0.1", port + 1))
            except OSError:
                continue
            return port
    raise RuntimeError("no port is free")


@pytest.mark.parametrize("env_id", ["LeopardShark-v0", "RangeOnly-v0", "AreaOnly-v0"])
def test_in_lockstep_errors_are_the_environments_own(env_id: str) -> None:
    options = {"policy": "circle", "seed": 5, "steps": 60, "particles": 200, "port": free_port()}
    found, helm = rehearse(env_id, receiver="json", vehicle="json", mathematical=True, **options)  # type: ignore[arg-type]
    own = own_errors(build_task(env_id, particles=200), "circle", episodes=1, seed=5, steps=60)[0]
    np.testing.assert_allclose(found, own, atol=1e-9)
    assert not helm.counts and helm.fixes == 61


@pytest.mark.parametrize(("env_id", "receiver", "vehicle"), [("AreaOnly-v0", "tbr", "goby"), ("LeopardShark-v0", "json", "iver")])
def test_missions_by_the_protocols_of_vendors(env_id: str, receiver: str, vehicle: str) -> None:
    pytest.importorskip("pymap3d")
    terminal = vehicle == "iver"
    if terminal:
        pytest.importorskip("serial")
        pytest.importorskip("pty")
    ends = {"receiver": receiver, "vehicle": vehicle, "pty": terminal}
    found, helm = rehearse(env_id, policy="circle", seed=3, steps=60, particles=200, port=free_port(), **ends)  # type: ignore[arg-type]
    assert np.isfinite(found).all() and helm.fixes == 61 and not helm.counts
    assert helm.tracker is not None and not helm.tracker.last_estimates()[0].lost


def mission(folder: Path, port: int) -> list[str]:
    return [
        *PYTHON, "steer", "--env", "LeopardShark-v0", "--particles", "100", "--policy", "circle:20", "--tags", "1285",
        "--receiver", f"json:tcp:127.0.0.1:{port}", "--vehicle", f"json:tcp:127.0.0.1:{port + 1}", "--speed", "20",
        "--log", str(folder), "--duration", "60",
    ]  # fmt: skip


@pytest.mark.parametrize("kills", [3, pytest.param(50, marks=pytest.mark.slow)])
def test_a_mission_that_is_killed_goes_on_with_the_same_belief(tmp_path: Path, kills: int) -> None:
    """After each kill the journal is whole, and what it makes the helm say is, byte for byte, what was sent."""
    port, folder, rng = free_port(), tmp_path / "mission", random.Random(0)
    sea = [*PYTHON, "simulate", "--env", "LeopardShark-v0", "--port", str(port), "--speed", "20", "--steps", "100000"]
    with subprocess.Popen(sea, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as simulation:
        try:
            fixes, belief = 0, b""
            for kill in range(kills):
                command = mission(folder, port) if kill == 0 else [*PYTHON, "steer", "--resume", str(folder), "--duration", "60"]
                least = events(folder) + 4
                with subprocess.Popen(command, stderr=subprocess.DEVNULL) as steer:
                    wait_until(lambda least=least: events(folder) >= least, steer)
                    time.sleep(rng.uniform(0.0, 0.7))
                    steer.send_signal(signal.SIGKILL)
                mend(folder / JOURNAL_FILE)
                told = list(read_events(folder / JOURNAL_FILE))
                helm, _, _ = prepare(read_header(folder))
                said: list[str] = []
                for event in told[1:]:
                    if "from" in event:
                        order = handle(helm, event["from"], event["line"].encode("latin-1"), event["t"])
                        said += [] if order is None else [helm.vehicle.order(order).decode("latin-1")]
                sent = [event["line"] for event in told if "to" in event and "safe" not in event]
                assert [line for line in said if line in set(sent)] == sent  # a kill may come before an order went out
                assert len(said) - len(sent) <= kill + 1 and helm.fixes > fixes
                other, _, _ = prepare(read_header(folder))
                replay_journal(folder / JOURNAL_FILE, other)
                fixes = helm.fixes
                assert helm.tracker is not None and other.tracker is not None
                belief = helm.tracker.believer.worlds.particles.tobytes()
                assert other.tracker.believer.worlds.particles.tobytes() == belief
        finally:
            simulation.kill()


def events(folder: Path) -> int:
    path = folder / JOURNAL_FILE
    return path.read_bytes().count(b"\n") if path.exists() else 0


def wait_until(done: Callable[[], bool], process: subprocess.Popen[bytes], seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not done():
        assert process.poll() is None and time.monotonic() < until, "the other end stopped, or nothing came"
        time.sleep(0.02)


def test_a_half_line_is_cut_off_and_a_damaged_one_is_told(tmp_path: Path, live: Live) -> None:
    path = tmp_path / JOURNAL_FILE
    path.write_text('{"mission":{},"format":1}\n{"t":1.0,"from":"vehicle","line":"x"}\n{"t":2.0,"fro')
    mend(path)
    assert len(list(read_events(path))) == 2
    status, _, error = live("steer", "--resume", tmp_path)
    assert status == 2 and "does not say env; begin a new mission" in error
    path.write_text("{}\nnonsense\n")
    with pytest.raises(ValueError, match="line 2 is damaged"):
        list(read_events(path))
    path.write_text('{"mission":{},"format":1,"from":"vehicle","line":"x"}\n')  # the first line, run together with the second
    with pytest.raises(ValueError, match="line 1 is damaged"):
        list(read_events(path))


NEW = ("--env", "AreaOnly-v0", "--policy", "circle", "--tags", "1", "--log", "m")
BAD = [
    (("--env", "AreaOnly-v0"), "a new mission needs --policy"),
    ((*NEW, "--receiver", "tbr", "--vehicle", "json:-"), "--receiver is KIND:SOURCE, as tbr:tcp:localhost:5000"),
    ((*NEW, "--receiver", "tbr:udp:5001", "--vehicle", "json:udp:5001"), "receiver and vehicle cannot both be udp:5001"),
    ((*NEW, "--receiver", "tbr:udp:99999", "--vehicle", "json:-"), "a port is a number from 1 to 65535"),
    ((*NEW, "--receiver", "tbr:none/at/all", "--vehicle", "json:-"), "neither -, udp:PORT, tcp:HOST:PORT"),
    ((*NEW, "--receiver", "tbr:log.txt", "--vehicle", "json:-", "--box", "0,0 1,1"), "at least three corners"),
    ((*NEW, "--receiver", "tbr:log.txt", "--vehicle", "json:-", "--origin", "1", "2"), "--origin is for vehicles that tell"),
    (("--resume", "none"), "none holds no journal.jsonl"),
    ((*NEW, "--policy", "run", "--receiver", "tbr:a", "--vehicle", "json:-"), "unknown policy 'run'"),
]


@pytest.mark.parametrize(("options", "message"), BAD)
def test_mistakes_end_in_one_line(tmp_path: Path, live: Live, monkeypatch, options: tuple[str, ...], message: str) -> None:
    monkeypatch.chdir(tmp_path)
    status, _, error = live("steer", *options)
    assert status == 2 and message in error and error.count("\n") == 1


def test_a_port_in_use_is_named(tmp_path: Path, live: Live, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("", 0))
        port = taken.getsockname()[1]
        status, _, error = live("steer", *NEW, "--receiver", f"tbr:udp:{port}", "--vehicle", "json:-")
        assert status == 2 and f"udp port {port} cannot be had" in error
    status, _, error = live("simulate", "--env", "LeopardShark-v0", "--receiver", "tbr")
    assert status == 2 and "reads units, strength: --receiver json" in error


def test_a_strangers_receiver_by_ten_lines_of_json(tmp_path: Path) -> None:
    """A file that somebody appends to, and a vehicle on standard input and output."""
    pings = tmp_path / "pings.txt"
    pings.touch()
    command = [
        *PYTHON, "steer", "--env", "RangeOnly-v0", "--particles", "100", "--policy", "circle:50", "--tags", "seal",
        "--receiver", f"json:{pings}", "--vehicle", "json:-", "--log", "m", "--duration", "60",
    ]  # fmt: skip
    with subprocess.Popen(
        command, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as steer:
        assert steer.stdin is not None and steer.stdout is not None and steer.stderr is not None
        orders = []
        for second in range(4):
            with pings.open("a") as file:
                print(json.dumps({"tag": "seal", "range": 120.0 - second}), file=file)
            print(json.dumps({"x": float(second), "y": 0.0, "heading": 90.0, "speed": 1.0}), file=steer.stdin, flush=True)
            orders.append(json.loads(steer.stdout.readline()))
        steer.stdin.close()
        assert steer.wait(30) == 0, steer.stderr.read()
    assert all(0 <= order["course"] < 360 and order["speed"] == 1.0 for order in orders)
    lines = [event for event in read_events(tmp_path / "m" / JOURNAL_FILE) if "from" in event]
    assert {event["from"] for event in lines} == {"receiver", "vehicle"}


def test_compiling_ahead(live: Live) -> None:
    status, shown, error = live("compile", "--env", "LeopardShark-v0", "--policy", "three_step", "--tags", "1", "2")
    assert status == 0, error
    assert shown.startswith("ready after")
    assert live("compile", "--env", "Leopard")[0] == 2


def test_without_a_journal_the_vehicle_is_told_to_be_safe(tmp_path: Path) -> None:
    """The disk is full from the second fix on: the last that goes out is the safe action, and the error says what to do."""

    class Full(Journal):
        def note(self, event):
            if "from" in event and event["line"].startswith('{"x": 2'):
                raise OSError(errno.ENOSPC, "No space left on device")
            super().note(event)

    class Wire(Source):
        def __init__(self, lines: bytes) -> None:
            super().__init__()
            self.lines, self.sent = lines, b""

        def _receive(self) -> bytes:
            lines, self.lines = self.lines, b""
            return lines

        def write(self, data: bytes) -> bool:
            self.sent += data
            return True

    asked = {
        **SILENT, "env": "RangeOnly-v0", "particles": 50, "set": [], "tags": ["7"], "seed": 0, "policy": "circle",
        "safe": "stop", "headings": None, "stamp": "receiver", "speed": 1.0,
    }  # fmt: skip
    helm = Helm(make_orders(asked, in_degrees=False, mathematical_allowed=True), make_receiver("json"), make_vehicle("json"))
    vehicle = Wire(b'{"x": 1, "y": 0, "speed": 1}\n{"x": 2, "y": 0, "speed": 1}\n{"x": 3, "y": 0, "speed": 1}\n')
    loop = Loop(helm, Full(tmp_path / JOURNAL_FILE, fresh=True), Wire(b""), vehicle, clock=time.time, tell=False)
    with pytest.raises(OSError, match="cannot be written .No space left on device.; make room and --resume"):
        loop.run(5.0)
    orders = [json.loads(line) for line in vehicle.sent.splitlines()]
    assert len(orders) == 2 and orders[1]["speed"] == 0.0


def test_a_chart_is_drawn(tmp_path: Path) -> None:
    estimates = [Estimate(tag="A", time=0.0, x=3.0, y=4.0, covariance=np.eye(2), best_x=3.0, best_y=4.0, heard=0.0, lost=False)]
    draw_chart(tmp_path / "chart.png", [(0.0, 0.0), (10.0, 5.0)], estimates)
    assert (tmp_path / "chart.png").read_bytes().startswith(b"\x89PNG")
