"""Known places: receivers, sync tags and references are read as they stand, and a wrong row is named."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tagtrack.eval.field.array.reading import by_deployment
from tagtrack.eval.field.static_array.detections import Detections
from tagtrack.eval.field.telemetry import Plane, read_own_tags, read_receivers, read_reference, read_sync_tags

READERS = {"receiver": read_receivers, "sync": read_sync_tags, "reference": read_reference, "own": read_own_tags}
BAY = Plane(longitude=-80.9, latitude=25.1)
CROSS = np.array([[0.0, 100.0], [0.0, -100.0], [100.0, 0.0], [-100.0, 0.0]])  # the origin is its mean
RECEIVERS, SYNC, STATIC, TRACK = "receiver,x,y\n", "tag,receiver,x,y\n", "tag,x,y\n", "t_unix_s,x,y\n"


@pytest.fixture
def file(tmp_path):
    """A file with this content."""

    def path_of(content):
        (tmp_path / "places.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
        return tmp_path / "places.csv"

    return path_of


def test_receivers_keep_their_order_and_other_columns_are_ignored(file):
    places = read_receivers(file('y,depth_m,receiver,x\n2,"9,5",BS2,1\n4,,BS1,3\n'))
    assert places.names == ("BS2", "BS1")
    np.testing.assert_array_equal(places.position, [[1, 2], [3, 4]])


def test_a_sync_tag_hangs_by_a_receiver_or_in_a_known_place_or_both_or_anywhere(file):
    by, alone, both, anywhere = read_sync_tags(file(SYNC + "S1,BS1,,\nS2,,5,6\nS3,BS2,7,8\nS4,,,\n"))
    assert (by.tag, by.receiver, by.position) == ("S1", "BS1", None)
    assert (alone.receiver, alone.position.tolist()) == (None, [5, 6])
    assert (both.receiver, both.position.tolist()) == ("BS2", [7, 8])
    assert (anywhere.receiver, anywhere.position) == (None, None)


def test_all_tags_beside_a_receiver_are_its_own_wherever_they_are_said_to_be(file):
    rows = "S1,BS1,9999,\nS2,,,\nS3,BS2,,\nS4, BS1,,no number\n"
    assert read_own_tags(file("tag,receiver,lon,lat\n" + rows)) == {"BS1": ("S1", "S4"), "BS2": ("S3",)}


def test_a_reference_that_stays_is_where_it_is_at_any_time(file):
    reference = read_reference(file(STATIC + "A,1,2\nB,3,4\n"))
    np.testing.assert_array_equal(reference.position("B", [0, 1e9]), [[3, 4], [3, 4]])
    with pytest.raises(ValueError, match="no reference position of tag 'C'; there are A, B"):
        reference.position("C", [0])


def test_a_moving_reference_is_interpolated_and_unknown_outside_its_track_and_in_long_gaps(file):
    reference = read_reference(file(TRACK + "100,0,0\n110,10,20\n231,10,20\n"))  # the gap of 121 s is one too long
    known = reference.position("any", [99, 100, 105, 110, 120, 231, 232])
    nowhere = [np.nan, np.nan]
    np.testing.assert_allclose(known, [nowhere, [0, 0], [5, 10], [10, 20], nowhere, [10, 20], nowhere])


@pytest.mark.parametrize(
    ("kind", "content", "says"),
    [
        ("receiver", "", ": line 1 must name the columns receiver,x,y, got nothing; rename or add them"),
        ("receiver", "receiver,gps_x,usbl_x\n", ", got receiver,gps_x,usbl_x; rename or add them (degrees: lon,lat for x,y)"),
        ("receiver", RECEIVERS, " holds no receivers; give one row for each"),
        ("receiver", RECEIVERS + ",1,2\n", ": line 2: receiver must not be empty; leave out rows of moorings without a receiver"),
        ("receiver", RECEIVERS + "a,1,2\n a,3,4\n", ": line 3: receiver 'a' is given twice; remove one"),
        ("receiver", RECEIVERS + "a,1,nan\n", ": line 2: y must be finite, got 'nan'"),
        ("receiver", RECEIVERS + "a,1,\n", ": line 2: y must be a number, got ''"),
        ("receiver", b"\x89PNG\r\n\x1a\n\0\0", ": line 1 must name the columns receiver,x,y, got '\\udc89PNG'"),
        ("sync", SYNC, " holds no sync tags; give one row for each"),
        ("receiver", "receiver,lon,lat\na,0,0\nb,3,95\n", ": line 3: longitude must be within +-360 and latitude within +-90"),
        ("receiver", "receiver,lon,lat\na,0,\n", ": line 2: lat must be a number, got ''"),
        ("sync", "tag,receiver,Lon,Lat\n", ": line 1 must name the columns tag,receiver,x,y, got tag,receiver,Lon,Lat; rename"),
        ("own", SYNC, " holds no sync tags; give one row for each"),
        ("own", SYNC + "S1,BS1,,\nS1,BS2,,\n", ": line 3: tag 'S1' is given twice; remove one"),
        ("sync", SYNC + "S1,BS1,3,\n", ": line 2: y must be a number, got ''"),
        ("sync", SYNC + ",BS1,3,4\n", ": line 2: tag must not be empty"),
        ("sync", SYNC + "S1,BS1,3,4\nS1,BS2,3,4\n", ": line 3: tag 'S1' is given twice; remove one"),
        ("reference", STATIC, " holds no positions; give one row for each tag"),
        ("reference", TRACK, " holds no positions; give one row for each"),
        ("reference", "tag,t_unix_s,x,y\nA,1,2,3\n", ": line 1 names both tag and t_unix_s; give the track of one tag"),
        ("reference", "t_unix_s,x,lat\n1,2,3\n", ": line 1 must name the columns t_unix_s,x,y, got t_unix_s,x,lat"),
        ("reference", STATIC + "A,1,2\nA,1,2\n", ": line 3: tag 'A' is given twice; remove one"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(file, kind, content, says):
    path = file(content)
    with pytest.raises(ValueError) as caught:
        READERS[kind](path)
    message = str(caught.value)
    assert message.startswith(str(path)) and message.isprintable() and says in message


@pytest.mark.parametrize("names", ["lon,lat", "longitude,latitude"])
def test_receivers_in_degrees_lie_in_the_plane_about_their_mean(file, as_degrees, names):
    rows = "".join(f"R{index},{lon!r},{lat!r}\n" for index, (lon, lat) in enumerate(as_degrees(CROSS).tolist()))
    places = read_receivers(file(f"receiver,{names}\n{rows}"))
    assert (places.plane.longitude, places.plane.latitude) == pytest.approx((-80.9, 25.1), abs=1e-12)
    np.testing.assert_allclose(places.position, CROSS, atol=1e-3)


def test_receivers_that_tell_metres_and_degrees_are_taken_in_metres(file):
    places = read_receivers(file("receiver,lon,lat,x,y\na,-80.9,25.1,526073,2771147\n"))
    assert places.plane is None and places.position.tolist() == [[526073, 2771147]]


def test_receivers_too_far_apart_for_a_plane_are_refused(file, as_degrees):
    path = file("receiver,lon,lat\na,0,0\nb,0,0\nc,9,0\n")
    with pytest.raises(ValueError, match=r"longitude 9, latitude 0 is .* km from the origin 3, 0 \(at most 100 km\)") as caught:
        read_receivers(path)
    assert str(caught.value).startswith(str(path))


def test_sync_tags_and_references_in_degrees_lie_in_the_plane_of_the_receivers(file, as_degrees):
    (lon, lat), (later_lon, later_lat) = as_degrees(np.array([[30.0, -20.0], [50.0, 0.0]])).tolist()
    placed, by, anywhere = read_sync_tags(file(f"tag,receiver,lon,lat\nS1,BS1,{lon},{lat}\nS2,BS1,,\nS3,,,\n"), BAY)
    np.testing.assert_allclose(placed.position, [30, -20], atol=1e-3)
    assert by.position is None and anywhere.position is None
    still = read_reference(file(f"tag,longitude,latitude\nA,{lon},{lat}\n"), BAY)
    np.testing.assert_allclose(still.position("A", [0]), [[30, -20]], atol=1e-3)
    moving = read_reference(file(f"t_unix_s,lon,lat\n100,{lon},{lat}\n120,{later_lon},{later_lat}\n"), BAY)
    np.testing.assert_allclose(moving.position("A", [110]), [[40, -10]], atol=1e-3)


def test_of_places_in_metres_and_in_degrees_those_are_taken_that_go_with_the_receivers(file, as_degrees):
    ((lon, lat),) = as_degrees(np.array([[30.0, -20.0]])).tolist()
    for head, row, read in (
        ("tag,receiver,x,y,lon,lat", f"S1,,5e5,6e6,{lon},{lat}", lambda *given: read_sync_tags(*given)[0].position),
        ("tag,x,y,lon,lat", f"A,5e5,6e6,{lon},{lat}", lambda *given: read_reference(*given).places["A"]),
        ("t_unix_s,x,y,lon,lat", f"1,5e5,6e6,{lon},{lat}", lambda *given: read_reference(*given).track.position[0]),
    ):
        path = file(f"{head}\n{row}\n")
        np.testing.assert_array_equal(read(path), [5e5, 6e6])
        np.testing.assert_allclose(read(path, BAY), [30, -20], atol=1e-3)


def test_sync_tags_without_places_go_with_receivers_in_any_units(file):
    for names in ("x,y", "lon,lat"):
        path = file(f"tag,receiver,{names}\nS1,BS1,,\n")
        for plane in (None, BAY):
            assert [tag.position for tag in read_sync_tags(path, plane)] == [None]


FOREIGN_METRES = "x,y have another origin than receivers in longitude and latitude; give lon,lat here too, or receivers in x,y"
FOREIGN_DEGREES = "take receivers in degrees too: a file with columns receiver,lon,lat, and without x,y"


@pytest.mark.parametrize(
    ("kind", "content", "plane", "says"),
    [
        ("sync", SYNC + "S1,BS1,,\nS2,BS2,3,4\n", BAY, f": line 3: {FOREIGN_METRES}"),
        ("sync", "tag,receiver,x,y,lon,lat\nS1,BS1,3,4,,\n", BAY, f": line 2: {FOREIGN_METRES}"),
        ("sync", "tag,receiver,lon,lat\nS1,BS1,-80.9,25.1\n", None, f": line 2: lon,lat {FOREIGN_DEGREES}"),
        ("sync", "tag,receiver,x,y,lon,lat\nS1,BS1,,,-80.9,25.1\n", None, f": line 2: lon,lat {FOREIGN_DEGREES}"),
        ("reference", STATIC + "A,1,2\n", BAY, f": line 1: {FOREIGN_METRES}"),
        ("reference", TRACK + "1,1,2\n", BAY, f": line 1: {FOREIGN_METRES}"),
        ("reference", "tag,longitude,latitude\nA,-80.9,25.1\n", None, f": line 1: longitude,latitude {FOREIGN_DEGREES}"),
        ("reference", "t_unix_s,lon,lat\n1,-80.9,25.1\n", None, f": line 1: lon,lat {FOREIGN_DEGREES}"),
    ],
)
def test_metres_beside_degrees_are_refused_as_their_origins_differ(file, kind, content, plane, says):
    path = file(content)
    with pytest.raises(ValueError) as caught:
        READERS[kind](path, plane)
    assert str(caught.value) == f"{path}{says}"


@pytest.mark.parametrize(
    ("kind", "content", "says"),
    [
        ("sync", "tag,receiver,lon,lat\nS1,,-80.9,25.1\nS2,,-90,25\n", ": line 3: longitude -90, latitude 25 is "),
        ("reference", "tag,lon,lat\nA,25.1,-80.9\n", ": line 2: longitude 25.1, latitude -80.9 is "),
        ("reference", "t_unix_s,lon,lat\n1,25.1,-80.9\n", ": longitude 25.1, latitude -80.9 is "),
        ("reference", "tag,lon,lat\nA,25.1,-100\n", ": line 2: longitude must be within +-360 and latitude within +-90 degrees"),
    ],
)
def test_degrees_elsewhere_on_the_earth_are_refused(file, as_degrees, kind, content, says):
    path = file(content)
    with pytest.raises(ValueError) as caught:
        READERS[kind](path, BAY)
    assert str(caught.value).startswith(f"{path}{says}")


@pytest.mark.parametrize("kind", READERS)
def test_a_missing_file_is_named(tmp_path, kind):
    with pytest.raises(FileNotFoundError, match=f"no {kind.replace('own', 'sync')}.* file .*none.csv; give a csv with columns"):
        READERS[kind](tmp_path / "none.csv")


FIELDS = ["receiver", "tag", "x", "y", "lon", "lat", "t_unix_s", ",", "\n", '"', "1", "2.5", "nan", "", "BS1", "\0", "\udcff"]


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    head=st.sampled_from([RECEIVERS, SYNC, STATIC, TRACK, "tag,receiver,lon,lat\n", "tag,x,y,lon,lat\n", ""]),
    parts=st.lists(st.sampled_from(FIELDS), max_size=20),
    kind=st.sampled_from(sorted(READERS)),
)
def test_a_broken_table_gives_one_line_or_a_result(file, head, parts, kind):
    path = file((head + "".join(parts)).encode("utf-8", "surrogateescape"))
    try:
        READERS[kind](path)
    except ValueError as error:
        assert str(error).startswith(str(path)) and str(error).isprintable()


def test_receivers_of_the_field_are_read_and_a_table_of_moorings_says_what_it_lacks(tagtrack_data):
    places = read_receivers(tagtrack_data / "ssu1" / "receivers.csv")
    assert len(places.names) == 19 and places.position[0].tolist() == [525973, 2771312]
    with pytest.raises(ValueError, match="line 1 must name the columns receiver,x,y, got receiver,mooring.*rename or add them"):
        read_receivers(tagtrack_data / "resnep" / "stations.csv")


def test_the_boat_of_the_field_is_a_reference(tagtrack_data):
    reference = read_reference(tagtrack_data / "ssu1" / "gps_track.csv")
    np.testing.assert_allclose(reference.position("15266", [1568052138.5]), [[526073.2845, 2771146.771]], atol=1e-6)


def test_a_receiver_that_was_put_down_anew_stands_where_it_stood_then(tmp_path, capsys):
    path = tmp_path / "r.csv"
    path.write_text("receiver,x,y,start,stop\nR0,0,0,2024-04-01,2024-05-01\nR0,40,0,2024-05-01 12:00:00,\nR1,200,0,,2024-06-01\n")
    places = read_receivers(path)
    assert places.names == ("R0", "R0 (2)", "R1") and places.called == ("R0", "R0", "R1")
    april, noon, may, june = 1713960000.0, 1714550000.0, 1714600000.0, 1717300000.0
    times = np.array([april, april, noon, may, may, june])
    receiver = np.array([0, 1, 0, 0, 1, 1], np.int32)
    heard = Detections(time=times, receiver=receiver, tag=np.zeros(6, np.int32), receivers=("R0", "R1"), tags=("A",))
    found = by_deployment(heard, places)
    assert found.receiver.tolist() == [0, 2, 1, 2] and found.time.tolist() == [april, april, may, may]
    assert "2 detections are left out: their receivers were not deployed then" in capsys.readouterr().out
    for rows, message in (
        ("R0,0,0,45413.5,\n", "line 2: start: 45413.5 looks like days since 1899-12-30, as a spreadsheet counts"),
        ("R0,0,0,2024-04-01,2024-05-02\nR0,1,1,2024-05-01,\n", "line 3: receiver 'R0' is given twice at one time"),
        ("R0,0,0,2024-05-01,2024-04-01\n", "line 2: start 2024-05-01 must be before stop 2024-04-01"),
        ("R0,0,0,May,\n", "line 2: start: the time must be in UTC"),
    ):
        path.write_text("receiver,x,y,start,stop\n" + rows)
        with pytest.raises(ValueError, match=message):
            read_receivers(path)
