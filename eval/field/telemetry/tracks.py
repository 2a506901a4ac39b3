"""Tracks of tagged animals as csv files, in the plane or in longitude and latitude, and as Movebank takes them."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tagtrack.envs.csv_table import name_cell, open_csv
from tagtrack.envs.motions.tracks import Track, collect_tracks
from tagtrack.eval.field.static_array.detections import Floats
from tagtrack.eval.field.telemetry.detections import replace_csv
from tagtrack.live.plane import Plane, position_columns

MOVEBANK_COLUMNS = (
    "timestamp",
    "location-long",
    "location-lat",
    "sensor-type",
    "individual-local-identifier",
    "tag-local-identifier",
)
_SENSOR = "acoustic telemetry"  # Movebank Attribute Dictionary, sensor type (MVB000170)


@dataclass(frozen=True, kw_only=True)
class TrackFile:
    """Tracks by tag, and the plane they lie in: None where a file gave x and y without saying of what."""

    of: dict[str, Track]
    plane: Plane | None = None


def read_tracks(path: str | Path, plane: Plane | None = None) -> TrackFile:
    """Tracks of one or many animals, tags in order of first appearance.

    Args:
        path: csv, plain or gzip, with columns ``t_unix_s`` and ``x,y`` [m] or ``lon,lat`` or ``longitude,latitude``
            [degrees, WGS84], and ``tag`` where it holds several animals; without it the file's name is the tag. Rows of
            several tags may be mixed. Gaps are no mistake.
        plane: where longitude and latitude become metres, by default about their mean; x and y stay as they are.
    Raises:
        ValueError: for missing columns, no rows, values that are no finite numbers, times of a tag that do not rise;
            names file and line. Or for a place too far from the plane's origin.
        ImportError: for longitude and latitude without pymap3d.
        FileNotFoundError: where there is no such file.
    """
    path = Path(path)
    with open_csv(path, "track", ("tag", "t_unix_s", "x", "y")) as table:
        axes = position_columns(table.columns)
        tracks = collect_tracks(table, axes)
    if not tracks:
        raise ValueError(f"{path} holds no positions; give one row for each")
    if axes != ("x", "y"):
        try:
            plane = plane or Plane.amid(np.concatenate([track.position for track in tracks]))
            tracks = tuple(replace(track, position=plane.to_plane(track.position)) for track in tracks)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    else:
        plane = None
    name = path.name.split(".")[0] or path.name
    return TrackFile(of={track.tag or name: track for track in tracks}, plane=plane)


def write_tracks(
    path: str | Path,
    tracks: Mapping[str, Track],
    plane: Plane | None = None,
    covariance: Mapping[str, Floats] | None = None,
    height: Mapping[str, Floats | None] | None = None,
) -> None:
    """Write a csv as ``read_tracks`` takes it, gzip if the name ends in ``.gz``: one row for each finite position.

    Args:
        plane: if given, the file tells longitude and latitude instead of x and y.
        covariance: by tag, (K, n, n) of the positions [m^2], for columns ``sd_x,sd_y,cov_xy``.
        height: by tag, (K,) z [m], for a column ``z``; where covariances have a third axis also ``sd_z,cov_xz,cov_yz``, else 0.
    Raises:
        ValueError: for a position too far from the plane's origin. OSError: if it cannot be written; an old file then stays.
    """
    with replace_csv(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        spread = [*(["sd_x", "sd_y", "cov_xy"] if covariance else []), *(["z"] if height else [])]
        spread += ["sd_z", "cov_xz", "cov_yz"] if covariance and height else []
        writer.writerow(("tag", "t_unix_s", *(("lon", "lat") if plane else ("x", "y")), *spread))
        for tag, time, position in _fixes(tracks):
            place = plane.to_geodetic(position) if plane else position
            columns = [time, *place.T]
            known = np.isfinite(tracks[tag].position).all(axis=1)
            if covariance:
                own = covariance[tag][known]
                columns += [np.sqrt(own[:, 0, 0]).round(4), np.sqrt(own[:, 1, 1]).round(4), own[:, 0, 1].round(5)]
            z = height[tag] if height else None
            if z is not None:
                columns.append(z[known].round(4))
                columns += _depth_spread(covariance[tag][known]) if covariance else []
            writer.writerows((name_cell(tag), *row) for row in zip(*(column.tolist() for column in columns), strict=True))


def _depth_spread(covariance: Floats) -> list[Floats]:
    """sd_z, cov_xz and cov_yz of covariances (K, n, n); 0 in the plane, where depths are given."""
    if covariance.shape[1] < 3:
        return [np.zeros(len(covariance))] * 3
    return [np.sqrt(covariance[:, 2, 2]).round(4), covariance[:, 0, 2].round(5), covariance[:, 1, 2].round(5)]


def write_movebank(
    path: str | Path, tracks: Mapping[str, Track], plane: Plane, individuals: Mapping[str, str] | None = None
) -> None:
    """Write a csv for Movebank's "other location data": its names of attributes, UTC to the millisecond, degrees to 1e-8 (1 mm).

    Args:
        tracks: by tag, in metres east and north of the plane's origin; UTM coordinates are not.
        individuals: the animal's name by tag; by default the tag.
    Raises:
        ValueError: for a position too far from the plane's origin. OSError: if it cannot be written; an old file then stays.
    """
    with replace_csv(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(MOVEBANK_COLUMNS)
        for tag, time, position in _fixes(tracks):
            individual = (individuals or {}).get(tag, tag)
            stamp = np.round(time * 1e3).astype(np.int64).astype("datetime64[ms]")
            for when, (longitude, latitude) in zip(np.datetime_as_string(stamp), plane.to_geodetic(position), strict=True):
                place = f"{longitude:.8f}", f"{latitude:.8f}"
                writer.writerow((when.replace("T", " "), *place, _SENSOR, name_cell(individual), name_cell(tag)))


def _fixes(tracks: Mapping[str, Track]) -> Iterator[tuple[str, Floats, Floats]]:
    """Tag, times and positions without those that are not known."""
    for tag, track in tracks.items():
        known = np.isfinite(track.position).all(axis=1)
        yield tag, track.time[known], track.position[known]
