"""Detection files: each kind is read to the same arrays, and one line names file and place where a file is wrong."""

import csv
import gzip
import io
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tagtrack.envs.csv_table import name_cell
from tagtrack.eval.field import telemetry
from tagtrack.eval.field.array.reading import fit_names
from tagtrack.eval.field.static_array.detections import Detections
from tagtrack.eval.field.telemetry import read_detections, read_telemetry, write_detections
from tagtrack.eval.field.telemetry.layouts import BLOCK
from tagtrack.eval.field.telemetry.zones import hours_ahead, remark_on_zones

HEAD = "t_unix_s,receiver,tag\n"
OWN = HEAD + "1568045052.574,VR2W-128371,A69-1602-59336\n1568045164.142,VR2W-128355,A69-1602-59334\n"
VUE = (
    "\ufeffDate and Time (UTC),Receiver,Transmitter,Transmitter Name,Transmitter Serial,Sensor Value,Sensor Unit,"
    "Station Name,Latitude,Longitude\r\n"
    '2019-09-09 16:06:04.142,VR2W-128355,A69-1602-59334,,,,,"Bay, north",25.1,-80.9\r\n'
    "2019-09-09 16:04:12.574,VR2W-128371,A69-1602-59336,,,,,,,\r\n"
)
GLATOS = (
    "animal_id,detection_timestamp_utc,glatos_array,station_no,transmitter_codespace,transmitter_id,sensor_value,receiver_sn\n"
    "7,2019-09-09 16:04:12,BAY,1,A69-1602,59336,NA,128371\n"
    "8,2019-09-09 16:06:04,BAY,2,A69-1602,59334,NA,128355\n"
)
SETTINGS = settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture
def read(tmp_path):
    """What ``read_telemetry`` makes of files with these contents."""

    def reading_of(*contents):
        paths = [tmp_path / f"{index}.csv" for index in range(len(contents))]
        for path, content in zip(paths, contents, strict=True):
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_telemetry(paths)

    return reading_of


def rows_of(detections):
    return [
        (time, detections.receivers[receiver], detections.tags[tag])
        for time, receiver, tag in zip(detections.time.tolist(), detections.receiver, detections.tag, strict=True)
    ]


def refusal(path):
    """The one line with which a file is refused; it begins with the file."""
    with pytest.raises(ValueError) as caught:
        read_telemetry([path])
    message = str(caught.value)
    assert message.startswith(str(path)) and message.isprintable()
    return message.removeprefix(str(path))


def test_columns_may_stand_in_any_order_among_others_and_unsorted_rows_are_sorted(read):
    detections = read("tag,snr,t_unix_s,receiver\nb,9,20.5,R2\na,9,10.25,R1\nb,9,10.25,R1\n").detections
    assert rows_of(detections) == [(10.25, "R1", "a"), (10.25, "R1", "b"), (20.5, "R2", "b")]
    assert detections.receivers == ("R1", "R2") and detections.tags == ("a", "b")
    assert (detections.time.dtype, detections.receiver.dtype, detections.tag.dtype) == (np.float64, np.int32, np.int32)


def test_a_vue_export_and_our_own_csv_give_the_same_bits(read):
    vue = read(VUE)
    assert rows_of(vue.detections) == rows_of(read(OWN).detections)
    assert vue.layouts == ("VUE",) and vue.remarks == []


def test_a_glatos_export_joins_codespace_and_id_and_its_whole_seconds_are_remarked(read):
    reading = read(GLATOS)
    assert rows_of(reading.detections) == [
        (1568045052.0, "128371", "A69-1602-59336"),
        (1568045164.0, "128355", "A69-1602-59334"),
    ]
    (remark,) = reading.remarks
    assert remark.startswith("all times are whole seconds")


@pytest.mark.parametrize("outer", [True, False], ids=["campaign", "receivers"])
def test_a_folder_in_the_form_of_resnep_tells_receivers_by_its_file_names(tmp_path, outer):
    comment = "# Tag ID = A69-1602-626, Timestamp(s), TagID\n"
    for receiver, times in (("BS1", (30.5, 10.25)), ("BS2", (20.75,))):
        folder = tmp_path / f"TagDetections_{receiver}"
        folder.mkdir()
        rows = "".join(f"{time},A69-1602-626\n" for time in times)
        (folder / f"detections_{receiver}_A69-1602-626.txt").write_text(comment + rows)
        (folder / f"detections_{receiver}_A69-1602-627.txt").write_text(comment)
    reading = read_telemetry([tmp_path] if outer else sorted(tmp_path.iterdir()))
    assert [row[:2] for row in rows_of(reading.detections)] == [(10.25, "BS1"), (20.75, "BS2"), (30.5, "BS1")]
    assert reading.detections.tags == ("A69-1602-626",)
    assert reading.layouts == ("RESNEP",)


def test_files_are_merged_and_the_order_of_files_and_rows_makes_no_difference(read):
    lines = OWN.splitlines(keepends=True)
    forward, backward = read(OWN, VUE, HEAD + "1.5,R,b\n"), read(HEAD + "1.5,R,b\n", VUE, HEAD + lines[2] + lines[1])
    assert rows_of(forward.detections) == rows_of(backward.detections)
    assert forward.layouts == ("csv", "VUE")
    assert (forward.rows, forward.duplicates, len(forward.detections.time)) == (5, 2, 3)


def test_rows_that_repeat_are_dropped_counted_and_warned_of(tmp_path):
    (tmp_path / "a.csv").write_text(HEAD + "1.5,R,a\n1.5,R,b\n1.5,R,a\n1.5, R ,a\n2.5,R,a\n")
    with pytest.warns(UserWarning, match=r"2 of 5 rows repeat another \(time, receiver, tag\)"):
        detections = read_detections([tmp_path / "a.csv"])
    assert rows_of(detections) == [(1.5, "R", "a"), (1.5, "R", "b"), (2.5, "R", "a")]


@pytest.mark.parametrize(
    "content",
    [
        OWN.replace("\n", "\r\n").encode(),
        OWN.replace("\n", "\r").encode(),
        OWN.replace("\n", "\n\n").encode(),
        OWN.rstrip("\n").encode(),
        OWN.encode("utf-8-sig"),
        OWN.replace(",A69-1602-59336", ',"A69-1602-59336",,').encode(),
        gzip.compress(OWN.encode()),
        gzip.compress(OWN[:30].encode()) + gzip.compress(OWN[30:].encode()),
        OWN.replace("tag\n", "tag,place\n").replace("59336", '59336,"a ""bay"",\r\nwest"').replace("59334", "59334,").encode(),
        OWN.replace("tag\n", "tag,place\n").replace("6\n", "6,?\n").replace("4\n", "4,\n").encode().replace(b"?", b"Hav\xf8y"),
    ],
    ids="crlf cr blank no-end bom trailing gzip members quotes latin-1-elsewhere".split(),
)
def test_what_programs_do_to_a_csv_makes_no_difference(tmp_path, content):
    (tmp_path / "a.csv").write_bytes(content)
    (tmp_path / "b.csv").write_text(OWN)
    assert rows_of(read_detections([tmp_path / "a.csv"])) == rows_of(read_detections([tmp_path / "b.csv"]))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", ": line 1 must name the columns t_unix_s,receiver,tag (or those of an export of VUE, Fathom, GLATOS, OTN, "),
        ("time,id\n1,2\n", "ETN, Thelma or actel), got time,id"),
        ("t_unix_s;receiver;tag\n1;R;a\n", ": fields are divided by semicolons; save it as csv with commas"),
        ("t_unix_s,receiver,tag,tag\n1,R,a,b\n", ": line 1 names tag twice"),
        (HEAD, " holds no detections; give one row for each"),
        (HEAD + "1,R,a\nsoon,R,a\n", ": line 3: the time must be in seconds since 1970, got 'soon'"),
        (HEAD + "1,R,a\n\n,R,a\n", ": line 4: the time must be in seconds since 1970, got ''"),
        (HEAD + "nan,R,a\n", ": line 2: the time must be in seconds since 1970, from 0 to 1e+11, got 'nan'"),
        (HEAD + "inf,R,a\n", ": line 2: the time must be in seconds since 1970, from 0 to 1e+11, got 'inf'"),
        (HEAD + "-1,R,a\n", ": line 2: the time must be in seconds since 1970, from 0 to 1e+11, got '-1'"),
        (HEAD + "1560034372160,R,a\n", ": line 2: the time must be in seconds since 1970, from 0 to 1e+11, got '1560034372160'"),
        (HEAD + "1,,a\n", ": line 2: receiver must not be empty"),
        (HEAD + "1,R, \n", ": line 2: tag must not be empty"),
        (HEAD.encode() + b"1,R,\xf8\n", r": line 2: tag must be printable text in UTF-8, got '\udcf8'"),
        (HEAD + "1,R\n", ": line 2: tag must not be empty"),
        (HEAD + "1560034372,16,BS1,a\n", ": line 2: expected 3 fields as in line 1, got 4"),
        (HEAD + '1,"R,a\n2,R,a\n', ": line 3: not a csv text file"),
        (HEAD + '1,R,"two\nlines"\n2,R,\n', r": line 3: tag must be printable text in UTF-8, got 'two\nlines'"),
        ("t_unix_s,receiver,tag,note\n" + '1,R,a,"two\nlines"\n2,R,,\n', ": line 4: tag must not be empty"),
        (OWN.encode("utf-16"), ": line 1: not a csv text file; save it as csv in UTF-8"),
        (HEAD + "1" * (1 << 21), ": line 2: not a csv text file"),
        (gzip.compress(OWN.encode(), mtime=0)[:-12], ": damaged gzip file after line "),
        (gzip.compress(OWN.encode(), mtime=0)[:20] + bytes(40), ": damaged gzip file after line 0"),
        (VUE.replace("(UTC)", "(EST)"), ": line 1: 'Date and Time (EST)' may be in a local time zone"),
        ("receiver,datecollected,timezone\n7,2024-05-01 10:00:00,UTC\n", ": line 1 must name the columns t_unix_s,receiver,tag"),
        (VUE.replace("(UTC)", "(Local)"), "export times in UTC, as 'Date and Time (UTC)', or name the offset"),
        (GLATOS.replace("timestamp_utc", "timestamp_local"), ": line 1: 'detection_timestamp_local' may be in a local time zone"),
        (VUE.replace("2019-09-09 16:04:12.574", "9/9/2019 16:04"), ": line 3: the time has no seconds, as a spreadsheet"),
        (VUE.replace("2019-09-09 16:04:12.574", "2019-09-09"), ": line 3: a date without a time of day, as a spreadsheet"),
        (VUE.replace("16:04:12.574", "16:04:12.574 EST"), ": line 3: the time must be in UTC from 1970 on"),
        (VUE.replace("2019-09-09 16:04:12.574", "43717.66959"), ": line 3: the time is a number of days since 1899-12-30"),
        (VUE.replace("2019-09-09 16:04:12.574", "1568045052.574"), "seconds since 1970; name its column t_unix_s"),
        (OWN.replace("1568045052.574", "2019-09-09 16:04:12.574"), "; name a column of stamps in UTC Date and Time (UTC)"),
        (OWN.replace("1568045052.574", "1568045052574"), "these look like milliseconds, divide them by 1e+03"),
        (OWN.replace("1568045052.574", "1568045052574000"), "these look like microseconds, divide them by 1e+06"),
        (VUE.replace("2019-09-09 16:04", "2019-02-30 16:04"), "got '2019-02-30 16:04:12.574'"),
        (VUE.replace("2019-09-09 16:04", "1969-09-09 16:04"), "got '1969-09-09 16:04:12.574'"),
        (GLATOS.replace("59334", ""), ": line 3: tag must not be empty"),
        ("VEMCO DATA LOG,2.0.0,vdat-9\nRECORD TYPE,FIELD\n", ": a Fathom log without the line DET_DESC"),
        ("# Tag ID = 1\n1,a\n", ": begins with a comment; only files detections_RECEIVER_TAG.txt may"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line_and_value(tmp_path, content, says):
    path = tmp_path / "a.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert says in refusal(path)


def test_a_bad_row_past_the_first_block_is_named(tmp_path):
    number = BLOCK + 1000
    lines = [f"{index}.5,R,a\n" for index in range(number)]
    lines[number - 5] = "1e400,R,a\n"
    (tmp_path / "a.csv").write_text(HEAD + "".join(lines))
    assert refusal(tmp_path / "a.csv").startswith(f": line {number - 3}: the time must be")


def test_paths_without_detections_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="no detection file .*none.csv; give a csv with columns t_unix_s,receiver,tag"):
        read_telemetry([tmp_path / "none.csv"])
    assert refusal(tmp_path) == " holds no files detections_RECEIVER_TAG.txt; name csv files one by one"
    with pytest.raises(ValueError, match="at least one file"):
        read_telemetry([])


NAMES = st.text(st.sampled_from('aR1-"\',; é#'), min_size=1, max_size=5).map(str.strip).filter(bool)
ROWS = st.lists(st.tuples(st.floats(0, 9e10), NAMES, NAMES), min_size=1, max_size=30)


@SETTINGS
@given(rows=ROWS, line_end=st.sampled_from(["\n", "\r\n"]), bom=st.booleans(), packed=st.booleans(), repeat=st.booleans())
def test_any_table_is_read_as_the_set_of_its_rows(tmp_path, rows, line_end, bom, packed, repeat):
    text = io.StringIO()
    written = [(time, name_cell(receiver), name_cell(tag)) for time, receiver, tag in rows]
    csv.writer(text, lineterminator=line_end).writerows([HEAD.strip().split(","), *written, *(written if repeat else [])])
    content = text.getvalue().encode("utf-8-sig" if bom else "utf-8")
    path = tmp_path / "a.csv"
    path.write_bytes(gzip.compress(content) if packed else content)
    reading = read_telemetry([path])
    assert rows_of(reading.detections) == sorted(set(rows))
    assert reading.duplicates == len(rows) * (1 + repeat) - len(set(rows))
    write_detections(tmp_path / "b.csv.gz", reading.detections)
    assert rows_of(read_telemetry([tmp_path / "b.csv.gz"]).detections) == rows_of(reading.detections)


FRAGMENTS = st.sampled_from(
    [HEAD, "t_unix_s", "1568045052.574"]
    + [",", ",,", "\n", "\r\n", "\r", '"', '""', "nan", "-1", "1e999", "R", "a", " ", "\0", "é", "#"]
    + ["Date and Time (UTC),Receiver,Transmitter\n", "2019-09-09 16:04:11.5", "0000-00-00 00:00:00", "\ufeff", "1,R,a\n", "\x1c"]
)


def one_line_or_a_result(path):
    try:
        reading = read_telemetry([path])
    except ValueError as error:
        assert str(error).startswith(str(path)) and str(error).isprintable()
    else:
        time = reading.detections.time
        assert time.size and np.isfinite(time).all() and (np.diff(time) >= 0).all()


@SETTINGS
@given(parts=st.lists(FRAGMENTS, max_size=25), head=st.booleans())
def test_a_broken_table_gives_one_line_or_a_result(tmp_path, parts, head):
    (tmp_path / "a.csv").write_bytes((HEAD * head + "".join(parts)).encode())
    one_line_or_a_result(tmp_path / "a.csv")


@SETTINGS
@given(content=st.binary(max_size=300), head=st.booleans())
@example(content=b"\x1f\x8b", head=False)
@example(content=b"\x1f\x8b\x08\x04\x00\x00\x00\x00\x00\x03\xff\xff", head=False)
def test_random_bytes_give_one_line_or_a_result(tmp_path, content, head):
    (tmp_path / "a.csv").write_bytes(HEAD.encode() * head + content)
    one_line_or_a_result(tmp_path / "a.csv")


@SETTINGS
@given(cut=st.integers(0, 200), at=st.integers(0, 200), bits=st.integers(1, 255))
def test_a_cut_or_flipped_gzip_file_gives_one_line_or_a_result(tmp_path, cut, at, bits):
    packed = bytearray(gzip.compress((OWN * 3).replace(HEAD, "").join([HEAD, ""]).encode(), mtime=0))
    packed[at % len(packed)] ^= bits
    (tmp_path / "a.csv.gz").write_bytes(packed[: len(packed) - cut % len(packed)])
    one_line_or_a_result(tmp_path / "a.csv.gz")


def test_written_files_keep_every_bit_of_a_time_and_equal_data_make_equal_files(tmp_path):
    time = 1.5e9 + np.arange(2000) * np.spacing(1.5e9)  # 2.4e-7 s: six decimals would not do
    detections = Detections(
        time=time,
        receiver=np.arange(2000, dtype=np.int32) % 3,
        tag=np.zeros(2000, np.int32),
        receivers=("R,1", 'R"2', "R3"),
        tags=("a",),
    )
    for name in ("a.csv", "a.csv.gz", "b.csv.gz"):
        write_detections(tmp_path / name, detections)
        assert rows_of(read_detections([tmp_path / name])) == rows_of(detections)
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.csv.gz", "b.csv.gz"]


def test_memory_stays_within_a_few_times_the_arrays(tmp_path, monkeypatch):
    number, block = 100_000, 1 << 13
    monkeypatch.setattr(telemetry.layouts, "BLOCK", block)
    with (tmp_path / "a.csv").open("w") as file:
        file.write(HEAD)
        file.writelines(f"{1e9 + index / 8},R{index % 7},tag-{index % 50}\n" for index in range(number))
    tracemalloc.start()
    try:
        detections = read_detections([tmp_path / "a.csv"])
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(detections.time) == number
    # Two blocks as text, some 300 bytes a row, whatever the length of the file, and the arrays, 16 bytes a row, thrice.
    assert peak < 2 * 300 * block + 3 * 16 * number + 1e6


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("resnep/sync_detections.csv.gz", 124_310),
        ("resnep/lobster_detections.csv.gz", 347_639),
        ("resnep/other_id_detections.csv.gz", 288),
        ("ssu1/sync_detections.csv.gz", 7_510),
        ("ssu1/test_tag_detections.csv.gz", 923),
    ],
)
def test_field_data_have_the_rows_their_readme_says(tagtrack_data, name, rows):
    reading = read_telemetry([tagtrack_data / name])
    assert (reading.rows, reading.duplicates, reading.remarks) == (rows, 0, [])


# One row of what public tools and portals hand out, and the receiver and tag that it tells of.
TABLES = {
    "VUE, short rows": (
        "Date and Time (UTC),Receiver,Transmitter,Transmitter Name,Station Name,Latitude\n"
        "2024-05-01 10:00:00.101,VR2W-7,A69-1602-5,,S1\n", "VR2W-7", "A69-1602-5",
    ),
    "ISO": ("Date and Time (UTC),Receiver,Transmitter\n2024-05-01T10:00:00.101Z,VR2W-7,A69-1602-5\n", "VR2W-7", "A69-1602-5"),
    "offset": ("Date and Time (UTC),Receiver,Transmitter\n2024-05-01 10:00:00.101000+00:00,R,5\n", "R", "5"),
    "Fathom log": (
        "VEMCO DATA LOG,2.0.0,vdat-11\nRECORD TYPE,FIELD,FIELD\n"
        "DET_DESC,Device Time (UTC),Time,Time Offset (h),Model,Serial Number,Full ID\nTEMP_DESC,Device Time (UTC)\n"
        "TEMP,2024-05-01 09:00:00\nDET,2024-05-01 10:00:03.5,2024-05-01 10:00:00.101,,HR2-180,7,H180-1702-5\n",
        "7", "H180-1702-5",
    ),
    "Fathom table": (
        "Device Time (UTC),Time,Time Offset (h),Model,Serial Number,Full ID,ID\n2024-05-01 10:00:00.101,,,HR2,7,H180-1702-5,5\n",
        "7", "H180-1702-5",
    ),
    "OTN": (
        "collectionCode,dateCollectedUTC,receiver,tagName,codeSpace\nX,2024-05-01 10:00:00.101,7,A69-9001-5,A69-9001\n"
        "X,2024-05-01 00:00:00,release,A69-9001-6,A69-9001\n", "7", "A69-9001-5",
    ),
    "OTN, old": (
        "receiver,tagname,datecollected,timezone\n7,A69-9001-5,2024-05-01 10:00:00.101,UTC\n",
        "7", "A69-9001-5",
    ),
    "ETN": (
        "detection_id,date_time,acoustic_tag_id,receiver_id\n1,2024-05-01T10:00:00.101Z,A69-1206-5,VR2W-7\n",
        "VR2W-7", "A69-1206-5",
    ),
    "actel": (
        "Timestamp,Receiver,CodeSpace,Signal\n2024-05-01 10:00:00.101,7,R64K,4001\n",
        "7", "R64K-4001",
    ),
    "Thelma": (
        "Date and Time (UTC),CodeType,TBR Serial Number,Id,Data\n2024-05-01T10:00:00.101Z,S64K,735,4001,-\n",
        "735", "S64K-4001",
    ),
    "Thelma, new": (
        "Date and Time (UTC),Protocol,Receiver,ID,Data\n2024-05-01 10:00:00.101,R64K,735,4001,-\n",
        "735", "R64K-4001",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_columns_are_known_by_what_vendors_and_portals_call_them(tmp_path, name):
    content, receiver, tag = TABLES[name]
    (tmp_path / "d.csv").write_text(content, encoding="utf-8-sig")
    found = read_detections([tmp_path / "d.csv"])
    assert (found.receivers[found.receiver[0]], found.tags[found.tag[0]]) == (receiver, tag)
    assert found.time.tolist() == [1714557600.101]


@pytest.mark.parametrize(
    ("column", "stamp"),
    [
        ("Date and Time (UTC)", "2024-05-01 12:00:00.101+02:00"),
        ("Date and Time (UTC)", "2024-05-01T06:30:00.101-0330"),
        ("timestamp", "2024-05-01 12:00:00.101 +02"),
        ("Date and Time (UTC+2)", "2024-05-01 12:00:00.101"),
        ("Date and Time (UTC-03:30)", "2024-05-01 06:30:00.101"),
        ("Date and Time (GMT+10:00)", "2024-05-01T10:00:00.101Z"),  # the stamp itself says what it is
    ],
)
def test_stamps_and_columns_that_tell_their_offset_from_utc_are_read_to_the_letter(read, column, stamp):
    assert read(f"{column},Receiver,Transmitter\n{stamp},R,5\n").detections.time.tolist() == [1714557600.101]


@pytest.mark.parametrize(
    ("first", "says"),
    [(45413.41667, "spreadsheet"), (19844.41667, "R counts"), (739373.41667, "MATLAB"), (2460431.91667, "Julian")],
)
def test_days_given_as_seconds_are_remarked_and_seconds_are_not(read, first, says):
    days = read(HEAD + f"{first},R,a\n{first + 60.5},R,a\n")
    assert any(says in remark and "if so, give seconds" in remark for remark in days.remarks)
    assert read(OWN).remarks == [] and read(HEAD + "10.25,R,a\n9000.5,R,a\n").remarks == []


def campaign(ahead: dict[str, float], late: dict[str, float]) -> Detections:
    """Two tags of random intervals at five receivers that miss a third, some hours ahead of UTC or seconds late."""
    rng = np.random.default_rng(0)
    names = ("R0", "R1", "R2", "R3", "R4")
    sent = [(tag, each) for tag in (0, 1) for each in np.cumsum(rng.uniform(60, 120, 400))]
    heard = [(1.7e9 + each + rng.uniform(0, 0.3) + 3600 * ahead.get(name, 0) + late.get(name, 0), r, tag)
             for tag, each in sent for r, name in enumerate(names) if rng.uniform() < 0.67]  # fmt: skip
    time, receiver, tag = (np.array(column) for column in zip(*sorted(heard), strict=True))
    return Detections(
        time=time, receiver=receiver.astype(np.int32), tag=tag.astype(np.int32), receivers=names, tags=("a", "b")
    )


def test_receivers_in_another_time_zone_are_named_and_drifting_clocks_are_not():
    assert hours_ahead(campaign({}, {})) == {}
    assert hours_ahead(campaign({}, {"R1": 40.0, "R2": -103.0})) == {}
    found = hours_ahead(campaign({"R1": 2.0, "R3": -3.5}, {}))
    assert found == {"R1": 2.0, "R3": -3.5}
    [behind, ahead] = remark_on_zones(campaign({"R1": 2.0, "R3": -3.5}, {}))
    assert "R1 are 2 h ahead of" in ahead and "R3 are 3.5 h behind" in behind and "export all in UTC" in ahead


def test_a_tag_that_pings_each_minute_tells_no_zone():
    time = 1.7e9 + 60.0 * np.arange(400)
    heard = Detections(
        time=np.concatenate([time, time + 7200.1]), receiver=np.repeat(np.array([0, 1], np.int32), 400),
        tag=np.zeros(800, np.int32), receivers=("A", "B"), tags=("a",),
    )  # fmt: skip
    assert hours_ahead(heard) == {}


def test_nine_digits_of_a_second_are_read_and_other_zones_refused(tmp_path):
    path = tmp_path / "d.csv"
    path.write_text("Date and Time (UTC),Receiver,Transmitter\n2024-05-01 10:00:00.101234567,R,5\n")
    assert read_detections([path]).time[0] == pytest.approx(1714557600.101234567, abs=3e-7)
    path.write_text("receiver,tagname,datecollected,timezone\n7,A,2024-05-01 10:00:00,America/Halifax\n")
    with pytest.raises(ValueError, match="line 2: times must be in UTC, got timezone 'America/Halifax'"):
        read_detections([path])


def test_receivers_go_by_serial_or_by_model_and_serial_and_strangers_are_named(capsys):
    detections = Detections(
        time=np.arange(4.0), receiver=np.array([0, 0, 1, 2], np.int32), tag=np.zeros(4, np.int32),
        receivers=("VR2W-100001", "100002", "VR2W-100009"), tags=("A",),
    )  # fmt: skip
    fitted = fit_names(detections, ["100001", "VR2AR-100002", "100003"], Path("r.csv"))
    assert fitted.receivers == ("100001", "VR2AR-100002", "VR2W-100009")
    shown = capsys.readouterr().out
    assert "1 detections of VR2W-100009 are left out: not in r.csv" in shown and "no detections of 100003" in shown
    with pytest.raises(ValueError, match="no receiver of r.csv .* is in the detections"):
        fit_names(detections, ["7"], Path("r.csv"))
