"""Tracks of tagged animals: read, laid into a plane, and written for ourselves and for Movebank."""

import csv
import math
import sys

import numpy as np
import pytest

from tagtrack.envs.motions.tracks import Track
from tagtrack.eval.field.telemetry import Plane, read_tracks, write_movebank, write_tracks

AXIS, FLATTENING = 6378137.0, 1 / 298.257223563  # WGS84
SQUARE = FLATTENING * (2 - FLATTENING)  # its eccentricity, squared
BAY = Plane(longitude=-80.9, latitude=25.1)


def earth_centred(longitude, latitude):
    """A place on the ellipsoid (3,) [m], by the textbook formula."""
    lon, lat = math.radians(longitude), math.radians(latitude)
    radius = AXIS / math.sqrt(1 - SQUARE * math.sin(lat) ** 2)
    shadow = radius * math.cos(lat)
    return np.array([shadow * math.cos(lon), shadow * math.sin(lon), radius * (1 - SQUARE) * math.sin(lat)])


def test_tracks_of_many_tags_may_be_mixed_and_keep_their_order_of_appearance(tmp_path):
    (tmp_path / "t.csv").write_text("y,x,t_unix_s,tag\n2,1,10,b\n6,5,5,a\n4,3,999,b\n")
    tracks = read_tracks(tmp_path / "t.csv")
    assert list(tracks.of) == ["b", "a"] and tracks.plane is None
    assert tracks.of["b"].time.tolist() == [10, 999] and tracks.of["b"].position.tolist() == [[1, 2], [3, 4]]


def test_without_a_column_of_tags_the_file_names_the_tag(tmp_path):
    (tmp_path / "lobster.csv").write_text("t_unix_s,x,y\n10,1,2\n")
    assert list(read_tracks(tmp_path / "lobster.csv").of) == ["lobster"]


@pytest.mark.parametrize("names", ["lon,lat", "longitude,latitude"])
def test_degrees_become_metres_about_their_mean_as_chords_through_the_earth_tell(tmp_path, names):
    places = [(-80.90, 25.10), (-80.89, 25.10), (-80.90, 25.11), (-80.89, 25.11)]
    rows = "".join(f"{time},{lon},{lat}\n" for time, (lon, lat) in enumerate(places))
    (tmp_path / "t.csv").write_text(f"t_unix_s,{names}\n{rows}")
    tracks = read_tracks(tmp_path / "t.csv")
    assert tracks.plane is not None
    assert (tracks.plane.longitude, tracks.plane.latitude) == pytest.approx((-80.895, 25.105))
    (position,) = (track.position for track in tracks.of.values())
    for at in range(4):
        for other in range(at):
            chord = np.linalg.norm(earth_centred(*places[at]) - earth_centred(*places[other]))
            assert np.linalg.norm(position[at] - position[other]) == pytest.approx(chord, abs=1e-3)  # the four lie in a plane
    assert position[1, 0] > position[0, 0] + 1000 and position[2, 1] > position[0, 1] + 1000  # x is east, y is north


def test_a_plane_on_the_equator_has_the_radii_of_the_ellipsoid():
    small = 1e-5
    position = Plane(longitude=10.0, latitude=0.0).to_plane(np.array([[10.0 + small, 0.0], [10.0, small]]))
    east, north = AXIS * math.radians(small), AXIS * (1 - SQUARE) * math.radians(small)
    np.testing.assert_allclose(position, [[east, 0], [0, north]], rtol=1e-6, atol=1e-8)


def test_the_mean_of_places_on_both_sides_of_the_date_line_lies_between_them():
    plane = Plane.amid(np.array([[179.9, -17.0], [-179.7, -17.2]]))
    assert abs(plane.longitude) == pytest.approx(179.9) and plane.longitude < 0
    assert plane.latitude == pytest.approx(-17.1)


def test_there_and_back_ends_where_it_began_even_far_from_the_origin():
    position = np.random.default_rng(1).uniform(-7e4, 7e4, (200, 2))
    np.testing.assert_allclose(BAY.to_plane(BAY.to_geodetic(position)), position, rtol=0, atol=1e-5)


def test_written_tracks_are_read_as_they_were_without_what_is_not_known(tmp_path):
    track = Track(1.5e9 + np.array([0.1, 0.2, 0.3]), np.array([[1 / 3, 2.0], [np.nan, np.nan], [4651491.781, -5.5]]))
    for name in ("a.csv", "a.csv.gz"):
        write_tracks(tmp_path / name, {"A,1": track, "B": track})
        read = read_tracks(tmp_path / name).of
        assert list(read) == ["A,1", "B"]
        np.testing.assert_array_equal(read["B"].time, track.time[[0, 2]])
        np.testing.assert_array_equal(read["B"].position, track.position[[0, 2]])


def test_tracks_written_in_degrees_come_back_to_the_same_metres(tmp_path):
    track = Track(np.array([1.5, 2.5]), np.array([[120.0, -340.0], [5000.0, 250.0]]))
    write_tracks(tmp_path / "a.csv", {"A": track}, BAY)
    assert (tmp_path / "a.csv").read_text().startswith("tag,t_unix_s,lon,lat\nA,1.5,-80.89")
    np.testing.assert_allclose(read_tracks(tmp_path / "a.csv", BAY).of["A"].position, track.position, atol=1e-6)


def test_movebank_gets_its_attributes_utc_to_the_millisecond_and_degrees_to_a_millimetre(tmp_path):
    position = np.array([[0.0, 0.0], [np.nan, 1.0], [1234.5, -678.9]])
    track = Track(np.array([1568045052.574, 1568045053.0, 1568045164.1416]), position)
    write_movebank(tmp_path / "m.csv", {"A69-1602-59336": track}, BAY, {"A69-1602-59336": "Norma"})
    with (tmp_path / "m.csv").open(newline="") as file:
        first, second = csv.DictReader(file)
    assert first == {
        "timestamp": "2019-09-09 16:04:12.574",
        "location-long": "-80.90000000",
        "location-lat": "25.10000000",
        "sensor-type": "acoustic telemetry",
        "individual-local-identifier": "Norma",
        "tag-local-identifier": "A69-1602-59336",
    }
    assert second["timestamp"] == "2019-09-09 16:06:04.142"
    place = np.array([[float(second["location-long"]), float(second["location-lat"])]])
    np.testing.assert_allclose(BAY.to_plane(place), position[2:], atol=1e-3)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", ": line 1 must name the columns t_unix_s,x,y, got nothing"),
        ("tag,t_unix_s,lon\na,1,2\n", ": line 1 must name the columns tag,t_unix_s,x,y, got tag,t_unix_s,lon"),
        ("t_unix_s,x,y\n", " holds no positions; give one row for each"),
        ("tag,t_unix_s,x,y\na,1,2,3\nb,1,2,3\na,1,2,3\n", ": line 4: times must rise, got 1.000 after 1.000"),
        ("tag,t_unix_s,x,y\n,1,2,3\n", ": line 2: tag must not be empty"),
        ("t_unix_s,x,y\n1,nan,3\n", ": line 2: x must be finite, got 'nan'"),
        ("t_unix_s,lon,lat\n1,25.1,-91\n", ": longitude must be within +-360 and latitude within +-90 degrees, got 25.1 and -91"),
        ("t_unix_s,lon,lat\n1,0,0\n2,0,3\n", "km from the origin 0, 1.5 (at most 100 km); choose an origin nearby"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(tmp_path, content, says):
    (tmp_path / "t.csv").write_text(content)
    with pytest.raises(ValueError) as caught:
        read_tracks(tmp_path / "t.csv")
    assert str(caught.value).startswith(str(tmp_path / "t.csv")) and says in str(caught.value)


def test_coordinates_of_another_plane_are_refused_and_the_old_file_stays(tmp_path):
    (tmp_path / "m.csv").write_text("old")
    with pytest.raises(ValueError, match="position 526073, 2771147 m is beyond 100 km; give metres east and north of the origin"):
        write_movebank(tmp_path / "m.csv", {"a": Track(np.zeros(1), np.array([[526073.0, 2771147.0]]))}, BAY)
    assert [path.name for path in tmp_path.iterdir()] == ["m.csv"] and (tmp_path / "m.csv").read_text() == "old"


def test_without_pymap3d_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymap3d", None)
    with pytest.raises(ImportError, match=r'pip install "tagtrack\[geo\]"'):
        BAY.to_plane(np.zeros((1, 2)))
