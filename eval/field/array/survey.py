"""`tagtrack eval array survey`: places of moored receivers from the sound between them (Masmitja et al. 2020, Fig. 4G)."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from tagtrack.envs.csv_table import name_cell
from tagtrack.eval.field.array.reading import describe_plane, read_aloud, read_places
from tagtrack.eval.field.array.survey_plot import plot_map
from tagtrack.eval.field.static_array.detections import shorten
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.static_array.places import Places, Placing, place_freely, place_on, places_from_distances
from tagtrack.eval.field.static_array.survey import Baseline, OneWay, survey_distances, survey_receivers
from tagtrack.eval.field.telemetry import Plane, read_own_tags
from tagtrack.eval.plots import save_figure
from tagtrack.eval.report import as_console_table, show, write_json, write_text
from tagtrack.eval.results_folder import replace_results, require_replaceable
from tagtrack.eval.versions import collect_versions

PLANE, DEGREES = ("x", "y"), ("lon", "lat")  # columns of places: degrees where those of the reference are
OWN_FILES = ("distances.csv", "receivers.csv", "survey.json", "map.png")


@dataclass(frozen=True, kw_only=True)
class Survey:
    """Measure the distances between receivers that carry sync tags, and place the receivers by them.

    Takes detections on corrected clocks (of `array sync`), of receivers that log the pings of the tags beside them. Writes
    distances.csv, receivers.csv (as other commands take it), survey.json and map.png. With --reference in degrees
    receivers.csv is in degrees, too.
    """

    detections: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE ...")]
    """Files of detections: csv with columns t_unix_s,receiver,tag, or exports of VUE, Fathom, GLATOS, OTN ..."""
    sync_tags: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """csv with columns tag,receiver: the receiver that a sync tag hangs beside; if several hang beside one, all are used."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder to write; earlier results of this command are replaced."""
    reference: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(first receiver at 0, 0)")] = None
    """csv with columns receiver,x,y [m] or receiver,lon,lat [degrees] of places to turn and move the receivers onto."""
    sound_speed: float = 1500.0
    """Speed of sound [m/s]."""
    layout: Annotated[str | None, tyro.conf.arg(metavar="MODULE:FUNCTION", help_behavior_hint="(recognized)")] = None
    """A reader of your own kind of files, as `array locate` takes it."""

    def run(self) -> None:
        """Run it."""
        if not (np.isfinite(self.sound_speed) and self.sound_speed > 0):
            raise ValueError(f"--sound-speed must be positive, got {self.sound_speed}")
        require_replaceable(self.out, OWN_FILES, "survey")
        own_tags = read_own_tags(self.sync_tags)
        known, plane = read_places(self.reference)
        reference = known or None
        baselines = survey_distances(read_aloud(self.detections, self.layout), own_tags, self.sound_speed)
        names = survey_receivers(baselines)
        pairs = [[names.index(name) for name in baseline.receivers] for baseline in baselines]
        distances = [line.distance for line in baselines], [line.sd for line in baselines]
        rough = None
        if reference is not None and set(names) <= set(reference):
            rough = np.array([reference[name] for name in names])
        elif len(baselines) == 2 * len(names) - 3:
            print("note: no distance to spare, so a receiver may lie on the wrong side of others; --reference tells")
        shape = places_from_distances(pairs, *distances, rough)
        placing = choose_placing(shape, names, reference)
        places = placing.place(shape)
        document = {
            "detections_files": [str(path) for path in self.detections],
            "sync_tags_file": str(self.sync_tags),
            "reference_file": None if self.reference is None else str(self.reference),
            **survey_document(baselines, names, places, placing, reference, plane),
            "sound_speed_m_s": self.sound_speed,
            "versions": collect_versions(),
        }
        print_survey(document, plane)
        with replace_results(self.out, OWN_FILES) as folder:
            write_text(folder / "distances.csv", as_csv(document["distances"]))
            columns = ("receiver", *(DEGREES if plane else PLANE), "sd_x", "sd_y")
            write_text(folder / "receivers.csv", as_csv([{key: row[key] for key in columns} for row in document["receivers"]]))
            write_json(folder / "survey.json", document)
            save_figure(folder / "map.png", plot_map(document))
        print(f"written: {self.out}")


def choose_placing(shape: Places, names: Sequence[str], reference: Mapping[str, Floats] | None) -> Placing:
    """Onto the reference places, or the first receiver at the origin."""
    if reference is None:
        return place_freely(shape.position)
    shared = [index for index, name in enumerate(names) if name in reference]
    if len(shared) < 2:
        raise ValueError(f"--reference must hold two of {shorten(tuple(names))}; it holds {shorten(tuple(reference))}")
    return place_on(shape.position[shared], np.array([reference[names[index]] for index in shared]))


def survey_document(
    baselines: Sequence[Baseline],
    names: Sequence[str],
    places: Places,
    placing: Placing,
    reference: Mapping[str, Floats] | None,
    plane: Plane | None = None,
) -> dict[str, Any]:
    """What survey.json holds: distances, places, and how they were placed; null where there is no figure."""
    receivers = []
    for name, (x, y), (sd_x, sd_y) in zip(names, places.position.tolist(), places.sd.tolist(), strict=True):
        target = None if reference is None or name not in reference else reference[name].tolist()
        off = None if target is None else float(np.hypot(x - target[0], y - target[1]))
        receivers.append(
            {"receiver": name, "x": x, "y": y, "sd_x": sd_x, "sd_y": sd_y, "reference": target, "from_reference_m": off}
        )
    if plane:
        for row, degrees in zip(receivers, plane.to_geodetic(places.position).tolist(), strict=True):
            row.update(zip(DEGREES, degrees, strict=True))
    distances = [
        {
            "first": line.receivers[0],
            "second": line.receivers[1],
            "distance_m": line.distance,
            "sd_m": _number(line.sd),
            "asymmetry_m": _number(line.asymmetry),
            "clock_offset_s": _number(line.clock_offset),
            "fit_residual_m": float(residual),
            **_way("there", line.there),
            **_way("back", line.back),
        }
        for line, residual in zip(baselines, places.residual, strict=True)
    ]
    turned = float(np.degrees(np.arctan2(placing.rotation[1, 0], placing.rotation[0, 0])))
    mirrored = bool(np.linalg.det(placing.rotation) < 0)
    origin = {"origin": plane.origin} if plane else {}
    return {"distances": distances, "receivers": receivers, "turned_deg": turned, "mirrored": mirrored, **origin}


def _way(name: str, way: OneWay) -> dict[str, float | int | None]:
    return {f"{name}_s": _number(way.seconds), f"{name}_pings": way.pings, f"{name}_outliers": way.outliers}


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows with the same columns as csv; None is an empty field."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: name_cell(cell) if isinstance(cell, str) else cell for key, cell in row.items()} for row in rows)
    return text.getvalue()


def print_survey(document: Mapping[str, Any], plane: Plane | None = None) -> None:
    """Distances, and places."""

    def cell(value: float | None) -> str:
        return "-" if value is None else f"{value:.2f}"

    rows = [
        [
            f"{line['first']} - {line['second']}",
            cell(line["distance_m"]),
            cell(line["sd_m"]),
            cell(line["asymmetry_m"]),
            cell(line["fit_residual_m"]),
            f"{line['there_pings']} + {line['back_pings']}",
            str(line["there_outliers"] + line["back_outliers"]),
        ]
        for line in document["distances"]
    ]
    header = ["receivers", "distance [m]", "sd [m]", "there less back [m]", "residual [m]", "pings", "outliers"]
    note = "Residual: measured distance less that of the places. sd without the error of the sound speed."
    show(as_console_table(header, rows, note))
    figures = ("x", "y", "sd_x", "sd_y", "from_reference_m")
    rows = [[line["receiver"], *(cell(line[figure]) for figure in figures)] for line in document["receivers"]]
    note = "sd of the shape alone: where it lies and how it is turned is taken from the reference places, with their errors"
    note += describe_plane(plane) + "."
    show(as_console_table(["receiver", "x [m]", "y [m]", "sd x [m]", "sd y [m]", "from reference [m]"], rows, note))
