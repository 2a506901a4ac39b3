"""Reading recorded tracks: what a file must be, and one line that names file and place where it is not."""

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tagtrack.envs.sim.tracks import LONGEST_GAP, Track, read_track, resample_track

GOOD = "t_unix_s,x,y\n100,0,0\n101,1,0\n103,1,2\n"


@pytest.fixture
def refusal(tmp_path):
    """The message with which ``read_track`` refuses a file: one line that begins with the file's path."""

    def message_of(content):
        path = tmp_path / "track.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with pytest.raises(ValueError) as caught:
            read_track(path)
        message = str(caught.value)
        assert message.startswith(f"{path}: ")
        assert "\n" not in message
        assert "\r" not in message
        return message[len(f"{path}: ") :]

    return message_of


def test_a_good_file_is_read_as_it_stands(tmp_path):
    (tmp_path / "track.csv").write_text(GOOD)
    track = read_track(tmp_path / "track.csv")
    np.testing.assert_array_equal(track.time, [100.0, 101.0, 103.0])
    np.testing.assert_array_equal(track.position, [[0, 0], [1, 0], [1, 2]])


def test_columns_may_stand_in_any_order_among_others(tmp_path):
    (tmp_path / "track.csv").write_text("depth,y,t_unix_s,x\n9,2,0,1\n9,4,1,3\n")
    track = read_track(str(tmp_path / "track.csv"))
    np.testing.assert_array_equal(track.position, [[1, 2], [3, 4]])


def test_line_ends_of_other_systems_and_a_missing_last_one_are_read(tmp_path):
    (tmp_path / "track.csv").write_bytes(GOOD.rstrip("\n").replace("\n", "\r\n").encode())
    assert read_track(tmp_path / "track.csv").time.size == 3


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
        ("t_unix_s,x,y\n1,2,3\n3,2,3\n2,2,3\n", "line 4: times must rise, got 2.000 after 3.000; sort the file"),
        ("t_unix_s,x,y\n1,2,3\n1,2,3\n", "line 3: times must rise, got 1.000 after 1.000"),
        ("t_unix_s,x,y\n0,2,3\n121,2,3\n", "line 3: a gap of 121 s (at most 120 s); split the file there"),
        ("a poem\nabout the sea,\nin three lines\n", "line 1 must name the columns"),
        (GOOD.encode("utf-16"), "not a csv text file"),
        (b"t_unix_s,x,y\n1,2,3\n2,\xff\xfe,3\n", r"line 3: x must be a number, got '\udcff\udcfe'"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", r"line 1 must name the columns t_unix_s,x,y, got '\udc89PNG'"),
        ("t_unix_s,x,y\n1,2," + "9" * 200_000 + "\n", "not a csv text file"),
    ],
)
def test_a_bad_file_gives_one_line_with_file_place_and_value(refusal, content, says):
    assert says in refusal(content)


def test_a_gap_just_within_the_limit_is_read(tmp_path):
    (tmp_path / "track.csv").write_text(f"t_unix_s,x,y\n0,0,0\n{LONGEST_GAP},1,1\n")
    assert read_track(tmp_path / "track.csv").time[-1] == LONGEST_GAP


@pytest.mark.parametrize("name", ["missing.csv", "."])
def test_a_path_without_a_file_is_named(tmp_path, name):
    with pytest.raises(FileNotFoundError, match=r"no track file .*; give a csv with columns t_unix_s,x,y"):
        read_track(tmp_path / name)


def assert_read_or_refused(path):
    """Whatever the file holds: a track with finite, rising rows, or a ValueError of one line that names the file."""
    try:
        track = read_track(path)
    except ValueError as error:
        assert str(error).startswith(str(path))
        assert len(str(error).splitlines()) == 1
        return
    assert track.time.size == len(track.position) >= 2
    assert np.isfinite(track.position).all()
    assert np.all(np.diff(track.time) > 0)
    assert np.diff(track.time).max() <= LONGEST_GAP


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
    (tmp_path / "fuzz.csv").write_text("t_unix_s,x,y\n" + "\n".join(rows))
    assert_read_or_refused(tmp_path / "fuzz.csv")


def test_resampling_walks_the_straight_lines_between_rows():
    track = Track(time=np.array([10.0, 14.0, 16.0]), position=np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 6.0]]))
    table = resample_track(track, time_step=1.0, time_scale=1.0, episode_steps=3)
    np.testing.assert_allclose(table, [[0, 0], [1, 0], [2, 0], [3, 0], [4, 0], [4, 3], [4, 6]])


def test_half_the_time_scale_doubles_the_rows():
    track = Track(time=np.array([0.0, 4.0]), position=np.array([[0.0, 0.0], [4.0, 8.0]]))
    table = resample_track(track, time_step=1.0, time_scale=0.5, episode_steps=8)
    np.testing.assert_allclose(table, np.linspace([0, 0], [4, 8], 9))


@pytest.mark.parametrize("time_step", [0.1, 0.3, 1.0])
def test_last_row_of_the_file_is_reached_in_spite_of_rounding(time_step):
    """Thirty is a whole multiple of all three steps, but not of their binary forms."""
    track = Track(time=np.array([0.0, 30.0]), position=np.array([[0.0, 0.0], [30.0, 0.0]]))
    table = resample_track(track, time_step, time_scale=1.0, episode_steps=1)
    assert len(table) == round(30 / time_step) + 1
    assert table[-1, 0] == pytest.approx(30.0)


def test_the_real_track_has_its_201_rows_and_a_boats_speed(tagtrack_data):
    """Counted and added up without the reader: 201 fixes in 1,655 s along 1,170.03 m, 0.707 m/s in the mean."""
    track = read_track(tagtrack_data / "ssu1" / "gps_track.csv")
    steps = np.hypot(*np.diff(track.position, axis=0).T)
    assert track.time.size == 201
    assert track.time[-1] - track.time[0] == 1655.0
    assert steps.sum() == pytest.approx(1170.033, abs=1e-3)
    assert steps.sum() / (track.time[-1] - track.time[0]) == pytest.approx(0.70697, abs=1e-5)
    assert track.time[0] == 1568052138
    np.testing.assert_array_equal(track.position[0], [526073.267, 2771146.771])
