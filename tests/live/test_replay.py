"""Recorded missions once more: the environment's own estimates, whatever the order of the lines; and what people get of them."""

from __future__ import annotations

import csv
import json
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagtrack.envs.task import Task, build_task
from tagtrack.live.calibrated import read_range_finder
from tagtrack.live.journal import JOURNAL_FILE, Journal
from tagtrack.live.recording import Recorder
from tagtrack.live.steer import handle, prepare
from tests.live.conftest import sail
from tests.tasks import LONE

Live = Callable[..., tuple[int, str, str]]


def record(folder: Path, task: Task, env_id: str, *, seed: int = 4, steps: int = 60) -> np.ndarray:
    """Record an episode; (K + 1, T, 2) estimates of the environment itself."""
    estimates, recorder = [], None
    for _, simulation, _ in sail(task, "circle", seed, steps):
        recorder = recorder or Recorder(simulation)
        recorder.note()
        estimates.append(simulation.estimate[0, 0].copy())
    assert recorder is not None
    recorder.write(folder, env_id=env_id, seed=seed, preset=None, overrides={})
    return np.array(estimates)


def estimates_of(folder: Path, tags: int) -> np.ndarray:
    with (folder / "estimates.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return np.array([[float(row["best_x"]), float(row["best_y"])] for row in rows]).reshape(-1, tags, 2)


@pytest.mark.parametrize(("env_id", "tags"), [*((env_id, 1) for env_id in LONE), ("TagTrack/LeopardShark-v0", 3)])
def test_a_recorded_episode_gives_its_own_estimates_bit_for_bit(tmp_path: Path, live: Live, env_id: str, tags: int) -> None:
    own = record(tmp_path / "log", build_task(env_id, particles=150, tags=tags), env_id)
    status, shown, error = live("replay", "--log", tmp_path / "log", "--out", tmp_path / "out")
    assert status == 0, error
    np.testing.assert_array_equal(estimates_of(tmp_path / "out", tags), own)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "within_3_sigma" in summary["tags"]["0"]["against_reference"]
    assert (tmp_path / "out" / "map.png").read_bytes().startswith(b"\x89PNG")


def test_shuffled_and_doubled_lines_change_nothing_and_dropped_ones_little(tmp_path: Path, live: Live) -> None:
    own = record(tmp_path / "log", build_task("RangeOnly-v0", particles=150), "RangeOnly-v0")
    rng = random.Random(0)
    for name in ("navigation.csv", "readings.csv"):
        path = tmp_path / "log" / name
        text = path.read_text().splitlines()
        head = 1 + sum(line.startswith("#") for line in text)
        lines = text[head:] + text[head : head + 20]
        rng.shuffle(lines)
        path.write_text("\n".join([*text[:head], *lines]) + "\n")
    assert live("replay", "--log", tmp_path / "log", "--out", tmp_path / "out")[0] == 0
    np.testing.assert_array_equal(estimates_of(tmp_path / "out", 1), own)
    path = tmp_path / "log" / "readings.csv"
    header, *lines = path.read_text().splitlines()
    path.write_text("\n".join([header, *lines[::2]]) + "\n")
    status, shown, _ = live("replay", "--log", tmp_path / "log", "--out", tmp_path / "out")
    assert status == 0 and "rows stood after a later one and were sorted" in shown
    assert not np.array_equal(estimates_of(tmp_path / "out", 1), own)


def test_filters_are_compared_as_a_user_types_it(tmp_path: Path) -> None:
    record(tmp_path / "log", build_task("LeopardShark-v0", particles=100), "LeopardShark-v0")
    command = [sys.executable, "-m", "tagtrack.live", "replay", "--log", "log", "--out", "out", "--compare", "standard", "levy"]
    done = subprocess.run([*command, "--seeds", "2"], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    table = (tmp_path / "out" / "comparison.md").read_text()
    assert "standard" in table and "levy" in table and "NEES" in table
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "comparison.md", "estimates.csv", "map.png", "summary.json",
    ]  # fmt: skip


def test_arrivals_become_ranges_by_a_calibration(tmp_path: Path, live: Live) -> None:
    """A tag at rest 75 m east of a vehicle that circles: its pings take that long, and the clock is the calibrated one."""
    calibration = {"by_line": {"period": 2.00001}, "first_ping_s": 0.25, "sound_speed_m_s": 1500.0, "code": 27}
    (tmp_path / "calibration.json").write_text(json.dumps(calibration))
    navigation, readings = ["t,x,y,heading,speed"], ["t,tag,bearing_units,arrival"]
    for step in range(120):
        t, angle = 2.0 * step, 0.05 * step
        x, y = 40.0 * np.cos(angle), 40.0 * np.sin(angle)
        navigation.append(f"{t},{x},{y},{(-np.degrees(angle)) % 360},1.0")
        way = np.hypot(75.0 - x, y)
        ping = 0.25 + 2.00001 * step
        bearing = np.degrees(np.arctan2(-y, 75.0 - x) - (angle + np.pi / 2))
        off = 90.0 - abs((bearing + 180.0) % 360.0 - 180.0)
        units = round(((-1e-6 * off + 2e-5) * off + 0.0947) * off - 0.2757)
        readings.append(f"{t + 2.0},27,{units},{ping + way / 1500.0}")
    for name, lines in (("nav.csv", navigation), ("pings.csv", readings)):
        (tmp_path / name).write_text("\n".join(lines) + "\n")
    (tmp_path / "truth.csv").write_text("t,x,y\n0,75,0\n300,75,0\n")
    files = ("--log", tmp_path / "nav.csv", tmp_path / "pings.csv", "--reference", tmp_path / "truth.csv")
    status, shown, error = live(
        "replay", *files, "--env", "TimeOfFlight-v0", "--calibration", tmp_path / "calibration.json", "--out", tmp_path / "out"
    )
    assert status == 0, error
    judged = json.loads((tmp_path / "out" / "summary.json").read_text())["tags"]["27"]["against_reference"]
    assert judged["median_error_m"] < 8.0
    status, _, error = live("replay", *files, "--env", "TimeOfFlight-v0", "--out", tmp_path / "out")
    assert status == 2 and "a TimeOfFlightReceiver needs range" in error


BAD = [
    ((), "say which task's filter to use"),
    (("--env", "Leopard-v0"), "unknown"),
    (("--env", "RangeOnly-v0", "--tags", "8"), "tag 8 is not in this mission; the log has 7"),
    (("--env", "LeopardShark-v0"), "reading at t=10: tag '7': a StereoHydrophone needs bearing_units"),
    (("--env", "RangeOnly-v0", "--reference", "none.csv"), "no reference track file none.csv"),
    (("--env", "RangeOnly-v0", "--reference", "far.csv"), "has no time in common with the log"),
    (("--env", "RangeOnly-v0", "--compare", "kalman"), "unknown filter 'kalman'; known: standard"),
    (("--env", "RangeOnly-v0", "--origin", "1", "2"), "--origin is for logs with lon,lat"),
    (("--env", "RangeOnly-v0", "--calibration", "none.json"), "no calibration none.json"),
    (("--env", "RangeOnly-v0", "--out", "."), "holds"),
]


@pytest.mark.parametrize(("options", "message"), BAD)
def test_mistakes_end_in_one_line(tmp_path: Path, live: Live, monkeypatch, options: tuple[str, ...], message: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("nav.csv").write_text("t,x,y,heading,speed\n0,0,0,90,1\n10,10,0,90,1\n20,20,0,90,1\n")
    Path("pings.csv").write_text("t,tag,range\n10,7,120\n")
    Path("far.csv").write_text("t,x,y\n1000,1,1\n2000,1,1\n")
    status, _, error = live("replay", "--log", "nav.csv", "pings.csv", "--out", "out", *options)
    assert status == 2 and message in error and error.count("\n") == 1
    assert not Path("out").exists() or not list(Path("out").iterdir())


def test_the_journal_of_a_mission_is_a_log(tmp_path: Path, live: Live) -> None:
    asked = {
        "env": "RangeOnly-v0", "filter": None, "particles": 100, "set": [], "tags": ["7"], "seed": 3, "policy": "circle:50",
        "headings": None, "origin": None, "box": None, "safe": "hold", "home": None, "depth": 0.0, "late": 60.0, "stale": 15.0,
        "stamp": "receiver", "speed": 1.0, "receiver": "json:-", "vehicle": "json:tcp:localhost:1", "feet": False,
        "checksum": True, "degrees": False,
    }  # fmt: skip
    helm, _, _ = prepare(asked)
    folder = tmp_path / "mission"
    folder.mkdir()
    journal = Journal(folder / JOURNAL_FILE, fresh=True)
    journal.note({"mission": asked, "format": 1})
    for step in range(30):
        now = 1e9 + 10.0 * step
        lines = [("receiver", f'{{"t": {now - 0.5}, "tag": "7", "range": {150 - step}}}'), ("receiver", "nonsense")]
        lines += [("vehicle", f'{{"t": {now}, "x": {step}, "y": 0, "heading": 90, "speed": 0.1}}')]
        for who, line in lines:
            journal.note({"t": now, "from": who, "line": line})
            handle(helm, who, line.encode(), now)
    journal.close()
    assert helm.tracker is not None
    assert live("replay", "--log", folder, "--out", tmp_path / "out")[0] == 0
    last = helm.tracker.last_estimates()[0]
    np.testing.assert_allclose(estimates_of(tmp_path / "out", 1)[-1, 0], (last.best_x, last.best_y))


@pytest.mark.parametrize(
    "changes", [{"first_ping_s": 10**401}, {"by_line": {"period": -(10**401)}}, {"by_line": []}, {"sound_speed_m_s": None}]
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, changes: dict) -> None:
    calibration = {"by_line": {"period": 2.0}, "first_ping_s": 0.25, "sound_speed_m_s": 1500.0, "code": 27}
    (tmp_path / "calibration.json").write_text(json.dumps(calibration | changes))
    with pytest.raises(ValueError, match="is no calibration that eval calibrate has written"):
        read_range_finder(tmp_path)
