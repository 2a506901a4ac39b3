"""The array commands where places are longitudes and latitudes: the same as in metres, and never both at once."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagtrack.eval.cli import main
from tagtrack.eval.field.array.locate import COLUMNS
from tagtrack.eval.field.telemetry import Plane

CROSS = np.array([[0.0, 100.0], [0.0, -100.0], [100.0, 0.0], [-100.0, 0.0]])  # the origin is its mean
NAMES = ("N", "S", "E", "W")
RESTS = np.array([30.0, 20.0])
BEGIN, SOUND = 1.6e9, 1500.0
NEAR = 3e-3  # m: files tell metres to 1 mm, and the degrees of the tests are right to 1 mm

Table = Callable[[str, list[str], np.ndarray], str]
Run = Callable[..., tuple[int, str]]


@pytest.fixture
def campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tag that rests and two that circle, 80 pings each, heard with 0.2 ms of noise."""
    monkeypatch.chdir(tmp_path)
    generator = np.random.default_rng(5)
    rows = []
    for tag in ("rest", "fish-1", "fish-2"):
        time = BEGIN + 90.0 * np.arange(80) + generator.uniform(0, 30, 80)
        circle = 20.0 * np.stack([np.cos(time / 3000), np.sin(time / 3000)], axis=1)
        place = np.tile(RESTS, (80, 1)) if tag == "rest" else circle
        arrival = time[:, None] + np.linalg.norm(place[:, None] - CROSS, axis=2) / SOUND
        arrival += 2e-4 * generator.standard_normal(arrival.shape)
        rows += [f"{value:.6f},{name},{tag}" for row in arrival for value, name in zip(row, NAMES, strict=True)]
    (tmp_path / "detections.csv").write_text("\n".join(["t_unix_s,receiver,tag", *rows, ""]))
    return tmp_path


@pytest.fixture
def places(campaign: Path) -> Table:
    """Write a file of named places; gives its name."""

    def write(header: str, names: list[str], position: np.ndarray) -> str:
        rows = [f"{name},{a!r},{b!r}" for name, (a, b) in zip(names, position.tolist(), strict=True)]
        path = f"{header.replace(',', '-')}.csv"
        (campaign / path).write_text("\n".join([header, *rows, ""]))
        return path

    return write


@pytest.fixture
def array(campaign: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command on the campaign; gives exit status and what it printed."""

    def run(command: str, receivers: str, *more: str) -> tuple[int, str]:
        given = ("--detections", "detections.csv", "--receivers", receivers, "--out", "out")
        status = main(["array", command, *given, *more])
        return status, "".join(capsys.readouterr())

    return run


def columns(path: str, *names: str) -> np.ndarray:
    """(K, len(names)) of a csv file."""
    with open(path, newline="") as file:
        return np.array([[float(row[name]) for name in names] for row in csv.DictReader(file)])


def test_positions_are_those_of_metres_and_told_in_degrees_too(places: Table, array: Run, as_degrees) -> None:
    metres = places("receiver,x,y", list(NAMES), CROSS), places("tag,x,y", ["rest"], RESTS[None])
    degrees = places("receiver,lon,lat", list(NAMES), as_degrees(CROSS)), places("tag,lon,lat", ["rest"], as_degrees(RESTS[None]))
    assert array("locate", metres[0], "--reference", metres[1])[0] == 0
    expected = columns("out/positions.csv", "x", "y")
    plain = json.loads(Path("out/summary.json").read_text())
    assert Path("out/positions.csv").read_text().startswith(f"{COLUMNS}\n")
    assert "origin" not in plain
    status, printed = array("locate", degrees[0], "--reference", degrees[1])
    assert status == 0, printed
    assert "metres east and north of lon -80.9000000, lat 25.1000000" in " ".join(printed.split())
    assert Path("out/positions.csv").read_text().startswith(f"{COLUMNS},lon,lat\n")
    assert len(expected) == 240
    np.testing.assert_allclose(columns("out/positions.csv", "x", "y"), expected, atol=NEAR)
    np.testing.assert_allclose(columns("out/positions.csv", "lon", "lat"), as_degrees(expected), atol=NEAR / 1e5)  # m a degree
    summary = json.loads(Path("out/summary.json").read_text())
    assert summary["origin"] == pytest.approx({"lon": -80.9, "lat": 25.1}, abs=1e-12)
    assert summary["tags"]["rest"]["rmse_m"] == pytest.approx(plain["tags"]["rest"]["rmse_m"], abs=NEAR)
    assert 0 < summary["tags"]["rest"]["rmse_m"] < 0.6  # 0.2 ms is 0.3 m along each axis


def test_tracks_are_those_of_metres_and_come_as_a_file_for_movebank_too(places: Table, array: Run, as_degrees) -> None:
    assert array("tracks", places("receiver,x,y", list(NAMES), CROSS))[0] == 0
    files = {"tracks.csv", "training.csv", "held_out.csv", "tracks.json", "map.png"}
    assert {path.name for path in Path("out").iterdir()} == files
    expected = {name: columns(f"out/{name}.csv", "t_unix_s", "x", "y") for name in ("tracks", "training", "held_out")}
    status, printed = array("tracks", places("receiver,longitude,latitude", list(NAMES), as_degrees(CROSS)))
    assert status == 0, printed
    assert {path.name for path in Path("out").iterdir()} == {*files, "movebank.csv"}
    for name, table in expected.items():
        assert Path(f"out/{name}.csv").read_text().startswith("tag,t_unix_s,x,y")
        np.testing.assert_allclose(columns(f"out/{name}.csv", "t_unix_s", "x", "y"), table, atol=NEAR)
    origin = json.loads(Path("out/tracks.json").read_text())["origin"]
    place = columns("out/movebank.csv", "location-long", "location-lat")
    np.testing.assert_allclose(place, as_degrees(expected["tracks"][:, 1:]), atol=NEAR / 1e5)
    plane = Plane(longitude=origin["lon"], latitude=origin["lat"])
    np.testing.assert_allclose(plane.to_plane(place), columns("out/tracks.csv", "x", "y"), atol=1e-3)
    assert array("tracks", places("receiver,x,y", list(NAMES), CROSS))[0] == 0
    assert not Path("out/movebank.csv").exists()  # that of the tracks before


def test_metres_beside_degrees_end_in_one_line(places: Table, array: Run, as_degrees) -> None:
    degrees = places("receiver,lon,lat", list(NAMES), as_degrees(CROSS))
    metres = places("receiver,x,y", list(NAMES), CROSS)
    for receivers, reference, says in (
        (degrees, places("tag,x,y", ["rest"], RESTS[None]), "x,y have another origin than receivers in longitude and latitude"),
        (metres, places("tag,lon,lat", ["rest"], as_degrees(RESTS[None])), "lon,lat take receivers in degrees too"),
    ):
        status, printed = array("locate", receivers, "--reference", reference)
        assert (status, printed.count("\n")) == (2, 1) and printed.startswith(f"error: {reference}: line 1: {says}")
    Path("tags.csv").write_text("tag,receiver,x,y\nrest,,30,20\n")
    status, printed = array("sync", degrees, "--sync-tags", "tags.csv")
    assert status == 2 and printed.startswith("error: tags.csv: line 2: x,y have another origin")
    assert not Path("out").exists()


@pytest.mark.parametrize("command", ["locate", "tracks"])
def test_degrees_without_pymap3d_end_in_one_line_that_names_the_extra(
    command: str, campaign: Path, array: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pymap3d", None)
    (campaign / "r.csv").write_text("receiver,lon,lat\nN,0,0\nS,0.001,0\nE,0,0.001\n")
    status, printed = array(command, "r.csv")
    assert (status, printed) == (2, 'error: longitude and latitude need pymap3d: pip install "tagtrack[geo]"\n')
    assert not (campaign / "out").exists()
