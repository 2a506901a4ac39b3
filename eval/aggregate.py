"""`tagtrack eval aggregate`: one figure over several tasks, from benchmarks that have been run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from tagtrack.command import tagtrack_here
from tagtrack.envs.validation import brief
from tagtrack.eval.report import as_console_table, interval_cell, show
from tagtrack.eval.statistics.comparisons import estimate_of, geometric_mean
from tagtrack.eval.statistics.estimate import Estimate

LARGEST = 1e12  # of a figure that a file may tell


@dataclass(frozen=True, kw_only=True)
class Aggregate:
    """The geometric mean, over tasks, of the ratios of a policy to the first one of each benchmark, with its interval.

    Tasks count alike; they share no fish, and no training runs if each was trained for itself.
    """

    folders: tyro.conf.Positional[tuple[Path, ...]]
    """Folders that `eval benchmark` wrote, one for each task."""
    policy: Annotated[str, tyro.conf.arg(metavar="NAME")] = "learned"
    """The policy, by the name that it has in all of them."""

    def run(self) -> None:
        """Run it."""
        if not self.folders:
            way = f"{tagtrack_here()} eval aggregate runs/benchmark-A runs/benchmark-B"
            raise ValueError(f"name the folders of some benchmarks: {way}")
        documents = [read_benchmark(folder) for folder in self.folders]
        names = [document["env"] for document in documents]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"{twice[0]} is the task of two folders; tasks count alike, so name each once")
        found = [ratio_of(document, self.policy, folder) for document, folder in zip(documents, self.folders, strict=True)]
        print_aggregate(documents, found, self.policy)


def read_benchmark(folder: Path) -> dict[str, Any]:
    """benchmark.json of a folder. Raises FileNotFoundError or ValueError where there is none that can be read."""
    if not folder.is_dir():
        raise FileNotFoundError(f"there is no folder {folder}; name folders that `eval benchmark` wrote")
    path = folder / "benchmark.json"
    if not path.is_file():
        raise FileNotFoundError(f"no benchmark in {folder}: it has no benchmark.json")
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        for name, kind in (("env", str), ("policies", dict), ("ratios", dict)):
            if not (isinstance(document[name], kind) and (document[name] or name == "ratios")):
                raise ValueError(f"{name} is {brief(document[name])}")
        for pair, ratio in document["ratios"].items():
            if not _is_ratio(ratio):
                raise ValueError(f"the ratio {pair} is {brief(ratio)}")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"{path} is not what `eval benchmark` writes ({error}); run it again") from None
    return dict(document)


def _is_ratio(ratio: Mapping[str, Any]) -> bool:
    """Whether it has a value between its limits, or no interval, and degrees of freedom, or none."""
    value, low, high, freedom = ratio["value"], ratio["low"], ratio["high"], ratio.get("freedom")
    told = [figure for figure in (value, low, high, freedom) if figure is not None]
    if not all(type(figure) in (int, float) and 0 < figure < LARGEST for figure in told):
        return False
    return low is high is None or (None not in (value, low, high) and low <= value <= high)


def ratio_of(document: dict[str, Any], policy: str, folder: Path) -> Estimate:
    """How a policy stands to the first one of a benchmark. Raises ValueError where it took no part, or has no interval."""
    first = next(iter(document["policies"]))
    ratio = document["ratios"].get(f"{first}/{policy}")
    if ratio is None:
        others = ", ".join(name for name in document["policies"] if name != first)
        raise ValueError(f"no policy {policy!r} beside {first} in {folder}; there are: {others or 'none'}")
    if ratio["low"] is None:
        raise ValueError(f"the ratio of {policy} in {folder} has no interval: too few episodes, or runs, or stretches of track")
    return estimate_of(ratio["value"], ratio["low"], ratio["high"], ratio.get("freedom"))


def print_aggregate(documents: Sequence[dict[str, Any]], found: Sequence[Estimate], policy: str) -> None:
    """A row for each task, and one for all."""
    header = ["task", f"first / {policy}", "first"]
    rows = [
        [document["env"].removeprefix("TagTrack/"), interval_cell(each.interval().to_json()), next(iter(document["policies"]))]
        for document, each in zip(documents, found, strict=True)
    ]
    rows.append([f"all {len(found)}", interval_cell(geometric_mean(found).interval().to_json()), ""])
    note = f"Mean error of the first policy over that of {policy}; all: the geometric mean. In brackets 95 % intervals."
    show(as_console_table(header, rows, note))
