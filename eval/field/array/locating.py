"""Which detections, by which receivers, and how: the options that `array locate` and `array tracks` have in common."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

import tyro

from tagtrack.eval.field.array.chain import Averaging, Locating, locate_tags
from tagtrack.eval.field.array.depth import TagHeight, read_tag_height
from tagtrack.eval.field.array.located import Located
from tagtrack.eval.field.array.reading import by_deployment, fit_names, read_aloud
from tagtrack.eval.field.array.sound import SoundSpeed, read_sound_speed
from tagtrack.eval.field.static_array.detections import Detections, shorten
from tagtrack.eval.field.static_array.registry import find_estimator
from tagtrack.eval.field.telemetry import ReceiverPlaces


@dataclass(frozen=True, kw_only=True)
class LocateOptions:
    """Which detections, by which receivers, and how."""

    detections: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE ...")]
    """Detections on corrected clocks: csv (t_unix_s,receiver,tag), exports of VUE, Fathom, GLATOS, OTN ..., or folders."""
    receivers: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """csv with columns receiver,x,y [m] or receiver,lon,lat [degrees]; detections by receivers not in it are left out."""
    tags: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ID ...", help_behavior_hint="(all)")] = ()
    """Tags to locate."""
    method: Annotated[str, tyro.conf.arg(metavar="NAME")] = "wls_ml"
    """Estimator: wls, ml, wls_ml, map, map_m, pf, yaps, or MODULE:FUNCTION of your own."""
    layout: Annotated[str | None, tyro.conf.arg(metavar="MODULE:FUNCTION", help_behavior_hint="(recognized)")] = None
    """A reader of your own kind of files: takes a path, returns times (N,) [s since 1970], and names of receivers and of tags."""
    sound_speed: Annotated[str, tyro.conf.arg(metavar="C")] = "1500"
    """Speed of sound [m/s], or a csv file of it over time: t_unix_s,sound_speed, or t_unix_s,temperature (salinity, depth)."""
    sigma: Annotated[float | None, tyro.conf.arg(metavar="S", help_behavior_hint="(from the pings)")] = None
    """Standard deviation of an arrival time [s]; by default what the pings with spare arrivals show, else 1 ms."""
    acceleration: float = 1e-3
    """Of the animal, for map, map_m and pf: standard deviation of a random acceleration [m/s^1.5]; some 0.05 for a boat."""
    depth: Annotated[str | None, tyro.conf.arg(metavar="M", help_behavior_hint="(none: in the plane)")] = None
    """How deep tags are [m below the receivers' zero], a csv file (tag,depth or tag,t_unix_s,depth), or `free`: estimated, which
    takes four receivers at several depths. --receivers then has a column depth [m, downwards] or z [m, upwards]."""
    min_receivers: int = 3
    """Fewest receivers that must have heard a ping; positions with --depth free take four."""
    max_sd: float = 100.0
    """Positions less certain than this [m], standard deviation in the worse direction, are not given."""

    def check(self) -> None:
        """Raise ValueError for an option out of range."""
        find_estimator(self.method)
        _ = self.sound, self.height  # numbers, or files that can be read
        for name in ("max_sd", "acceleration") + (("sigma",) if self.sigma is not None else ()):
            if not getattr(self, name) > 0:
                raise ValueError(f"--{name.replace('_', '-')} must be positive, got {getattr(self, name)}")
        if self.min_receivers < 3:
            raise ValueError(f"--min-receivers must be at least 3, which a position takes, got {self.min_receivers}")

    @cached_property
    def sound(self) -> SoundSpeed:
        """What ``sound_speed`` says."""
        return read_sound_speed(self.sound_speed)

    @cached_property
    def height(self) -> float | TagHeight | None:
        """z of the tags [m] that ``depth`` says; None where it is not asked for, or is to be estimated."""
        return None if self.depth is None else read_tag_height(self.depth)

    def read(self, places: ReceiverPlaces) -> Detections:
        """The detections by the receivers whose places are known.

        Raises:
            ValueError: for files that disagree, naming the names they have.
        """
        detections = fit_names(read_aloud(self.detections, self.layout), tuple(dict.fromkeys(places.called)), self.receivers)
        common = [name for name in detections.receivers if name in places.called]
        if len(common) < 3:
            heard = shorten(tuple(common))
            raise ValueError(f"a position takes three receivers; of {self.receivers} only {heard} heard anything")
        missing = [tag for tag in self.tags if tag not in detections.tags]
        if missing:
            raise ValueError(f"no detection of tag {missing[0]!r}; there are {shorten(detections.tags)}")
        return by_deployment(detections, places)

    def locate(self, detections: Detections, places: ReceiverPlaces, averaging: Averaging | None = None) -> Iterator[Located]:
        """Each tag in turn."""
        locating = Locating(
            method=find_estimator(self.method),
            sound_speed=self.sound,
            sigma=self.sigma,
            acceleration=self.acceleration,
            min_receivers=self.min_receivers,
            max_sd=self.max_sd,
            averaging=averaging,
            height=self.height,
        )
        position = places.position if self.depth is None else places.in_space()
        return locate_tags(detections, dict(zip(places.names, position, strict=True)), locating, tags=self.tags)
