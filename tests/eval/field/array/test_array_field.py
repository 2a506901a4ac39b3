"""The array commands on the campaigns' own detections (skipped without the field data)."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

from tagtrack.eval.cli import main
from tagtrack.eval.papers.frame import Setting
from tagtrack.eval.papers.masmitja2020_field import run_field
from tagtrack.eval.papers.printed import MASMITJA2020_POSITION_2

CANISTER = "A69-1602-65266"


@pytest.fixture(scope="module")
def resnep(tagtrack_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with receivers.csv and reference.csv, both by Table 1's Position 1."""
    folder = tmp_path_factory.mktemp("resnep")
    with (tagtrack_data / "resnep" / "stations.csv").open(newline="") as file:
        stations = list(csv.DictReader(file))
    place = "{table1_position1_x},{table1_position1_y}\n"
    receivers = [f"{station['receiver']}," + place.format(**station) for station in stations if station["receiver"]]
    (folder / "receivers.csv").write_text("receiver,x,y\n" + "".join(receivers))
    reference = [f"{station['sync_tag']}," + place.format(**station) for station in stations]
    (folder / "reference.csv").write_text("tag,x,y\n" + "".join(reference))
    (folder / "moorings.json").write_text(json.dumps({station["sync_tag"]: station["mooring"] for station in stations}))
    return folder


def locate(resnep: Path, detections: Path, *more: str) -> dict[str, dict[str, float]]:
    """The tags of summary.json."""
    given = ["--detections", str(detections), "--receivers", str(resnep / "receivers.csv")]
    given += ["--reference", str(resnep / "reference.csv"), "--out", str(resnep / "out")]
    assert main(["array", "locate", *given, *more]) == 0
    return json.loads((resnep / "out" / "summary.json").read_text())["tags"]


def test_five_moored_tags_lie_within_a_metre_of_both_positions_of_table_1(resnep: Path, tagtrack_data: Path) -> None:
    found = locate(resnep, tagtrack_data / "resnep" / "sync_detections.csv.gz", "--average", "100")
    moorings = json.loads((resnep / "moorings.json").read_text())
    with (resnep / "reference.csv").open(newline="") as file:
        first = {row["tag"]: (float(row["x"]), float(row["y"])) for row in csv.DictReader(file)}
    assert set(found) == set(moorings)
    for tag, figures in found.items():
        mean = figures["mean_x"], figures["mean_y"]
        assert math.dist(mean, first[tag]) < 1.0
        assert math.dist(mean, MASMITJA2020_POSITION_2[moorings[tag]]) < 1.0


def test_the_canister_by_day_is_known_to_six_decimetres(resnep: Path, tagtrack_data: Path) -> None:
    detections = tagtrack_data / "resnep" / "sync_detections.csv.gz"
    figures = locate(resnep, detections, "--tags", CANISTER, "--average-hours", "24")[CANISTER]
    assert figures["rows"] == 54 and figures["median_m"] <= 0.6


def test_tracks_of_odd_and_even_pings_of_lobsters_are_near(resnep: Path, tagtrack_data: Path) -> None:
    given = ["--detections", str(tagtrack_data / "resnep" / "lobster_detections.csv.gz")]
    given += ["--receivers", str(resnep / "receivers.csv"), "--tags", "A69-1602-15830", "A69-1602-14462"]
    assert main(["array", "tracks", *given, "--odd-even", "--out", str(resnep / "tracks")]) == 0
    document = json.loads((resnep / "tracks" / "tracks.json").read_text())
    assert document["odd_even_median_m"] <= 1.5
    assert document["tags"]["A69-1602-15830"]["hours"] > 500


def test_the_papers_tables_come_from_the_data_and_only_from_them(tagtrack_data: Path, tmp_path: Path) -> None:
    rows = run_field(Setting(data=tagtrack_data)).rows
    error = {row.row: row.ours for row in rows if row.table.startswith("Table 1,") and row.column == "mean to Position 1"}
    assert sorted(error) == ["A", "B", "C", "D", "E"] and max(error.values()) < 1.0
    assert {row.row for row in rows if row.table.startswith("Table S1")} == {"PF", "MAP-M", "ML", "WLS", "WLS-ML"}
    assert not run_field(Setting()).rows and not run_field(Setting(data=tmp_path)).rows
