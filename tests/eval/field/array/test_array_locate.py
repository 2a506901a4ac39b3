"""`python -m eval array locate` and `array tracks`: from detections in a file to positions and tracks in files."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagtrack.eval.cli import main

RECEIVERS = {"N": (0.0, 100.0), "S": (0.0, -100.0), "E": (100.0, 0.0), "W": (-100.0, 0.0)}
SOUND = 1500.0
BEGIN = 1.6e9


def arrivals(place: np.ndarray, time: np.ndarray, sigma: float, generator: np.random.Generator) -> np.ndarray:
    """(K, 4) of pings from ``place`` (K, 2)."""
    distance = np.linalg.norm(place[:, None] - np.array(list(RECEIVERS.values())), axis=2)
    return time[:, None] + distance / SOUND + sigma * generator.normal(size=distance.shape)


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """Two resting tags of 60 pings and three animals of 300 each, heard with 1 ms of noise; one arrival in ten is missed."""
    generator = np.random.default_rng(3)
    rows = []
    tags = {"rest-1": (30.0, 20.0), "rest-2": (-40.0, 10.0)}
    for tag, place in tags.items():
        time = BEGIN + 100.0 * np.arange(60) + generator.uniform(0, 30, 60)
        rows += list_rows(tag, arrivals(np.tile(place, (60, 1)), time, 1e-3, generator), generator)
    for animal in range(3):
        time = BEGIN + 100.0 * np.arange(300) + generator.uniform(0, 30, 300)
        time[150:] += 3 * 3600  # a long silence
        place = 20.0 * np.stack([np.cos(time / 5000 + animal), np.sin(time / 5000 + animal)], axis=1)
        rows += list_rows(f"animal-{animal}", arrivals(place, time, 1e-3, generator), generator)
    (tmp_path / "detections.csv").write_text("t_unix_s,receiver,tag\n" + "".join(rows))
    places = "".join(f"{name},{x},{y},5\n" for name, (x, y) in RECEIVERS.items())
    (tmp_path / "receivers.csv").write_text("receiver,x,y,depth\n" + places)
    (tmp_path / "reference.csv").write_text("tag,x,y\n" + "".join(f"{tag},{x},{y}\n" for tag, (x, y) in tags.items()))
    return tmp_path


def list_rows(tag: str, arrival: np.ndarray, generator: np.random.Generator) -> list[str]:
    heard = generator.uniform(size=arrival.shape) > 0.1
    names = list(RECEIVERS)
    return [f"{arrival[k, r]:.6f},{names[r]},{tag}\n" for k, r in zip(*np.nonzero(heard), strict=True)]


@pytest.fixture
def array(campaign: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """Run a command on the campaign; gives exit status and what it printed."""

    def run(command: str, *more: str) -> tuple[int, str]:
        given = ["--detections", str(campaign / "detections.csv"), "--receivers", str(campaign / "receivers.csv")]
        status = main(["array", command, *given, "--out", str(campaign / "out"), *more])
        return status, "".join(capsys.readouterr())

    return run


def summary(campaign: Path) -> dict[str, dict[str, float]]:
    return json.loads((campaign / "out" / "summary.json").read_text())["tags"]


def test_positions_are_as_near_as_the_noise_allows(campaign: Path, array: Callable[..., tuple[int, str]]) -> None:
    status, printed = array("locate", "--reference", str(campaign / "reference.csv"))
    assert status == 0, printed
    assert sorted(path.name for path in (campaign / "out").iterdir()) == ["map.png", "positions.csv", "summary.json"]
    found = summary(campaign)
    assert set(found) == {"rest-1", "rest-2", "animal-0", "animal-1", "animal-2"}
    for tag, (x, y) in {"rest-1": (30.0, 20.0), "rest-2": (-40.0, 10.0)}.items():
        figures = found[tag]
        assert figures["heard"] == 60 and 50 <= figures["located"] <= 60  # P(3 or 4 of 4 heard) = 0.95
        assert figures["median_m"] < 2.0 and figures["p95_m"] < 6.0  # 1 ms is 1.5 m; the bound here is 1.5 to 3 m
        assert np.hypot(figures["mean_x"] - x, figures["mean_y"] - y) < 1.0
    assert found["animal-0"]["median_m"] is None
    with (campaign / "out" / "positions.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == "tag,t_unix_s,x,y,sd_x,sd_y,receivers,pings,cov_xy,misfit,ambiguous,other_x,other_y"
    assert len(rows) == sum(figures["located"] for figures in found.values())
    assert {int(row["receivers"]) for row in rows} == {3, 4} and {row["pings"] for row in rows} == {"1"}
    miss = [((float(row["x"]) - 30.0) / float(row["sd_x"])) ** 2 for row in rows if row["tag"] == "rest-1"]
    assert 0.5 < np.mean(miss) < 2.0  # some 57 values of chi-square 1


def test_averaged_positions_are_nearer(campaign: Path, array: Callable[..., tuple[int, str]]) -> None:
    reference = str(campaign / "reference.csv")
    array("locate", "--reference", reference, "--tags", "rest-1")
    single = summary(campaign)["rest-1"]
    array("locate", "--reference", reference, "--tags", "rest-1", "--average", "20", "--systematic", "0")
    averaged = summary(campaign)["rest-1"]
    assert averaged["located"] >= single["located"] and averaged["rmse_m"] < 0.6 * single["rmse_m"]
    rows = (campaign / "out" / "positions.csv").read_text().splitlines()[1:]
    pings = [int(row.split(",")[7]) for row in rows]
    assert len(pings) == 3 and sum(pings) == averaged["located"] and max(pings) - min(pings) <= 3  # evenly
    array("locate", "--tags", "rest-1", "--average-hours", "48")
    assert len((campaign / "out" / "positions.csv").read_text().splitlines()) <= 3


def test_tracks_leave_gaps_open_and_split_animals(campaign: Path, array: Callable[..., tuple[int, str]]) -> None:
    animals = ["--tags", "animal-0", "animal-1", "animal-2"]
    status, printed = array("tracks", *animals, "--odd-even", "--interval", "60")
    assert status == 0, printed
    out = campaign / "out"
    document = json.loads((out / "tracks.json").read_text())
    for figures in document["tags"].values():
        assert figures["stretches"] == 2 and figures["odd_even_median_m"] < 1.5
    table = np.genfromtxt(out / "tracks.csv", delimiter=",", skip_header=1, usecols=(1, 2, 3))
    first = table[: np.flatnonzero(np.diff(table[:, 0]) < 0)[0] + 1]
    assert sorted(set(np.diff(first[:, 0])))[0] == 60.0 and np.diff(first[:, 0]).max() > 2.9 * 3600
    true = 20.0 * np.stack([np.cos(first[:, 0] / 5000), np.sin(first[:, 0] / 5000)], axis=1)
    assert np.sqrt(np.mean(np.sum((first[:, 1:] - true) ** 2, axis=1))) < 1.0  # pings alone: some 2 m
    rows = {part: (out / f"{part}.csv").read_text().splitlines()[1:] for part in ("training", "held_out")}
    training, held_out = ({row.partition(",")[0] for row in rows[part]} for part in rows)
    assert len(held_out) == 1 and training | held_out == set(animals[1:]) and not training & held_out


@pytest.mark.parametrize(
    ("command", "options", "says"),
    [
        ("locate", ["--tags", "shark"], "no detection of tag 'shark'; there are animal-0, animal-1"),
        ("locate", ["--method", "magic"], "unknown --method magic; known: wls"),
        ("locate", ["--min-receivers", "2"], "--min-receivers must be at least 3"),
        ("locate", ["--sound-speed", "nan"], "--sound-speed must be positive, got nan"),
        ("locate", ["--average", "0"], "--average must be at least 1, got 0"),
        ("locate", ["--average", "5", "--average-hours", "2"], "--average-hours must be positive and stand without --average"),
        ("locate", ["--reference", "nowhere.csv"], "nowhere.csv"),
        ("tracks", ["--method", "map"], "--method map smooths by itself; tracks take one of wls, ml, wls_ml"),
        ("tracks", ["--least-pings", "1000"], "no tag has a stretch of 1000 located pings; lower --least-pings"),
        ("tracks", ["--held-out", "1"], "--held-out must be a share between 0 and 1"),
    ],
)
def test_a_wrong_option_is_named(
    command: str, options: list[str], says: str, campaign: Path, array: Callable[..., tuple[int, str]]
) -> None:
    status, printed = array(command, *options)
    assert status == 2 and printed.startswith("error: ") and says in printed and len(printed.splitlines()) == 1
    assert not (campaign / "out").exists()


def test_receivers_of_another_array_are_refused(campaign: Path, array: Callable[..., tuple[int, str]]) -> None:
    (campaign / "receivers.csv").write_text("receiver,x,y\nA,0,0\nB,1,0\nC,0,1\n")
    status, printed = array("locate")
    assert status == 2 and "no receiver of" in printed and "(A, B, C) is in the detections (E, N, S, W)" in printed
    (campaign / "receivers.csv").write_text("receiver,x,y\nN,0,0\nE,1,0\nC,0,1\n")
    assert "a position takes three receivers" in array("locate")[1]
