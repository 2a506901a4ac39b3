"""Known places: receivers, sync tags and references are read as they stand, and a wrong row is named."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tagtrack.eval.telemetry import read_receivers, read_reference, read_sync_tags

READERS = {"receiver": read_receivers, "sync": read_sync_tags, "reference": read_reference}
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


def test_a_sync_tag_hangs_by_a_receiver_or_in_a_known_place_or_both(file):
    by, alone, both = read_sync_tags(file(SYNC + "S1,BS1,,\nS2,,5,6\nS3,BS2,7,8\n"))
    assert (by.tag, by.receiver, by.position) == ("S1", "BS1", None)
    assert (alone.receiver, alone.position.tolist()) == (None, [5, 6])
    assert (both.receiver, both.position.tolist()) == ("BS2", [7, 8])


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
        ("receiver", "receiver,gps_drop_x,rov_usbl_x\n", "got receiver,gps_drop_x,rov_usbl_x; rename or add them"),
        ("receiver", RECEIVERS, " holds no receivers; give one row for each"),
        ("receiver", RECEIVERS + ",1,2\n", ": line 2: receiver must not be empty; leave out rows of moorings without a receiver"),
        ("receiver", RECEIVERS + "a,1,2\n a,3,4\n", ": line 3: receiver 'a' is given twice; remove one"),
        ("receiver", RECEIVERS + "a,1,nan\n", ": line 2: y must be finite, got 'nan'"),
        ("receiver", RECEIVERS + "a,1,\n", ": line 2: y must be a number, got ''"),
        ("receiver", b"\x89PNG\r\n\x1a\n\0\0", ": line 1 must name the columns receiver,x,y, got '\\udc89PNG'"),
        ("sync", SYNC, " holds no sync tags; give one row for each"),
        ("sync", SYNC + "S1,,,\n", ": line 2: tag 'S1' needs the receiver it hangs by, or its place x,y"),
        ("sync", SYNC + "S1,BS1,3,\n", ": line 2: y must be a number, got ''"),
        ("sync", SYNC + ",BS1,3,4\n", ": line 2: tag must not be empty"),
        ("sync", SYNC + "S1,BS1,3,4\nS1,BS2,3,4\n", ": line 3: tag 'S1' is given twice; remove one"),
        ("reference", STATIC, " holds no positions; give one row for each tag"),
        ("reference", TRACK, " holds no positions; give one row for each"),
        ("reference", "tag,t_unix_s,x,y\nA,1,2,3\n", ": line 1 names both tag and t_unix_s; give the track of one tag"),
        ("reference", "t_unix_s,lon,lat\n1,2,3\n", ": line 1 must name the columns t_unix_s,x,y, got t_unix_s,lon,lat"),
        ("reference", STATIC + "A,1,2\nA,1,2\n", ": line 3: tag 'A' is given twice; remove one"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(file, kind, content, says):
    path = file(content)
    with pytest.raises(ValueError) as caught:
        READERS[kind](path)
    message = str(caught.value)
    assert message.startswith(str(path)) and message.isprintable() and says in message


@pytest.mark.parametrize("kind", READERS)
def test_a_missing_file_is_named(tmp_path, kind):
    with pytest.raises(FileNotFoundError, match=f"no {kind}.* file .*none.csv; give a csv with columns"):
        READERS[kind](tmp_path / "none.csv")


FIELDS = ["receiver", "tag", "x", "y", "t_unix_s", ",", "\n", '"', "1", "2.5", "nan", "", "BS1", "\0", "\udcff"]


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    head=st.sampled_from([RECEIVERS, SYNC, STATIC, TRACK, ""]),
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
