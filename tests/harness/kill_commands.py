"""The commands that ``kill.py`` kills: how each is run, goes on, and what its folder must hold."""

from __future__ import annotations

import csv
import gzip
import json
import struct
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.eval.cli import main as evaluate
from tagtrack.policies.files import load_policy
from tagtrack.train import session, several
from tagtrack.train.cli import main as train

Line = Callable[[Path], int]
SMALL = ["--num-envs", "8", "--particles", "32", "--validation-episodes", "2", "--set", "episode_steps=12"]


class Command(ABC):
    """A command that writes a folder."""

    @abstractmethod
    def prepare(self, out: Path) -> None:
        """What is there before."""

    @abstractmethod
    def line(self, out: Path) -> int:
        """Run it; the exit status."""

    @abstractmethod
    def go_on(self, out: Path) -> Line:
        """How it goes on after a kill."""

    @abstractmethod
    def results(self, out: Path) -> dict[str, Any]:
        """What must not depend on kills."""

    def require_whole(self, out: Path) -> None:
        """Raise for a file, but for hidden ones, that cannot be read to its end."""
        for path in out.rglob("*") if out.exists() else ():
            hidden = any(part.startswith(".") for part in path.relative_to(out).parts)
            if path.is_file() and not hidden and "tensorboard" not in path.parts:
                require_readable(path)


def require_readable(path: Path) -> None:
    content = path.read_bytes()
    content = gzip.decompress(content) if path.suffix == ".gz" else content
    name = path.name.removesuffix(".gz")
    if name.endswith((".json", ".jsonl")):
        json.loads(content)
    elif name.endswith(".csv"):
        rows = list(csv.reader(content.decode().splitlines()))
        assert len({len(row) for row in rows}) == 1 and content.endswith(b"\n"), path
    elif name.endswith(".png"):
        at = 8
        while at < len(content):
            (length,) = struct.unpack(">I", content[at : at + 4])
            (check,) = struct.unpack(">I", content[at + 8 + length : at + 12 + length])
            assert zlib.crc32(content[at + 4 : at + 8 + length]) == check, path
            at += 12 + length
        assert content.endswith(b"IEND\xaeB`\x82"), path
    elif name.endswith(".md"):
        assert content.endswith(b"\n"), path


class Train(Command):
    """A run: what was learned is, bit for bit, what it would have been."""

    def __init__(self, *asked: str) -> None:
        self.asked = asked

    def prepare(self, out: Path) -> None:
        pass

    def line(self, out: Path) -> int:
        session.TABLE_EPISODES = 4  # it is not about them
        return train([*self.asked, *SMALL, "--out", str(out)])

    def go_on(self, out: Path) -> Line:
        resumes = (out / "config.json").exists()
        return self._resume if resumes else self.line

    def _resume(self, out: Path) -> int:
        session.TABLE_EPISODES = 4
        return train(["--resume", str(out)])

    def require_whole(self, out: Path) -> None:
        # A checkpoint that ``latest.json`` does not name yet may be half written.
        for path in out.rglob("*") if out.exists() else ():
            inside = path.relative_to(out)
            if (
                path.is_file()
                and not path.name.startswith(".")
                and inside.parts[0] not in ("checkpoint", "tensorboard")
            ):
                require_readable(path)
        if (out / "policy.json").exists() and (out / "policy.safetensors").exists():
            load_policy(out)

    def results(self, out: Path) -> dict[str, Any]:
        with (out / "progress.csv").open(newline="") as file:
            rows = [
                {key: row[key] for key in row if key not in ("seconds", "steps_per_s")} for row in csv.DictReader(file)
            ]
        latest = json.loads((out / "checkpoint" / "latest.json").read_text())
        return {
            "progress": rows,
            "policy": (out / "policy.safetensors").read_bytes(),
            "untrained": (out / "untrained" / "policy.safetensors").read_bytes(),
            "steps": latest["steps"],
            "table": (out / "table.md").read_text(),
            "checkpoints": sorted(path.name.partition("-")[0] for path in (out / "checkpoint").iterdir()),
            "files": sorted(path.name for path in out.iterdir() if path.name != "tensorboard"),
        }


class TrainSeveral(Command):
    """Runs that differ in their seed: the same command goes on."""

    def __init__(self, *asked: str) -> None:
        self.one = Train(*asked)

    def prepare(self, out: Path) -> None:
        pass

    def line(self, out: Path) -> int:
        session.TABLE_EPISODES = several.TABLE_EPISODES = 4
        return train([*self.one.asked, *SMALL, "--seeds", "0", "1", "--processes", "1", "--out", str(out)])

    def go_on(self, out: Path) -> Line:
        return self.line

    def require_whole(self, out: Path) -> None:
        for run in out.glob("seed?"):
            self.one.require_whole(run)

    def results(self, out: Path) -> dict[str, Any]:
        runs = {run.name: self.one.results(run) for run in sorted(out.glob("seed?"))}
        return {**runs, "table": (out / "table.md").read_text(), "files": sorted(path.name for path in out.iterdir())}


class Evaluate(Command):
    """A folder of results; an earlier one of the same kind is there."""

    def __init__(self, *asked: str, before: tuple[str, ...] = (), data: Callable[[Path], None] | None = None) -> None:
        self.asked, self.before, self.data = asked, before, data

    def _run(self, asked: tuple[str, ...], out: Path) -> int:
        given = [word.replace("HERE", str(out.parent)) for word in asked]
        return evaluate([*given, "--out", str(out)])

    def prepare(self, out: Path) -> None:
        if self.data is not None:
            self.data(out.parent)
        if self.before:
            from tests.harness.kill import run_child

            assert run_child(lambda: self._run(self.before, out), out, None)[0] == 0

    def line(self, out: Path) -> int:
        return self._run(self.asked, out)

    def go_on(self, out: Path) -> Line:
        return self.line

    def results(self, out: Path) -> dict[str, Any]:
        found: dict[str, Any] = {path.name: path.read_bytes() for path in sorted(out.iterdir())}
        for name in found:
            if name.endswith(".html"):
                found[name] = found[name].replace(str(out.parent).encode(), b"")
            if name.endswith(".json"):  # the commit may be another one by now, the folder is
                told = json.loads(found[name].decode().replace(str(out.parent), ""))
                found[name] = {key: value for key, value in told.items() if key != "versions"}
        return found


def write_campaign(folder: Path) -> None:
    """Four receivers, one resting tag."""
    places = {"N": (0.0, 100.0), "S": (0.0, -100.0), "E": (100.0, 0.0), "W": (-100.0, 0.0)}
    generator = np.random.default_rng(3)
    time = 1.6e9 + 100.0 * np.arange(40) + generator.uniform(0, 30, 40)
    rows = []
    for name, (x, y) in places.items():
        arrival = time + np.hypot(x - 30.0, y - 20.0) / 1500.0 + 1e-3 * generator.normal(size=time.size)
        rows += [f"{each:.6f},{name},rest-1\n" for each in arrival]
    (folder / "detections.csv").write_text("t_unix_s,receiver,tag\n" + "".join(rows))
    listed = "".join(f"{name},{x},{y},5\n" for name, (x, y) in places.items())
    (folder / "receivers.csv").write_text("receiver,x,y,depth\n" + listed)


SHORT = ("--set", "episode_steps=10", "--particles", "40", "--episodes", "4")
FIELD = ("--detections", "HERE/detections.csv", "--receivers", "HERE/receivers.csv")
COMMANDS: dict[str, Command] = {
    "train": Train("--steps", "600", "--hyper", "rollout=128"),
    "train sac": Train("--steps", "120", "--algo", "sac", "--hyper", "learning_starts=64", "gradient_steps=1"),
    "train several": TrainSeveral("--steps", "300", "--hyper", "rollout=128"),
    "eval benchmark": Evaluate(
        "benchmark", *SHORT, "--policies", "pursuit", "circle", before=("benchmark", *SHORT, "--policies", "random")
    ),
    "eval consistency": Evaluate("consistency", *SHORT),
    "array locate": Evaluate(
        "array",
        "locate",
        *FIELD,
        "--sigma",
        "0.001",
        before=("array", "locate", *FIELD, "--sigma", "0.002"),
        data=write_campaign,
    ),
    "array tracks": Evaluate("array", "tracks", *FIELD, "--sigma", "0.001", data=write_campaign),
}
