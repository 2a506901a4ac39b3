"""Logs as people have them: one file or two, csv or JSON lines, in any order; and what is no log."""

from __future__ import annotations

from pathlib import Path

import pytest

from tagtrack.live.mission_log import read_log

NAVIGATION = "t,x,y,heading,speed\n0,0,0,90,1\n10,10,0,90,1\n20,20,0,90,1\n"
DEGREES = "t,x,y,heading,speed\n" + "".join(f"{t},10.{t:03d},60,90,1.5\n" for t in range(100))
READINGS = "t,tag,range\n10,7,120\n20,7,110.5\n"


def write(folder: Path, **files: str) -> list[Path]:
    paths = []
    for name, text in files.items():
        paths.append(folder / name.replace("_", "."))
        paths[-1].write_text(text, encoding="utf-8")
    return paths


def test_two_files_and_one_are_the_same_log(tmp_path: Path) -> None:
    two = read_log(write(tmp_path, nav_csv=NAVIGATION, pings_csv=READINGS))
    rows = ["t,x,y,heading,speed,tag,range", "0,0,0,90,1,,", "10,10,0,90,1,7,120", "20,20,0,90,1,,", "20,,,,,7,110.5"]
    one = read_log(write(tmp_path, all_csv="\r\n".join(rows)))
    json_rows = [
        '{"t": 0, "x": 0, "y": 0, "heading": 90, "speed": 1}', '{"t": 10, "x": 10, "y": 0, "heading": 90, "speed": 1}',
        '{"t": 20, "x": 20, "y": 0, "heading": 90, "speed": 1, "tag": 7, "range": 110.5}', '{"t": 10, "tag": "7", "range": 120}',
    ]  # fmt: skip
    lines = read_log(write(tmp_path, all_jsonl="\n".join(json_rows)))
    assert two.navigation == one.navigation == lines.navigation
    assert two.readings == one.readings == lines.readings
    assert two.tags == ("7",) and two.readings[1].values == (("range", 110.5),)


def test_order_does_not_matter_and_doubled_rows_count_once(tmp_path: Path) -> None:
    straight = read_log(write(tmp_path, nav_csv=NAVIGATION, pings_csv=READINGS))
    header, *rows = NAVIGATION.strip().splitlines()
    mixed = "\n".join([header, rows[2], rows[0], rows[1], rows[0]])
    pings = READINGS + "10,7,120\n"
    found = read_log(write(tmp_path, mixed_csv=mixed, doubled_csv=pings))
    assert (found.navigation, found.readings) == (straight.navigation, straight.readings)
    assert found.disordered == 3 and found.doubled == 2


def test_conventions_and_other_names_of_columns(tmp_path: Path) -> None:
    text = "# headings: mathematical\n# speeds: knots\nt_unix_s,longitude,latitude,heading,speed\n5,10.5,60.25,1.5,2\n"
    log = read_log(write(tmp_path, nav_csv=text))
    assert log.conventions == {"headings": "mathematical", "speeds": "knots"} and log.in_degrees
    assert (log.navigation[0].x, log.navigation[0].y, log.navigation[0].heading) == (10.5, 60.25, 1.5)
    log = read_log(write(tmp_path, nav_jsonl='{"headings": "mathematical"}\n{"t": 1, "x": 2, "y": 3}'))
    assert log.conventions == {"headings": "mathematical"} and log.navigation[0].heading is None


def test_an_answer_that_did_not_come(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, nav_csv=NAVIGATION, pings_csv="t,tag,range,heard\n10,7,,0\n"))
    assert not log.readings[0].heard and log.readings[0].values == ()


BAD = {
    "empty": ("", "is empty; a log has rows of navigation"),
    "header alone": ("t,x,y\n", "is empty; a log has rows of navigation"),
    "no navigation": (READINGS, "no row of navigation"),
    "no time": ("x,y\n1,2\n", "must name a column t, got x,y"),
    "empty time": ("t,x,y\n,1,2\n", "line 2: t is empty"),
    "word": ("t,x,y\n0,one,2\n", "line 2: x must be a number, got 'one'"),
    "infinite": ("t,x,y\n0,inf,2\n", "line 2: x must be finite"),
    "half a place": ("t,x,y\n0,1,\n", "line 2: a place needs x and y"),
    "nothing": ("t,x,y\n0,,\n", "line 2: has neither a place"),
    "short row": ("t,x,y\n0,1\n", "line 2: expected 3 fields as in line 1, got 2"),
    "heard twice": ("t,x,y,tag,heard\n0,1,1,7,2\n", "line 2: heard must be 0 or 1, got 2"),
    "negative range": ("t,x,y,tag,range\n0,1,1,7,-2\n", "line 2: range must be at least 0, got -2"),
    "degrees as metres": (DEGREES, "name the columns lon,lat"),
    "binary": ("\0\0\0", "not a csv text file"),
    "bad json": ('{"t": 0, "x": 1, "y": 2}\n{"t": 0,', "line 2: is no line of JSON"),
    "json list": ('{"t": 0, "x": 1, "y": 2}\n[]', "line 2: must be an object"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_log_is_refused_with_file_and_line(tmp_path: Path, name: str) -> None:
    text, message = BAD[name]
    (path,) = write(tmp_path, log_csv=text)
    with pytest.raises(ValueError, match=message) as raised:
        read_log([path])
    assert str(path) in str(raised.value) and "\n" not in str(raised.value)


def test_kinds_of_places_are_not_mixed(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="some places are x,y and some lon,lat"):
        read_log(write(tmp_path, a_csv=NAVIGATION, b_csv="t,lon,lat\n0,1,2\n"))
    with pytest.raises(FileNotFoundError, match="no log"):
        read_log([tmp_path / "none.csv"])
