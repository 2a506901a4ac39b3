"""`tagtrack eval array locate` and `array tracks`: from detections in a file to positions and tracks in files."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagtrack.eval.cli import main
from tagtrack.eval.field import locate_tags, read_detections, read_receivers
from tagtrack.eval.field.array.sound import read_sound_speed

RECEIVERS = {"N": (0.0, 100.0), "S": (0.0, -100.0), "E": (100.0, 0.0), "W": (-100.0, 0.0)}
SOUND = 1500.0
BEGIN = 1.6e9

Run = Callable[..., tuple[int, str]]


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
        ("locate", ["--sound-speed", "nan"], "--sound-speed must be from 1300 to 1700 m/s, or a file, got nan"),
        ("locate", ["--average", "0"], "--average must be at least 1, got 0"),
        ("locate", ["--average", "5", "--average-hours", "2"], "--average-hours must be positive and stand without --average"),
        ("locate", ["--reference", "nowhere.csv"], "nowhere.csv"),
        ("locate", ["--sound-speed", "none.csv"], "no sound speed file none.csv; give a csv with columns t_unix_s,sound_speed"),
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


def test_one_track_for_several_tags_is_noted(campaign: Path, array: Run) -> None:
    (campaign / "track.csv").write_text(f"t_unix_s,x,y\n{BEGIN},30,20\n{BEGIN + 10_000},30,20\n")
    reference = ("--reference", str(campaign / "track.csv"))
    assert "tells one track: all 2 tags are judged by it" in array("locate", *reference, "--tags", "rest-1", "rest-2")[1]
    assert "tells one track" not in array("locate", *reference, "--tags", "rest-1")[1]


def test_receivers_of_another_array_are_refused(campaign: Path, array: Callable[..., tuple[int, str]]) -> None:
    (campaign / "receivers.csv").write_text("receiver,x,y\nA,0,0\nB,1,0\nC,0,1\n")
    status, printed = array("locate")
    assert status == 2 and "no receiver of" in printed and "(A, B, C) is in the detections (E, N, S, W)" in printed
    (campaign / "receivers.csv").write_text("receiver,x,y\nN,0,0\nE,1,0\nC,0,1\n")
    assert "a position takes three receivers" in array("locate")[1]


def test_a_series_of_sound_speeds_brings_each_ping_to_its_own(tmp_path: Path) -> None:
    """Three receivers about a tag that rests; in the second hour sound is 2 % faster, and 100 m would be 2 m short."""
    places = np.array([(0.0, 0.0), (200.0, 0.0), (100.0, 170.0)])
    tag, rows = np.array([70.0, 40.0]), []
    for k in range(120):
        speed = 1480.0 if k < 60 else 1510.0
        rows += [f"{BEGIN + 60 * k + np.linalg.norm(tag - places[r]) / speed:.6f},R{r},fish\n" for r in range(3)]
    (tmp_path / "d.csv").write_text("t_unix_s,receiver,tag\n" + "".join(rows))
    (tmp_path / "r.csv").write_text("receiver,x,y\n" + "".join(f"R{r},{x},{y}\n" for r, (x, y) in enumerate(places)))
    (tmp_path / "c.csv").write_text(
        "t_unix_s,sound_speed\n" + "".join(f"{BEGIN + t},{c}\n" for t, c in ((0, 1480), (3570, 1480), (3580, 1510), (7200, 1510)))
    )
    command = ["array", "locate", "--detections", str(tmp_path / "d.csv"), "--receivers", str(tmp_path / "r.csv")]
    errors = {}
    for speed in (str(tmp_path / "c.csv"), "1495"):
        assert main([*command, "--sound-speed", speed, "--out", str(tmp_path / "out")]) == 0
        with (tmp_path / "out/positions.csv").open() as file:
            found = np.array([[float(row["x"]), float(row["y"])] for row in csv.DictReader(file)])
        errors[speed[-4:]] = np.linalg.norm(found - tag, axis=1)
    assert errors[".csv"].max() < 0.01 < 0.2 < errors["1495"].max()


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("t_unix_s,sound_speed\n1,1500\n1,1501\n", "times must rise"),
        ("t_unix_s,sound_speed\n1,150\n", "a speed of sound must be from 1300 to 1700 m/s, got 150"),
        ("t_unix_s,temperature\n1,80\n", "temperature"),
        ("t_unix_s,speed\n1,1500\n", "must name the columns t_unix_s,temperature"),
        ("t_unix_s,sound_speed\n", "holds no speed of sound"),
    ],
)
def test_a_broken_series_of_sound_speeds_is_named(tmp_path: Path, content: str, complaint: str) -> None:
    (tmp_path / "c.csv").write_text(content)
    with pytest.raises(ValueError, match=complaint):
        read_sound_speed(str(tmp_path / "c.csv"))


def test_temperature_and_salinity_are_a_speed_of_sound(tmp_path: Path) -> None:
    (tmp_path / "c.csv").write_text("t_unix_s,temperature,salinity,depth\n0,25,35,1000\n10,25,35,1000\n")
    assert read_sound_speed(str(tmp_path / "c.csv")).usual == pytest.approx(1550.744, abs=1e-3)  # Mackenzie's check value


def test_tracks_of_yaps_are_its_own(array: Run, campaign: Path) -> None:
    status, printed = array("tracks", "--method", "yaps", "--tags", "animal-0", "--interval", "300")
    assert status == 0, printed
    with (campaign / "out/tracks.csv").open() as file:
        rows = list(csv.DictReader(file))
    time = np.array([float(row["t_unix_s"]) for row in rows])
    found = np.array([[float(row["x"]), float(row["y"])] for row in rows])
    true = 20.0 * np.stack([np.cos(time / 5000), np.sin(time / 5000)], axis=1)
    first = time < BEGIN + 14_000  # before the silence
    assert np.median(np.linalg.norm(found - true, axis=1)[first]) < 1.0


def test_clocks_that_were_never_synchronized_are_suspected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [f"{BEGIN + 60 * k + 17.3456 * r},R{r},fish\n" for k in range(40) for r in range(3)]
    (tmp_path / "d.csv").write_text("t_unix_s,receiver,tag\n" + "".join(rows))
    (tmp_path / "r.csv").write_text("receiver,x,y\nR0,0,0\nR1,200,0\nR2,0,200\n")
    command = ["array", "locate", "--detections", str(tmp_path / "d.csv"), "--receivers", str(tmp_path / "r.csv")]
    main([*command, "--out", str(tmp_path / "out")])
    assert "nothing of fish was located" in " ".join(capsys.readouterr().out.split())


def test_the_chain_is_a_function_and_the_command_gives_the_same(campaign: Path, array: Run) -> None:
    places = read_receivers(campaign / "receivers.csv")
    heard = read_detections([campaign / "detections.csv"])
    [located] = locate_tags(heard, dict(zip(places.names, places.position, strict=True)), tags=["rest-1"])
    assert array("locate", "--tags", "rest-1")[0] == 0
    with (campaign / "out" / "positions.csv").open() as file:
        written = np.array([[float(row["x"]), float(row["y"])] for row in csv.DictReader(file)])
    np.testing.assert_allclose(located.positions.position[located.known], written, atol=1e-3)
    with pytest.raises(ValueError, match="no detection of tag 'shark'"):
        list(locate_tags(heard, {name: place for name, place in RECEIVERS.items()}, tags=["shark"]))


def test_an_estimator_and_a_layout_of_ones_own(campaign: Path, array: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    (campaign / "own_field.py").write_text(
        "import numpy as np\n"
        "from tagtrack.eval.field import Positions\n"
        "def first_heard(pings, receivers, setting, *, information=None):\n"
        "    place = receivers[np.nanargmin(pings.arrival, axis=1)]\n"
        "    return Positions(position=place, covariance=np.tile(100.0 * np.eye(2), (len(place), 1, 1)))\n"
        "def flat(pings, receivers, setting, *, information=None):\n"
        "    return Positions(position=np.zeros(2), covariance=np.eye(2))\n"
        "def bars(path):\n"
        "    rows = [line.split('|') for line in path.read_text().splitlines()]\n"
        "    return [float(row[0]) / 1e3 for row in rows], [row[1] for row in rows], [row[2] for row in rows]\n"
    )
    monkeypatch.syspath_prepend(campaign)
    assert array("locate", "--tags", "rest-1", "--method", "own_field:first_heard", "--max-sd", "1000")[0] == 0
    with (campaign / "out" / "positions.csv").open() as file:
        found = {(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)}
    assert found <= set(RECEIVERS.values())  # the nearest receiver, E or, where E missed the ping, N
    status, printed = array("locate", "--method", "own_field:flat")
    assert status == 2 and "flat: position must be (" in printed.splitlines()[-1]
    status, printed = array("locate", "--method", "own_field:none")
    assert status == 2 and "own_field has no 'none'" in printed
    rows = [line.split(",") for line in (campaign / "detections.csv").read_text().splitlines()[1:]]
    (campaign / "bars.txt").write_text("".join(f"{1e3 * float(t):.3f}|{receiver}|{tag}\n" for t, receiver, tag in rows))
    own = ["--detections", str(campaign / "bars.txt"), "--layout", "own_field:bars", "--tags", "rest-1"]
    assert array("locate", "--reference", str(campaign / "reference.csv"), *own)[0] == 0
    assert summary(campaign)["rest-1"]["median_m"] < 2.0


def test_a_tag_that_pings_sooner_than_sound_crosses_the_array_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Receivers 3 km apart, 2.83 s of sound along the diagonal, a ping each 1.5 s: neighbours in the window may be mixed up."""
    places = {"A": (0, 0), "B": (3000, 0), "C": (3000, 3000), "D": (0, 3000)}
    sent = BEGIN + 1.5 * np.arange(40)
    rows = [
        f"{time + np.hypot(x - 900, y - 700) / SOUND:.6f},{name},{tag}\n"
        for tag, times in (("quick", sent), ("slow", sent[::4]))
        for time in times
        for name, (x, y) in places.items()
    ]
    (tmp_path / "d.csv").write_text("t_unix_s,receiver,tag\n" + "".join(rows))
    (tmp_path / "r.csv").write_text("receiver,x,y\n" + "".join(f"{name},{x},{y}\n" for name, (x, y) in places.items()))
    given = ["--detections", str(tmp_path / "d.csv"), "--receivers", str(tmp_path / "r.csv"), "--out", str(tmp_path / "out")]
    assert main(["array", "locate", *given]) == 0
    printed = capsys.readouterr().out
    assert "note: quick pings each 1.50 s, sooner than sound crosses the array (2.83 s)" in printed
    assert "slow pings" not in printed
    assert summary(tmp_path)["quick"]["interval_s"] == pytest.approx(1.5, abs=1e-3)
