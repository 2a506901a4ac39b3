"""`tagtrack eval array tracks`: smoothed tracks of tagged animals, gaps left open, ready as targets for the environments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from tagtrack.envs.motions.tracks import Track, find_unbroken, split_tracks
from tagtrack.eval.field.array.located import Located
from tagtrack.eval.field.array.locating import LocateOptions
from tagtrack.eval.field.array.maps import Cloud, plot_map
from tagtrack.eval.field.static_array.choosing import choose_places
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.static_array.registry import SMOOTHING
from tagtrack.eval.field.static_array.smoothing import SmoothTrack, choose_walk, interpolate, smooth
from tagtrack.eval.field.telemetry import read_receivers, write_movebank, write_tracks
from tagtrack.eval.plots import save_figure
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, show, write_json
from tagtrack.eval.results_folder import replace_results, require_replaceable
from tagtrack.eval.versions import collect_versions

OWN_FILES = ("tracks.csv", "training.csv", "held_out.csv", "movebank.csv", "tracks.json", "map.png")


@dataclass(frozen=True, kw_only=True)
class Animal:
    """The smoothed stretches of one tag, and how far those of its odd pings lie from those of its even ones (J,) [m]."""

    tag: str
    pings: int
    undecided: int  # of them, which fit two places that their neighbours do not tell apart: left out
    stretches: Sequence[SmoothTrack]
    apart: Floats
    given_height: tuple[Floats, Floats] | None = None  # times [s] and z [m] of its pings, where --depth tells them

    @property
    def covariance(self) -> Floats:
        """(J, n, n) of the rows of the track [m^2]."""
        return np.concatenate([each.covariance for each in self.stretches])

    @property
    def height(self) -> Floats | None:
        """(J,) z of the rows of the track [m], estimated or given; None in the plane."""
        if self.given_height is not None:
            return np.interp(self.track.time, *self.given_height)
        position = np.concatenate([each.position for each in self.stretches])
        return position[:, 2] if position.shape[1] == 3 else None

    @property
    def track(self) -> Track:
        """All stretches in one; its gaps are gaps of time."""
        return Track(
            time=np.concatenate([each.time for each in self.stretches]),
            position=np.concatenate([each.position[:, :2] for each in self.stretches]),
            tag=self.tag,
        )


@dataclass(frozen=True, kw_only=True)
class Tracks:
    """Turn detections into tracks: locate each ping, then smooth (a correlated random walk, RTS smoother).

    Writes tracks.csv (tag,t_unix_s,x,y and sd_x,sd_y,cov_xy; with --depth also z, upwards, and sd_z,cov_xz,cov_yz), training.csv
    and held_out.csv (split by animal, in the plane), tracks.json and map.png. Of a ping that fits two places, the one that its
    neighbours lead to is taken.
    Where no ping was located for longer than --longest-gap the track is cut: no rows stand there. Use a file with
    `tagtrack train --tracks FILE`. Where --receivers is in degrees, x,y are metres east and north of the origin that tracks.json
    names, and movebank.csv has the tracks in degrees, as Movebank takes them.
    """

    source: LocateOptions
    interval: float = 300.0
    """Time between rows [s]."""
    longest_gap: float = 3600.0
    """Longest time without a located ping that the smoother may bridge [s]."""
    least_pings: int = 20
    """Stretches of fewer pings are left out."""
    odd_even: bool = False
    """Also smooth odd and even pings apart, and tell how far the two tracks lie from each other (three times the work)."""
    held_out: float = 0.25
    """Share of the animals that go to held_out.csv."""
    seed: int = 0
    """Of the choice of animals to hold out."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = field(default=Path("runs/array-tracks"))
    """Folder to write; an earlier result is replaced."""

    def run(self) -> None:
        """Run it."""
        self.check()
        require_replaceable(self.out, OWN_FILES, "set of tracks")
        places = read_receivers(self.source.receivers)
        plane = places.plane
        detections = self.source.read(places)
        tags = self.source.tags or detections.tags
        animals: list[Animal] = []
        remarks: list[str] = []
        with progress_bar(len(tags), "tags") as advance:
            for located in self.source.locate(detections, places):
                animals.append(self.follow(located))
                remarks += located.remarks
                advance(located.tag, 1)
        found = [animal for animal in animals if animal.stretches]
        if not found:
            doubtful = sum(animal.undecided for animal in animals)
            why = f" ({doubtful} pings fit two places that their neighbours do not tell apart)" if doubtful else ""
            raise ValueError(f"no tag has a stretch of {self.least_pings} located pings{why}; lower --least-pings")
        document: dict[str, Any] = {
            "tags": {animal.tag: summarize_animal(animal) for animal in animals},
            "odd_even_median_m": _median(np.concatenate([animal.apart for animal in animals])),
            "method": self.source.method,
            "sound_speed_m_s": self.source.sound.usual,
            "interval_s": self.interval,
            "longest_gap_s": self.longest_gap,
            "detections": [str(path) for path in self.source.detections],
            **({"origin": plane.origin} if plane else {}),
            "versions": collect_versions(),
        }
        print_animals(document)
        for remark in remarks:
            print(f"note: {remark}")
        with replace_results(self.out, OWN_FILES) as folder:
            tracks = {animal.tag: animal.track for animal in found}
            covariance = {animal.tag: animal.covariance for animal in found}
            height = {animal.tag: animal.height for animal in found} if self.source.depth else None
            write_tracks(folder / "tracks.csv", tracks, covariance=covariance, height=height)
            if plane:
                write_movebank(folder / "movebank.csv", tracks, plane)
            if len(tracks) > 1:
                parts = split_tracks(list(tracks.values()), self.held_out, self.seed)
                for name, part in zip(("training", "held_out"), parts, strict=True):
                    write_tracks(folder / f"{name}.csv", {track.tag: track for track in part})
                    document[name] = [track.tag for track in part]
            write_json(folder / "tracks.json", document)
            save_figure(folder / "map.png", plot_map([_cloud(animal) for animal in found], places.position, places.names))
        print(f"written: {self.out}")

    def check(self) -> None:
        """Raise ValueError for an option out of range."""
        self.source.check()
        for name in ("interval", "longest_gap"):
            if not getattr(self, name) > 0:
                raise ValueError(f"--{name.replace('_', '-')} must be positive, got {getattr(self, name)}")
        if self.least_pings < 2:
            raise ValueError(f"--least-pings must be at least 2, got {self.least_pings}")
        if not 0 < self.held_out < 1:
            raise ValueError(f"--held-out must be a share between 0 and 1, got {self.held_out}")

    def follow(self, located: Located) -> Animal:
        """Smooth the stretches of one tag; none if there are too few pings."""
        known = located.known
        time, position = located.pings.time[known], located.positions.position[known]
        covariance, other = located.positions.covariance[known], located.other[known]
        undecided = 0
        if located.ambiguous[known].any():
            at_other, unclear = choose_places(time, position, other, covariance)
            position = np.where(at_other[:, None], other, position)
            covariance = np.where(at_other[:, None, None], located.other_covariance[known], covariance)
            clear = ~unclear & np.isfinite(covariance).all(axis=(1, 2))
            time, position, covariance = time[clear], position[clear], covariance[clear]
            undecided = int((~clear).sum())
        stretches = [each for each in find_unbroken(time, self.longest_gap) if each.stop - each.start >= self.least_pings]
        if not stretches:
            return Animal(tag=located.tag, pings=int(known.sum()), undecided=undecided, stretches=(), apart=np.empty(0))
        walk = choose_walk(time, position, covariance)
        track = interpolate if self.source.method in SMOOTHING else smooth
        smoothed, apart = [], []
        for each in stretches:
            rows = np.arange(each.start, each.stop)
            at = self.row_times(time[rows])
            if at.size < 2:
                continue
            smoothed.append(track(time[rows], position[rows], covariance[rows], walk, at=at))
            if self.odd_even:
                halves = [track(time[half], position[half], covariance[half], walk, at=at) for half in (rows[::2], rows[1::2])]
                apart.append(np.linalg.norm(halves[0].position - halves[1].position, axis=1))
        return Animal(
            tag=located.tag,
            pings=int(known.sum()),
            undecided=undecided,
            stretches=smoothed,
            apart=np.concatenate(apart) if apart else np.empty(0),
            given_height=None if located.pings.height is None else (located.pings.time, located.pings.height),
        )

    def row_times(self, time: Floats) -> Floats:
        """Times (J,) [s] of the rows of a stretch of pings (K,): whole multiples of the interval."""
        return self.interval * np.arange(np.ceil(time[0] / self.interval), np.floor(time[-1] / self.interval) + 1)


def summarize_animal(animal: Animal) -> dict[str, Any]:
    """What tracks.json tells of a tag."""
    refused = sum(int(each.refused.sum()) for each in animal.stretches)
    step = [np.linalg.norm(np.diff(each.position, axis=0), axis=1).sum() for each in animal.stretches]
    spread = [np.sqrt(np.trace(each.covariance, axis1=1, axis2=2)) for each in animal.stretches]
    walk = animal.stretches[0].walk if animal.stretches else None
    return {
        "pings_located": animal.pings,
        "pings_refused": refused,
        "pings_undecided": animal.undecided,
        "stretches": len(animal.stretches),
        "hours": sum(float(each.time[-1] - each.time[0]) for each in animal.stretches) / 3600,
        "path_m": float(sum(step)),
        "sd_median_m": _median(np.concatenate(spread)) if spread else None,
        "odd_even_median_m": _median(animal.apart),
        "walk": {"speed_m_s": walk.speed, "memory_s": walk.memory} if walk else None,
    }


def print_animals(document: dict[str, Any]) -> None:
    """A row for each tag."""

    def shown(value: float | None, digits: int = 2) -> str:
        return "-" if value is None else f"{value:.{digits}f}"

    header = ["tag", "pings", "refused", "stretches", "hours", "path [m]", "sd [m]", "odd/even [m]"]
    rows = [
        [
            tag,
            str(figures["pings_located"]),
            str(figures["pings_refused"]),
            str(figures["stretches"]),
            shown(figures["hours"], 1),
            shown(figures["path_m"], 0),
            shown(figures["sd_median_m"]),
            shown(figures["odd_even_median_m"]),
        ]
        for tag, figures in document["tags"].items()
    ]
    note = f"pings: located; refused: that the animal's walk does not explain; a row each {document['interval_s']:g} s"
    if document["odd_even_median_m"] is not None:
        note += f"; tracks of odd and of even pings are {document['odd_even_median_m']:.2f} m apart in the median of all rows"
    show(as_console_table(header, rows, note))
    for tag, figures in document["tags"].items():
        if figures["pings_undecided"]:
            share = f"{figures['pings_undecided']} of {figures['pings_located']} pings of {tag}"
            print(f"note: {share} fit two places that their neighbours do not tell apart; they are left out")


def _median(value: Floats) -> float | None:
    return float(np.median(value)) if value.size else None


def _cloud(animal: Animal) -> Cloud:
    pieces = [np.concatenate([each.position[:, :2], [[np.nan, np.nan]]]) for each in animal.stretches]
    return Cloud(name=animal.tag, position=np.concatenate(pieces), joined=True)
