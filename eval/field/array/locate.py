"""`tagtrack eval array locate`: where tags were at each ping, or over each hundred of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from tagtrack.envs.csv_table import name_field
from tagtrack.eval.field.array.chain import Averaging
from tagtrack.eval.field.array.located import Located
from tagtrack.eval.field.array.locating import LocateOptions
from tagtrack.eval.field.array.maps import Cloud, plot_map
from tagtrack.eval.field.array.reading import describe_plane
from tagtrack.eval.field.telemetry import Plane, Reference, read_receivers, read_reference
from tagtrack.eval.plots import save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, show, write_json
from tagtrack.eval.results_folder import replace_results, require_replaceable
from tagtrack.eval.versions import collect_versions

OWN_FILES = ("positions.csv", "summary.json", "map.png")
COLUMNS = "tag,t_unix_s,x,y,sd_x,sd_y,receivers,pings,cov_xy,misfit,ambiguous,other_x,other_y"
DEPTH_COLUMNS = "z,sd_z,cov_xz,cov_yz,other_z"  # with --depth


@dataclass(frozen=True, kw_only=True)
class Locate:
    """Locate tags from what moored receivers heard of them.

    Writes positions.csv (one row for each ping, or for each AVERAGE of them), summary.json and map.png. Clocks must agree: see
    `array sync`. Times that were rounded (to 10 ms in some exports) want --average 30 to 100. Where --receivers is in degrees,
    positions.csv has lon,lat too, and x,y are metres east and north of the origin that summary.json names. With --depth it has
    z [m, upwards]; where depths were given, their errors are taken as none.
    """

    source: LocateOptions
    average: int = 1
    """Pings of a tag, heard by --min-receivers, that make one position; those heard by two in between sharpen it."""
    average_hours: Annotated[float | None, tyro.conf.arg(metavar="H", help_behavior_hint="(none)")] = None
    """Instead: all pings of as many hours (24: by day, UTC) make one position."""
    systematic: float = 1e-3
    """What averaging does not remove: errors of clocks and of places over the speed of sound, of each receiver [s]."""
    reference: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(none)")] = None
    """Where tags really were: csv with columns tag,x,y (at rest) or t_unix_s,x,y (a track, interpolated), or lon,lat."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = field(default=Path("runs/array-locate"))
    """Folder to write; an earlier result is replaced."""

    def run(self) -> None:
        """Run it."""
        self.source.check()
        if self.average < 1:
            raise ValueError(f"--average must be at least 1, got {self.average}")
        if self.average_hours is not None and not (self.average_hours > 0 and self.average == 1):
            raise ValueError(f"--average-hours must be positive and stand without --average, got {self.average_hours}")
        if not self.systematic >= 0:
            raise ValueError(f"--systematic must be at least 0, got {self.systematic}")
        require_replaceable(self.out, OWN_FILES, "localization")
        places = read_receivers(self.source.receivers)
        plane = places.plane
        reference = read_reference(self.reference, plane) if self.reference is not None else None
        detections = self.source.read(places)
        tags = self.source.tags or detections.tags
        located = []
        with progress_bar(len(tags), "tags") as advance:
            for each in self.source.locate(detections, places, self.averaging):
                located.append(each)
                advance(each.tag, 1)
        document = {
            "tags": {each.tag: summarize_tag(each, reference) for each in located},
            "method": self.source.method,
            "sound_speed_m_s": self.source.sound.usual,
            "average": self.average,
            "average_hours": self.average_hours,
            "min_receivers": self.source.min_receivers,
            "max_sd_m": self.source.max_sd,
            "depth": self.source.depth,
            "detections": [str(path) for path in self.source.detections],
            "receivers": str(self.source.receivers),
            "reference": str(self.reference) if self.reference is not None else None,
            **({"origin": plane.origin} if plane else {}),
            "versions": collect_versions(),
        }
        print_summary(document, plane)
        remarks = [remark for each in located for remark in each.remarks]
        if reference is not None and reference.track is not None and len(located) > 1:
            remarks.append(f"{self.reference} tells one track: all {len(located)} tags are judged by it; --tags names its own")
        for remark in remarks:
            print(f"note: {remark}")
        with replace_results(self.out, OWN_FILES) as folder:
            columns = ",".join([COLUMNS, *([DEPTH_COLUMNS] if self.source.depth else []), *(["lon,lat"] if plane else [])])
            (folder / "positions.csv").write_text("\n".join([columns, *position_rows(located, plane), ""]), encoding="utf-8")
            write_json(folder / "summary.json", document)
            clouds = [_cloud(each) for each in located]
            truth = np.concatenate([true_places(each, reference) for each in located])
            save_figure(folder / "map.png", plot_map(clouds, places.position, places.names, truth=truth))
        print(f"written: {self.out}")

    @property
    def averaging(self) -> Averaging | None:
        """What the options say; None for a position of each ping."""
        if self.average_hours is not None:
            return Averaging(seconds=3600 * self.average_hours, systematic=self.systematic)
        return Averaging(count=self.average, systematic=self.systematic) if self.average > 1 else None


def _cloud(located: Located) -> Cloud:
    known = located.known
    return Cloud(
        name=located.tag,
        position=located.positions.position[known, :2],
        covariance=located.positions.covariance[known, :2, :2],
        doubtful=located.ambiguous[known],
    )


def summarize_tag(located: Located, reference: Reference | None) -> dict[str, Any]:
    """What summary.json tells of a tag; null where nothing was located or there is no reference."""
    known = located.known
    position, count = located.positions.position[known, :2], located.count[known]
    figures: dict[str, Any] = {"heard": located.heard, "located": int(count.sum()), "rows": int(known.sum())}
    error = np.linalg.norm(position - true_places(located, reference), axis=1)
    error = error[np.isfinite(error)]
    figures["median_m"], figures["p95_m"] = (float(np.quantile(error, q)) if error.size else None for q in (0.5, 0.95))
    figures["rmse_m"] = float(np.sqrt(np.mean(error**2))) if error.size else None
    mean = np.average(position, axis=0, weights=count) if known.any() else (None, None)
    figures["mean_x"], figures["mean_y"] = (None if value is None else float(value) for value in mean)
    if located.height is not None:
        figures["median_z"] = float(np.median(located.height[known])) if known.any() else None
        figures["without_depth"] = located.without_height
    figures["interval_s"] = located.interval
    ambiguous = int(located.ambiguous[known].sum())
    return {**figures, "ambiguous": ambiguous, "sigma_s": located.sigma, "arrivals_removed": located.removed}


def position_rows(located: Sequence[Located], plane: Plane | None = None) -> list[str]:
    """Lines of positions.csv, tag by tag in order of time; with a plane they end in degrees, to 1e-8 (1 mm)."""
    lines = []
    for each in located:
        tag, heard = name_field(each.tag), each.pings.heard.sum(axis=1)
        sd, ambiguous = each.sd, each.ambiguous
        rows = np.flatnonzero(each.known)
        degrees = plane.to_geodetic(each.positions.position[rows, :2]) if plane else np.empty((rows.size, 0))
        for k, place in zip(rows, degrees, strict=True):
            (x, y), (sd_x, sd_y) = each.positions.position[k, :2], sd[k, :2]
            line = f"{tag},{each.pings.time[k]:.3f},{x:.3f},{y:.3f},{sd_x:.3f},{sd_y:.3f},{heard[k]},{each.count[k]:.0f}"
            line += f",{each.positions.covariance[k, 0, 1]:.4f}"
            misfit, *other = ("" if np.isnan(value) else f"{value:.3f}" for value in (each.misfit[k], *each.other[k]))
            line += "".join(f",{text}" for text in (misfit, f"{ambiguous[k]:d}", *other[:2]))
            if each.height is not None:
                line += f",{each.height[k]:.3f}," + ",".join(_depth_fields(each, k, other[2:]))
            lines.append(line + "".join(f",{value:.8f}" for value in place))
    return lines


def _depth_fields(located: Located, k: np.integer, other: Sequence[str]) -> list[str]:
    """sd_z, cov_xz, cov_yz and other_z of a row: a depth that was given has no errors."""
    if not other:
        return ["0.000", "0.0000", "0.0000", ""]
    covariance = located.positions.covariance[k]
    return [f"{np.sqrt(covariance[2, 2]):.3f}", f"{covariance[0, 2]:.4f}", f"{covariance[1, 2]:.4f}", *other]


def true_places(located: Located, reference: Reference | None) -> np.ndarray:
    """Where the tag was (K, 2) [m] at its K located rows; NaN where the reference does not say."""
    time = located.pings.time[located.known]
    if reference is None or (reference.track is None and located.tag not in reference.places):
        return np.full((len(time), 2), np.nan)
    return reference.position(located.tag, time)


def print_summary(document: dict[str, Any], plane: Plane | None = None) -> None:
    """A row for each tag."""

    def shown(value: float | None, digits: int = 2) -> str:
        return "-" if value is None else f"{value:.{digits}f}"

    header = ["tag", "heard", "located", "median [m]", "95 % [m]", "rmse [m]", "mean x [m]", "mean y [m]", "sigma [ms]"]
    rows = [
        [
            tag,
            str(figures["heard"]),
            str(figures["located"]),
            *(shown(figures[name]) for name in ("median_m", "p95_m", "rmse_m", "mean_x", "mean_y")),
            shown(1e3 * figures["sigma_s"]),
        ]
        for tag, figures in document["tags"].items()
    ]
    note = f"{document['method']}, {document['sound_speed_m_s']:g} m/s"
    note += f", {document['average']} pings to a position" if document["average"] > 1 else ""
    note += f", a position each {document['average_hours']:g} h" if document["average_hours"] else ""
    show(as_console_table(header, rows, note + describe_plane(plane)))
    for tag, figures in document["tags"].items():
        if figures["heard"] and not figures["located"]:
            print(
                f"note: nothing of {tag} was located, though {figures['heard']} pings were heard: too few receivers heard one "
                "ping, or their clocks differ by more than sound takes across the array; see `array sync`"
            )
        if figures["ambiguous"]:
            share = f"{figures['ambiguous']} of {figures['located']} positions of {tag}"
            print(f"note: {share} have another place that fits as well, other_x,other_y in positions.csv")
