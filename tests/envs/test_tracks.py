"""Reading recorded tracks: what a file must be, and one line that names file and place where it is not."""

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tagtrack.envs.motions.tracks import Track, read_tracks, split_tracks

GOOD = "t_unix_s,x,y\n100,0,0\n101,1,0\n103,1,2\n"


@pytest.fixture
def refusal(tmp_path):
    """The message with which ``read_tracks`` refuses a file: one line that begins with the file's path."""

    def message_of(content):
        path = tmp_path / "track.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with pytest.raises(ValueError) as caught:
            read_tracks(path)
        message = str(caught.value)
        assert message.startswith(f"{path}: ")
        assert "\n" not in message
        assert "\r" not in message
        return message[len(f"{path}: ") :]

    return message_of


def test_a_good_file_is_read_as_it_stands(tmp_path):
    (tmp_path / "track.csv").write_text(GOOD)
    (track,) = read_tracks(tmp_path / "track.csv")
    np.testing.assert_array_equal(track.time, [100.0, 101.0, 103.0])
    np.testing.assert_array_equal(track.position, [[0, 0], [1, 0], [1, 2]])


def test_columns_may_stand_in_any_order_among_others(tmp_path):
    (tmp_path / "track.csv").write_text("depth,y,t_unix_s,x\n9,2,0,1\n9,4,1,3\n")
    (track,) = read_tracks(str(tmp_path / "track.csv"))
    np.testing.assert_array_equal(track.position, [[1, 2], [3, 4]])


def test_line_ends_of_other_systems_and_a_missing_last_one_are_read(tmp_path):
    (tmp_path / "track.csv").write_bytes(GOOD.rstrip("\n").replace("\n", "\r\n").encode())
    assert read_tracks(tmp_path / "track.csv")[0].time.size == 3


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "line 1 must name the columns t_unix_s,x,y"),
        ("\n\n", "line 1 must name the columns t_unix_s,x,y"),
        ("t_unix_s,x\n1,2\n2,3\n", "line 1 must name the columns t_unix_s,x,y, got t_unix_s,x"),
        ("1,2,3\n2,3,4\n", "line 1 must name the columns t_unix_s,x,y, got 1,2,3"),
        ("T_UNIX_S,X,Y\n1,2,3\n2,3,4\n", "line 1 must name the columns"),
        ("t_unix_s;x;y\n1;2;3\n2;3;4\n", "line 1 must name the columns"),
        ("t_unix_s,x,y\n", "at least two rows, got 0"),
        ("t_unix_s,x,y\n1,2,3\n", "at least two rows, got 1"),
        ("t_unix_s,x,y\n1,2,3\n2,nan,3\n", "line 3: x must be finite, got 'nan'"),
        ("t_unix_s,x,y\n1,2,3\n2,3,inf\n", "line 3: y must be finite, got 'inf'"),
        ("t_unix_s,x,y\nnan,2,3\n2,3,4\n", "line 2: t_unix_s must be finite, got 'nan'"),
        ("t_unix_s,x,y\n1,2,3\n2,,3\n", "line 3: x must be a number, got ''"),
        ("t_unix_s,x,y\n1,2,3\n2,3\n", "line 3: expected 3 fields as in line 1, got 2"),
        ("t_unix_s,x,y\n1,2,3\n2,east,3\n", "line 3: x must be a number, got 'east'"),
        ("t_unix_s,x,y\n1,2,3\n3,2,3\n2,2,3\n", "line 4: times must rise, got 2.000 after 3.000; sort the file, and tell"),
        ("t_unix_s,x,y\n1,2,3\n1,2,3\n", "line 3: times must rise, got 1.000 after 1.000"),
        ("tag,t_unix_s,x,y\na,1,2,3\nb,1,2,3\na,1,2,3\n", "line 4: times must rise, got 1.000 after 1.000"),
        ("tag,t_unix_s,x,y\na,1,2,3\n ,2,2,3\n", "line 3: tag must not be empty"),
        ("t_unix_s,x,y,tag\n1,2,3,a\n2,2,3\n", "line 3: expected 4 fields as in line 1, got 3"),
        ("a poem\nabout the sea,\nin three lines\n", "line 1 must name the columns"),
        (GOOD.encode("utf-16"), "not a csv text file"),
        (b"t_unix_s,x,y\n1,2,3\n2,\xff\xfe,3\n", r"line 3: x must be a number, got '\udcff\udcfe'"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", r"line 1 must name the columns t_unix_s,x,y, got '\udc89PNG'"),
        ("t_unix_s,x,y\n1,2," + "9" * 200_000 + "\n", "not a csv text file"),
    ],
)
def test_a_bad_file_gives_one_line_with_file_place_and_value(refusal, content, says):
    assert says in refusal(content)


def test_interleaved_animals_are_told_apart_by_their_tags(tmp_path):
    rows = "tag,t_unix_s,x,y\nb,0,1,2\n 7 ,5,3,4\nb,1,5,6\n7,6,7,8\nb,9000,9,9\n"
    (tmp_path / "track.csv").write_text(rows)
    first, other = read_tracks(tmp_path / "track.csv")
    assert (first.tag, other.tag) == ("b", "7")
    np.testing.assert_array_equal(first.time, [0, 1, 9000])
    np.testing.assert_array_equal(first.position, [[1, 2], [5, 6], [9, 9]])
    np.testing.assert_array_equal(other.position, [[3, 4], [7, 8]])


@pytest.mark.parametrize("name", ["missing.csv", "."])
def test_a_path_without_a_file_is_named(tmp_path, name):
    with pytest.raises(FileNotFoundError, match=r"no track file .*; give a csv with columns t_unix_s,x,y"):
        read_tracks(tmp_path / name)


def assert_read_or_refused(path):
    """Whatever the file holds: tracks with finite, rising rows, or a ValueError of one line that names the file."""
    try:
        tracks = read_tracks(path)
    except ValueError as error:
        assert str(error).startswith(str(path))
        assert len(str(error).splitlines()) == 1
        return
    assert sum(track.time.size for track in tracks) >= 2
    for track in tracks:
        assert track.time.size == len(track.position)
        assert np.isfinite(track.position).all()
        assert np.all(np.diff(track.time) > 0)


fuzz = settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@fuzz
@given(content=st.binary(max_size=300))
@example(content=b"t_unix_s,x,y\r1,2,3\r2,3,4")
@example(content=b"t_unix_s,x,y\n\x00,1,2\n")
@example(content=b't_unix_s,x,y\n"1\n",2,3\n2,"3')
def test_random_bytes_are_read_or_refused(tmp_path, content):
    (tmp_path / "fuzz.csv").write_bytes(content)
    assert_read_or_refused(tmp_path / "fuzz.csv")


@fuzz
@given(content=st.binary(max_size=200))
def test_random_bytes_under_a_good_header_are_read_or_refused(tmp_path, content):
    (tmp_path / "fuzz.csv").write_bytes(b"t_unix_s,x,y\n1,2,3\n" + content)
    assert_read_or_refused(tmp_path / "fuzz.csv")


cells = st.one_of(
    st.floats(width=64).map(repr), st.integers(-5, 500).map(str), st.sampled_from(["", "1e400", "1_0", "0x1", '"', " 3 "])
)


@fuzz
@given(rows=st.lists(st.lists(cells, max_size=5).map(",".join), max_size=8))
def test_random_cells_are_read_or_refused(tmp_path, rows):
    for header in ("t_unix_s,x,y", "tag,t_unix_s,x,y"):
        (tmp_path / "fuzz.csv").write_text(header + "\n" + "\n".join(rows))
        assert_read_or_refused(tmp_path / "fuzz.csv")


def test_the_real_track_has_its_201_rows_and_a_boats_speed(tagtrack_data):
    """Counted and added up without the reader: 201 fixes in 1,655 s along 1,170.03 m, 0.707 m/s in the mean."""
    (track,) = read_tracks(tagtrack_data / "ssu1" / "gps_track.csv")
    steps = np.hypot(*np.diff(track.position, axis=0).T)
    assert track.time.size == 201
    assert track.time[-1] - track.time[0] == 1655.0
    assert steps.sum() == pytest.approx(1170.033, abs=1e-3)
    assert steps.sum() / (track.time[-1] - track.time[0]) == pytest.approx(0.70697, abs=1e-5)
    assert track.time[0] == 1568052138
    np.testing.assert_array_equal(track.position[0], [526073.267, 2771146.771])


def herd(tags):
    return [Track(time=np.array([0.0, 1.0]), position=np.zeros((2, 2)), tag=tag) for tag in tags]


def tags_of(part):
    return [track.tag for track in part]


some_tags = st.lists(st.text(max_size=8), min_size=2, max_size=40, unique=True)


@given(tags=some_tags, held_out=st.floats(0.01, 0.99), seed=st.integers())
def test_split_parts_every_animal_once_and_leaves_neither_part_empty(tags, held_out, seed):
    training, rest = split_tracks(herd(tags), held_out, seed)
    assert sorted(tags_of(training) + tags_of(rest)) == sorted(tags)
    assert tags_of(training) == [tag for tag in tags if tag in tags_of(training)]  # in the given order
    assert 1 <= len(rest) <= len(tags) - 1
    assert abs(len(rest) - held_out * len(tags)) <= 1.0
    shuffled = split_tracks(herd(reversed(tags)), held_out, seed)[1]
    assert set(tags_of(shuffled)) == set(tags_of(rest))


def test_split_is_the_same_for_ever_and_another_with_another_seed():
    """SHA-256 of "0:65001" ... "0:65008" computed apart, with sha256sum: the two lowest of eight digests are held out."""
    tags = [str(65001 + index) for index in range(8)]
    assert tags_of(split_tracks(herd(tags))[1]) == ["65002", "65007"]
    assert tags_of(split_tracks(herd(tags), seed=1)[1]) != ["65002", "65007"]


@pytest.mark.parametrize(
    ("tags", "held_out", "says"),
    [
        (["a", "b"], 0.0, "held_out must be a share between 0 and 1, got 0.0"),
        (["a", "b"], float("nan"), "held_out must be a share between 0 and 1, got nan"),
        (["a"], 0.25, "two animals or more to hold one out, got 1"),
        ([], 0.25, "two animals or more to hold one out, got 0"),
        (["a", "b", "a"], 0.25, "each animal must come once, got 2 tracks of tag 'a'"),
    ],
)
def test_what_cannot_be_split_is_refused(tags, held_out, says):
    with pytest.raises(ValueError, match=says):
        split_tracks(herd(tags), held_out)
