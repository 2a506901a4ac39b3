"""Files and lines that somebody else, a bad disk or a bad cable has written: sound ones, changed in a few places."""

from __future__ import annotations

import contextlib
import copy
import gzip
import io
import json
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from tagtrack.envs.layout import action_names, feature_names
from tagtrack.envs.motions.tracks import read_tracks
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.eval.aggregate import print_aggregate, ratio_of, read_benchmark
from tagtrack.eval.benchmark_pictures import read_curve
from tagtrack.eval.field.array.sound import read_sound_speed
from tagtrack.eval.field.tag_clock.arrivals import read_arrivals
from tagtrack.eval.field.telemetry import read_detections, read_receivers, read_reference
from tagtrack.live.calibrated import read_range_finder
from tagtrack.live.mission_log import read_log
from tagtrack.policies.box import boxed_policy
from tagtrack.policies.files import load_policy
from tagtrack.train.checkpoint import load_checkpoint
from tagtrack.train.config import from_json
from tagtrack.train.run_folder import RunFolder
from tagtrack.train.session import draw_curve

SHARK = "TagTrack/LeopardShark-v0"
ODD_BYTES = [
    b"",
    b"\0",
    b"\xff",
    b"\r",
    b"\n",
    b",",
    b'"',
    b"nan",
    b"-1",
    b"1e999",
    b"9" * 401,
    b"null",
    b"{",
    b"[" * 2000,
    b"\xef\xbb\xbf",
]
ODD_VALUES = [
    None,
    True,
    -1,
    0,
    1.5,
    10**401,
    -(10**30),
    1e308,
    float("nan"),
    float("inf"),
    "",
    "\0",
    "x" * 300,
    [],
    [None],
    {},
    {"a": []},
]

spots = st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(ODD_BYTES) | st.binary(max_size=6))
edits = st.lists(spots, min_size=1, max_size=4)
leaves = st.sampled_from(ODD_VALUES) | st.floats() | st.integers() | st.text(max_size=5)
json_edits = st.lists(
    st.tuples(st.integers(0, 100), st.sampled_from(["set", "drop", "add"]), leaves), min_size=1, max_size=3
)


def edited(sound: bytes, changes: list[tuple[float, int, bytes]]) -> bytes:
    """Bytes with pieces cut out, and others put in."""
    for where, length, new in changes:
        at = int(where * len(sound))
        sound = sound[:at] + new + sound[at + length :]
    return sound


def edited_json(sound: Any, changes: list[tuple[int, str, Any]]) -> str:
    """A document with values exchanged, left out and added."""
    tree = json.loads(json.dumps(sound))
    for number, kind, value in changes:
        places = list(_places(tree))
        if places:
            holder, key = places[number % len(places)]
            if kind == "set":
                holder[key] = copy.deepcopy(value)
            elif kind == "drop":
                del holder[key]
            elif isinstance(holder, dict):
                holder[f"{key}x"] = copy.deepcopy(value)
    return json.dumps(tree)


def _places(tree: Any) -> Any:
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ():
        yield tree, key
        yield from _places(tree[key])


def refused(read: Callable[[], object]) -> bool:
    """Whether it is refused, in one line once blanks are one."""
    try:
        read()
    except (ValueError, OSError) as error:
        assert str(error)
        return True
    return False


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="tagtrack-fuzz-")  # gone with the process


def place() -> Path:
    return Path(_folder().name)


def written(name: str, content: bytes | str) -> Path:
    path = place() / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass"))
    return path


TIMES = [1.6e9 + 10 * k for k in range(12)]
TRACK = "t_unix_s,x,y,tag\n" + "".join(f"{t},{k},{-k},a\n" for k, t in enumerate(TIMES))
DETECTIONS = "t_unix_s,receiver,tag\n" + "".join(f"{t},N,a-{k}\n" for k, t in enumerate(TIMES))
VUE = "Date and Time (UTC),Receiver,Transmitter\n"
VUE += "".join(f"2019-09-09 16:04:{k:02d},VR2W-1,A69-1601-{k}\n" for k in range(10))
LOG = "t,x,y,heading,speed,tag,bearing_units,strength\n0,0,0,90,1,,,\n1,1,0,90,1,7,-3,40\n2,2,0,90,1,7,2,50\n"
LOG_LINES = '{"t": 0, "x": 0, "y": 0, "heading": 90, "speed": 1}\n{"t": 1, "tag": "7", "strength": 40}\n'
TABLES: dict[str, tuple[Callable[[Path], object], str]] = {
    "track.csv": (read_tracks, TRACK),
    "detections.csv": (lambda path: read_detections([path]), DETECTIONS),
    "vue.csv": (lambda path: read_detections([path]), VUE),
    "receivers.csv": (read_receivers, "receiver,x,y,depth\nN,0,100,5\nS,0,-100,5\nE,100,0,5\n"),
    "degrees.csv": (read_receivers, "receiver,lon,lat,depth\nN,1.5,41.2,5\nS,1.501,41.201,5\n"),
    "reference.csv": (read_reference, "tag,x,y\na,1,2\nb,3,4\n"),
    "arrivals.csv": (read_arrivals, "t_s,code\n1,117\n3,121\n5,117\n"),
    "sound.csv": (lambda path: read_sound_speed(str(path)), "t_unix_s,sound_speed\n1600000000,1500\n1600000900,1510\n"),
    "log.csv": (lambda path: read_log([path]), LOG),
    "log.jsonl": (lambda path: read_log([path]), LOG_LINES),
}


def try_table(asked: tuple[str, bool, list[tuple[float, int, bytes]]]) -> None:
    name, packed, changes = asked
    read, sound = TABLES[name]
    content = edited(sound.encode(), changes)
    if packed:
        content = edited(gzip.compress(sound.encode()), changes) if len(changes) > 2 else gzip.compress(content)
    refused(lambda: read(written(name, content)))


tables = st.tuples(st.sampled_from(list(TABLES)), st.booleans(), edits)


@cache
def sound_policy() -> tuple[bytes, dict[str, Any]]:
    folder = Path(boxed_policy(SHARK))
    return (folder / "policy.safetensors").read_bytes(), json.loads((folder / "policy.json").read_text())


def try_policy(asked: tuple[bool, list[tuple[float, int, bytes]], list[tuple[int, str, Any]]]) -> None:
    import hashlib

    mends, changes, json_changes = asked
    weights, description = sound_policy()
    written("policy.safetensors", changed := edited(weights, changes) if changes else weights)
    text = edited_json(description, json_changes) if json_changes else json.dumps(description)
    if mends and isinstance(told := json.loads(text), dict):  # sums that somebody set right
        rest = {key: value for key, value in told.items() if not key.endswith("sha256")}
        told["description_sha256"] = hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()
        told["weights_sha256"] = hashlib.sha256(changed).hexdigest()
        text = json.dumps(told)
    written("policy.json", text)
    scenario = SCENARIOS[SHARK]
    found: list[Any] = []
    if not refused(
        lambda: found.append(load_policy(place(), feature_names(scenario), action_names=action_names(scenario)))
    ):
        action, _ = found[0].predict(np.zeros((1, len(feature_names(scenario))), np.float32), deterministic=True)
        assert action.shape == (1, 2) and np.isfinite(action).all() and (np.abs(action) <= 1).all()


policies = st.tuples(st.booleans(), st.just([]) | edits, st.just([]) | json_edits)

CONFIG = {
    "env": SHARK, "algo": "ppo", "steps": 2000, "seed": 0, "num_envs": 8, "particles": 32, "tracks": None, "time_scale": None,
    "set": ["episode_steps=12"], "hyper": ["rollout=512"], "out": "run", "threads": 1, "device": "cpu", "settings": {},
    "scenario": {},
}  # fmt: skip
LATEST = {
    "folder": "steps_512", "steps": 512, "seconds": 1.5, "best_reward": -0.1, "best_error_m": 5.0, "next_validation": 600,
    "signature": "0" * 64,
}  # fmt: skip
PROGRESS = (
    "steps,seconds,steps_per_s,train_error_m,train_reward_per_step,validation_error_m,validation_reward_per_step,best_error_m\n"
    "0,0.1,0,,,9.0,-0.1,9.0\n512,1.5,900,8.0,-0.1,7.0,-0.08,7.0\n"
)
FIGURE = {"value": 1.0, "low": 0.9, "high": 1.1}
RATIO = {**FIGURE, "freedom": 30.0, "p": 0.5, "p_holm": 0.5, "median": FIGURE, "better": FIGURE}
BENCHMARK = {
    "env": SHARK,
    "policies": {"three_step": {"mean_error_m": FIGURE}, "circle": {"mean_error_m": FIGURE}},
    "ratios": {"three_step/circle": RATIO},
}
CALIBRATION = {"by_line": {"period": 4.0}, "first_ping_s": 1.0, "sound_speed_m_s": 1500.0, "code": 117}


def try_run(asked: tuple[str, list[tuple[int, str, Any]], list[tuple[float, int, bytes]]]) -> None:
    name, changes, bytes_changed = asked
    if name == "config":
        refused(lambda: from_json(written("config.json", edited_json(CONFIG, changes))))
    elif name == "latest":
        (place() / "checkpoint" / "steps_512").mkdir(parents=True, exist_ok=True)
        (place() / "checkpoint" / "steps_512" / "model.zip").touch()
        written("checkpoint/latest.json", edited_json(LATEST, changes))
        found: list[Any] = []
        if not refused(lambda: found.append(load_checkpoint(place()))):
            assert 0 <= found[0].progress.steps + found[0].progress.seconds
    elif name == "progress":
        written("config.json", json.dumps(CONFIG))
        written("progress.csv", edited(PROGRESS.encode(), bytes_changed))
        with RunFolder.open(place()) as folder:
            refused(folder.read_progress) or (len(bytes_changed) == 1 and draw_curve(folder))
        read_curve(place())
    elif name == "benchmark":
        written("benchmark.json", edited_json(BENCHMARK, changes))
        refused(lambda: _aggregate(place()))
    else:
        refused(lambda: read_range_finder(written("calibration.json", edited_json(CALIBRATION, changes))))


def _aggregate(folder: Path) -> None:
    document = read_benchmark(folder)
    with contextlib.redirect_stdout(io.StringIO()):
        print_aggregate([document], [ratio_of(document, "circle", folder)], "circle")


runs = st.tuples(st.sampled_from(["config", "latest", "progress", "benchmark", "calibration"]), json_edits, edits)

FILES = {"tables": (try_table, tables), "policies": (try_policy, policies), "runs": (try_run, runs)}
