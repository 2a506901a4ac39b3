"""`tagtrack eval array sync` and `survey`: what they print and write, and one line where the files do not do."""

import csv
import gzip
import json

import numpy as np
import pytest

from tagtrack.eval.field.telemetry import read_detections, read_receivers

PLACES = np.array([[0.0, 0.0], [150.0, 0.0], [10.0, 140.0], [160.0, 155.0]])
OFFSET, DRIFT = np.array([0.0, 50.0, -30.0, 8.0]), np.array([0.0, 1e-5, -2e-5, 5e-6])
START, SPEED = 1.6e9, 1500.0


@pytest.fixture(autouse=True)
def deployment(tmp_path, monkeypatch):
    """12 hours of four receivers with own tags on wrong clocks, a fish, and a fifth receiver that hears none of these."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    rows = [(START + 5000.0 * step, "R4", "strange") for step in range(5)]
    for tag in range(4):
        ping = START + np.cumsum(rng.uniform(200, 400, 140))
        for receiver in range(4):
            true = ping + np.hypot(*(PLACES[tag] - PLACES[receiver])) / SPEED + 2e-4 * rng.standard_normal(ping.size)
            rows += [(time, f"R{receiver}", f"T{tag}") for time in true + OFFSET[receiver] + DRIFT[receiver] * (true - START)]
    rows += [(START + OFFSET[receiver] + 600.0, f"R{receiver}", "fish") for receiver in range(4)]
    write("raw.csv", "t_unix_s,receiver,tag", sorted(rows))
    write("tags.csv", "tag,receiver,x,y", [(f"T{index}", f"R{index}", "", "") for index in range(4)])
    write("places.csv", "receiver,x,y", [(f"R{index}", *place) for index, place in enumerate(PLACES)])


def write(path, header, rows):
    lines = [header, *(",".join(map(str, row)) for row in rows)]
    with open(path, "w") as file:
        file.write("\n".join(lines) + "\n")


SYNC = ("array", "sync", "--detections", "raw.csv", "--sync-tags", "tags.csv", "--reference", "R0")


def test_sync_corrects_all_tags_and_reports_the_clocks(evaluate):
    status, out, err = evaluate(*SYNC, "--receivers", "places.csv", "--out", "out")
    assert (status, err) == (0, "")
    assert "Offsets are against R0" in out and "no clock for R4: it shares too few pings" in out
    assert "without a clock: 5 detections" in out
    document = json.loads(open("out/clocks.json").read())
    assert document["residual_rms_s"] < 2.2e-4 and document["sigma_s"] == pytest.approx(2e-4, rel=0.1)
    offsets = {clock["receiver"]: clock["first_offset_s"] for clock in document["clocks"]}
    assert offsets == pytest.approx({f"R{index}": OFFSET[index] for index in range(4)}, abs=0.02)  # drift before the first ping
    assert set(document["excluded"]) == {"R4"} and document["detections_left_out"] == 5
    assert open("out/residuals.png", "rb").read(4) == b"\x89PNG"


def test_corrected_detections_are_read_like_any_others(evaluate):
    evaluate(*SYNC, "--receivers", "places.csv", "--out", "out")
    with gzip.open("out/detections.csv.gz", "rt") as file:
        assert file.readline() == "t_unix_s,receiver,tag\n"
    corrected = read_detections(["out/detections.csv.gz"])
    assert corrected.receivers == ("R0", "R1", "R2", "R3") and "fish" in corrected.tags
    fish = corrected.of_tag("fish").time - START  # sent at 600 s by each receiver's clock, less its drift until then
    np.testing.assert_allclose(fish, 600.0, atol=0.02)


def test_survey_places_receivers_by_what_sync_corrected_without_places(evaluate):
    assert evaluate(*SYNC, "--out", "synced")[0] == 0
    survey = ("array", "survey", "--detections", "synced/detections.csv.gz", "--sync-tags", "tags.csv")
    status, out, err = evaluate(*survey, "--reference", "places.csv", "--out", "out")
    assert (status, err) == (0, "") and "there less back" in out.replace("\n", " ")
    known = read_receivers("out/receivers.csv")
    assert known.names == ("R0", "R1", "R2", "R3")
    np.testing.assert_allclose(known.position, PLACES, atol=0.1)  # 0.2 ms and 140 pings: centimetres
    rows = list(csv.DictReader(open("out/distances.csv")))
    distance = [np.hypot(*(PLACES[int(row["first"][1])] - PLACES[int(row["second"][1])])) for row in rows]
    np.testing.assert_allclose([float(row["distance_m"]) for row in rows], distance, atol=0.1)
    document = json.loads(open("out/survey.json").read())
    assert [row["from_reference_m"] < 0.1 for row in document["receivers"]] == [True] * 4
    assert open("out/map.png", "rb").read(4) == b"\x89PNG"


def test_clocks_and_places_in_degrees_are_those_of_metres(evaluate, as_degrees):
    degrees = as_degrees(PLACES).tolist()
    write("degrees.csv", "receiver,lon,lat", [(f"R{index}", *place) for index, place in enumerate(degrees)])
    for name, pair, places in (("metres", "x,y", PLACES), ("degrees", "lon,lat", degrees)):
        write(f"tags-{name}.csv", f"tag,receiver,{pair}", [(f"T{index}", "", *place) for index, place in enumerate(places)])
    assert evaluate(*SYNC[:4], "--sync-tags", "tags-metres.csv", "--receivers", "places.csv", "--out", "in-metres")[0] == 0
    assert evaluate(*SYNC[:4], "--sync-tags", "tags-degrees.csv", "--receivers", "degrees.csv", "--out", "synced")[0] == 0
    corrected = read_detections(["synced/detections.csv.gz"]), read_detections(["in-metres/detections.csv.gz"])
    np.testing.assert_allclose(corrected[0].time, corrected[1].time, rtol=0, atol=3e-6)  # 3 mm of places are 2 us
    survey = ("array", "survey", "--detections", "synced/detections.csv.gz", "--sync-tags", "tags.csv", "--out", "out")
    status, out, err = evaluate(*survey, "--reference", "degrees.csv")
    assert (status, err) == (0, "") and "metres east and north of lon -80.8992" in " ".join(out.split())
    rows = list(csv.DictReader(open("out/receivers.csv")))
    assert list(rows[0]) == ["receiver", "lon", "lat", "sd_x", "sd_y"]
    found = [(float(row["lon"]), float(row["lat"])) for row in rows]
    np.testing.assert_allclose(found, degrees, atol=1e-6)  # 0.1 m, as in metres
    middle = np.mean(degrees, axis=0)
    document = json.loads(open("out/survey.json").read())
    assert document["origin"] == pytest.approx({"lon": middle[0], "lat": middle[1]}, abs=1e-9)
    position = [(row["x"], row["y"]) for row in document["receivers"]]
    np.testing.assert_allclose(position, PLACES - PLACES.mean(axis=0), atol=0.1)


def test_survey_uses_all_sync_tags_beside_a_receiver(evaluate):
    assert evaluate(*SYNC, "--receivers", "places.csv", "--out", "synced")[0] == 0
    with gzip.open("synced/detections.csv.gz", "rt") as file:
        header, *rows = file.read().splitlines()
    half = START + 6 * 3600.0  # from then on a new tag hangs by R2
    rows = [row.replace(",T2", ",T2-new") if float(row.partition(",")[0]) > half else row for row in rows]
    with open("changed.csv", "w") as file:
        file.write("\n".join([header, *rows, ""]))
    write("tags.csv", "tag,receiver", [(f"T{index}", f"R{index}") for index in range(4)] + [("T2-new", "R2")])
    pings = {}
    for name in ("synced/detections.csv.gz", "changed.csv"):
        assert evaluate("array", "survey", "--detections", name, "--sync-tags", "tags.csv", "--out", "out")[0] == 0
        rows = csv.DictReader(open("out/distances.csv"))
        pings[name] = {(row["first"], row["second"]): (row["there_pings"], row["back_pings"]) for row in rows}
    assert pings["changed.csv"] == pings["synced/detections.csv.gz"] and pings["changed.csv"]["R1", "R2"] == ("140", "140")


def test_survey_without_references_puts_the_first_receiver_at_the_origin(evaluate):
    evaluate(*SYNC, "--receivers", "places.csv", "--out", "synced")
    status, _, _ = evaluate(
        "array", "survey", "--detections", "synced/detections.csv.gz", "--sync-tags", "tags.csv", "--out", "out"
    )
    assert status == 0
    np.testing.assert_allclose(read_receivers("out/receivers.csv").position, PLACES, atol=0.1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--reference", "R9"), "no detection by the reference 'R9'"),
        (("--degree", "0"), "degree of a clock's polynomial must be 1 to 9, got 0"),
        (("--segment-days", "0"), "--segment-days must be positive, got 0"),
        (("--sound-speed", "-1"), "sound_speed must be positive, got -1"),
        (("--detections", "none.csv"), "no detection file none.csv"),
        (("--receivers", "tags.csv"), "x must be a number"),
        (("--out", "raw.csv"), "--out raw.csv is a file"),
    ],
)
def test_sync_says_in_one_line_what_is_wrong(evaluate, tmp_path, arguments, message):
    status, out, err = evaluate(*SYNC, "--out", "out", *arguments)
    assert status == 2 and err.startswith("error: ") and err.count("\n") == 1 and message in err
    assert not (tmp_path / "out").exists()


def test_survey_says_in_one_line_what_is_wrong(evaluate, tmp_path):
    write("alone.csv", "tag,receiver,x,y", [("T0", "", 0, 0), ("T1", "", 1, 1)])
    status, _, err = evaluate("array", "survey", "--detections", "raw.csv", "--sync-tags", "alone.csv", "--out", "out")
    assert (status, err) == (2, "error: distances take two receivers with own sync tags, got none\n")
    write("far.csv", "receiver,x,y", [("R7", 0, 0), ("R8", 1, 1)])
    evaluate(*SYNC, "--out", "synced")
    arguments = ("--detections", "synced/detections.csv.gz", "--sync-tags", "tags.csv", "--reference", "far.csv")
    status, _, err = evaluate("array", "survey", *arguments, "--out", "out")
    assert (status, err) == (2, "error: --reference must hold two of R0, R1, R2, R3; it holds R7, R8\n")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("step", [0.05, -2.0])
def test_a_clock_that_was_set_anew_is_found_and_no_detection_is_wrong_by_it(evaluate, step):
    """The clock of R2 steps after six hours: two clocks, and its own pings lie where sound takes them, before and after."""
    rows = [line.split(",") for line in open("raw.csv").read().splitlines()[1:]]
    middle = START + 6 * 3600.0 + OFFSET[2]
    moved = [(float(t) + step * (r == "R2" and float(t) > middle), r, tag) for t, r, tag in rows]
    write("raw.csv", "t_unix_s,receiver,tag", sorted(moved))
    status, out, err = evaluate(*SYNC, "--receivers", "places.csv", "--out", "out")
    assert (status, err) == (0, "")
    assert "the clock of R2 steps by" in out and "from then on it is R2 (2) above" in out
    (found,) = json.loads(open("out/clocks.json").read())["steps"]
    assert found["size"] == pytest.approx(step, abs=0.02) and abs(found["after"] - middle) < 800.0
    corrected = read_detections(["out/detections.csv.gz"])
    assert "R2 (2)" not in corrected.receivers
    own = {name: corrected.time[(corrected.receiver == k) & (corrected.tag == corrected.tags.index("T2"))]
           for k, name in enumerate(corrected.receivers)}  # fmt: skip
    travel = np.hypot(*(PLACES[2] - PLACES[0])) / SPEED
    gaps = np.array([own["R0"][np.abs(own["R0"] - t).argmin()] - t for t in own["R2"]])
    assert np.abs(gaps - travel).max() < 2e-3


def test_smooth_clocks_have_no_steps(evaluate):
    assert evaluate(*SYNC, "--receivers", "places.csv", "--out", "out")[0] == 0
    assert json.loads(open("out/clocks.json").read())["steps"] == []
