"""`tagtrack eval array sync`: clocks of moored receivers, and detections corrected by them (Masmitja et al. 2020, Fig. 4)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from tagtrack.eval.field.array.reading import fit_names, read_aloud, read_places
from tagtrack.eval.field.array.sync_plot import plot_residuals
from tagtrack.eval.field.static_array.clock_steps import synchronize_in_pieces, under_original_names
from tagtrack.eval.field.static_array.clocks import Synchronization, SyncSetting, correct, synchronize
from tagtrack.eval.field.static_array.detections import Detections
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.telemetry import read_sync_tags, write_detections
from tagtrack.eval.plots import save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, show, write_json
from tagtrack.eval.results_folder import replace_results, require_replaceable
from tagtrack.eval.versions import collect_versions

OWN_FILES = ("detections.csv.gz", "clocks.json", "residuals.png")
DAY = 86400.0
MANY_OUTLIERS = 0.1  # of the points of a clock


@dataclass(frozen=True, kw_only=True)
class Sync:
    """Correct the clocks of moored receivers by sync tags, tags that do not move.

    Needs no synchronized start: clocks may differ by minutes. Writes the detections of all tags on corrected clocks
    (detections.csv.gz), the clocks with what was left out of their fit (clocks.json), and a picture of the differences between
    clocks before, in between and after (residuals.png). All times are then on the clock of one receiver, the reference.
    """

    detections: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE ...")]
    """Files of detections on the receivers' own clocks: csv (t_unix_s,receiver,tag), exports of VUE, Fathom, GLATOS, OTN ..."""
    sync_tags: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """csv with columns tag,receiver,x,y: the receiver that a tag hangs beside, and its place [m] (or lon,lat); may be empty."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder to write; earlier results of this command are replaced."""
    receivers: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(unknown)")] = None
    """csv: receiver,x,y [m] or receiver,lon,lat [degrees]; without it, tags by receivers that hear each other tell offsets."""
    sound_speed: float = 1500.0
    """Speed of sound [m/s]."""
    degree: int = 3
    """Of the polynomials in time."""
    segment_days: Annotated[float | None, tyro.conf.arg(metavar="DAYS", help_behavior_hint="(as the data ask for)")] = None
    """Length of the segments that get a polynomial each, 7 for weeks, inf for one polynomial."""
    largest_offset: float = 600.0
    """Largest difference between two clocks that is looked for [s]; below half the interval of sync tags that ping regularly."""
    reference: Annotated[str | None, tyro.conf.arg(metavar="RECEIVER", help_behavior_hint="(the middle clock)")] = None
    """Receiver whose clock is the time; by default the middle one of those with a tag of their own."""
    layout: Annotated[str | None, tyro.conf.arg(metavar="MODULE:FUNCTION", help_behavior_hint="(recognized)")] = None
    """A reader of your own kind of files, as `array locate` takes it."""

    def run(self) -> None:
        """Run it."""
        if self.segment_days is not None and not self.segment_days > 0:
            raise ValueError(f"--segment-days must be positive, got {self.segment_days:g}")
        require_replaceable(self.out, OWN_FILES, "synchronization")
        setting = SyncSetting(
            sound_speed=self.sound_speed,
            degree=self.degree,
            segment=None if self.segment_days is None else self.segment_days * DAY,
            largest_offset=self.largest_offset,
        )
        places, plane = read_places(self.receivers)
        sync_tags = read_sync_tags(self.sync_tags, plane)
        detections = read_aloud(self.detections, self.layout)
        if self.receivers is not None:
            detections = fit_names(detections, tuple(places), self.receivers)
        pairs = len(detections.receivers) * (len(detections.receivers) - 1) // 2
        with progress_bar(pairs + 1, unit="pairs") as advance:

            def run(some: Detections, where: Mapping[str, Floats], setting: SyncSetting) -> Synchronization:
                return synchronize(some, sync_tags, where, setting, reference=self.reference, progress=advance)

            found, detections, steps = synchronize_in_pieces(detections, places, run, setting)
        document = {
            "detections_files": [str(path) for path in self.detections],
            "sync_tags_file": str(self.sync_tags),
            "receivers_file": None if self.receivers is None else str(self.receivers),
            "sound_speed_m_s": self.sound_speed,
            "degree": self.degree,
            "segment_days": found.segment / DAY if math.isfinite(found.segment) else None,
            "largest_offset_s": self.largest_offset,
            **sync_document(found, detections),
            "steps": [dataclasses.asdict(step) for step in steps],
            "versions": collect_versions(),
        }
        print_sync(document)
        with replace_results(self.out, OWN_FILES) as folder:
            corrected = under_original_names(correct(detections, found.models), steps)
            write_detections(folder / "detections.csv.gz", corrected)
            write_json(folder / "clocks.json", document)
            save_figure(folder / "residuals.png", plot_residuals(found))
        print(f"written: {self.out}")


def sync_document(found: Synchronization, detections: Detections) -> dict[str, Any]:
    """What clocks.json holds of a synchronization, and of the detections it corrects."""
    clocks = []
    for index, name in enumerate(detections.receivers):
        if name in found.models:
            time = detections.time[detections.receiver == index]
            model = found.models[name]
            ends = model.offset(model.limits[[0, -1]])
            change = {"first_offset_s": float(ends[0]), "last_offset_s": float(ends[1])}
            clocks.append({**model.to_json(), **change, "detections": time.size, "extrapolated": model.beyond(time)})
    missing = [detections.receivers.index(name) for name in found.excluded]
    return {
        "reference": found.reference,
        "residual_rms_s": found.rms,
        "sigma_s": found.sigma,
        "stages_rms_s": {
            "raw": _root_mean_square(found.uncorrected[found.used]),
            "line": _root_mean_square(found.straightened[found.used]),
            "final": found.rms,
        },
        "receptions": int(found.used.sum()),
        "heard_by_one_receiver": found.alone,
        "echoes": found.echoes,
        "outliers": list_outliers(found, detections),
        "excluded": dict(found.excluded),
        "detections_left_out": int(np.isin(detections.receiver, missing).sum()),
        "clocks": clocks,
    }


def list_outliers(found: Synchronization, detections: Detections) -> list[dict[str, Any]]:
    """The receptions left out of the fit, in order of time."""
    receptions = found.receptions
    rows = np.flatnonzero(~found.used)
    return [
        {
            "t_unix_s": float(receptions.time[row]),
            "receiver": detections.receivers[receptions.receiver[row]],
            "tag": found.tags[receptions.tag[row]],
            "residual_s": float(found.residual[row]),
        }
        for row in rows[np.argsort(receptions.time[rows])]
    ]


def print_sync(document: Mapping[str, Any]) -> None:
    """A row for each receiver, and what was left out."""
    rows = [
        [
            clock["receiver"],
            str(clock["points"]),
            str(clock["outliers"]),
            f"{clock['first_offset_s']:.4f}",
            f"{clock['last_offset_s']:.4f}",
            f"{1e3 * clock['rms_s']:.2f}",
            str(clock["extrapolated"]),
        ]
        for clock in document["clocks"]
    ]
    header = ["receiver", "points", "outliers", "first offset [s]", "last offset [s]", "residual [ms]", "extrapolated"]
    stages = document["stages_rms_s"]
    note = (
        f"Offsets are against {document['reference']}. Differences between clocks (rms): raw {stages['raw']:.4g} s, after the "
        f"line through the initial points {1e3 * stages['line']:.3g} ms, at the end {1e3 * stages['final']:.3g} ms; "
        f"left out: {len(document['outliers'])} outliers, {document['echoes']} echoes, {document['heard_by_one_receiver']} "
        "receptions of sync tags by one receiver alone. Extrapolated: detections outside the time in which sync tags were heard."
    )
    if document["segment_days"]:
        note += f" Polynomials each {document['segment_days']:.3g} days."
    show(as_console_table(header, rows, note))
    for clock in document["clocks"]:
        if clock["outliers"] > MANY_OUTLIERS * clock["points"]:
            print(f"note: {clock['outliers']} outliers of {clock['receiver']}: a clock that jumps or bends? Try --segment-days")
    for step in document["steps"]:
        when = datetime.fromtimestamp(step["after"], timezone.utc)
        text = f"note: the clock of {step['original']} steps by {step['size']:.4f} s after {when:%Y-%m-%d %H:%M:%S}, by itself"
        print(f"{text}; from then on it is {step['receiver']} above")
    for name, reason in document["excluded"].items():
        print(f"no clock for {name}: it {reason}")
    if document["detections_left_out"]:
        print(f"left out of detections.csv.gz, without a clock: {document['detections_left_out']} detections")


def _root_mean_square(value: Floats) -> float:
    return float(np.sqrt(np.mean(value**2)))
