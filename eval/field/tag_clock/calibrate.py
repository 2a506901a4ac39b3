"""`tagtrack eval calibrate`: the period of a tag's code from arrivals recorded beside the hydrophone (Lin et al. 2013, IV.B)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from tagtrack.envs.sim.sound_speed import USUAL_SOUND_SPEED
from tagtrack.eval.field.static_array.detections import time_resolution
from tagtrack.eval.field.tag_clock.arrivals import Arrivals, read_arrivals
from tagtrack.eval.field.tag_clock.calibration import TAU, TICK, Calibration, Differences, Kind, calibrate
from tagtrack.eval.field.tag_clock.calibration_plot import plot_differences
from tagtrack.eval.field.tag_clock.time_of_flight import aliasing_range
from tagtrack.eval.plots import save_figure
from tagtrack.eval.report import as_console_table, show, write_json
from tagtrack.eval.results_folder import replace_results, require_replaceable
from tagtrack.eval.versions import collect_versions

COARSEST = 0.005  # step of arrivals that tell of a clock [s]: 7.5 m of sound
ENOUGH = 20  # arrivals that are not all multiples of it by chance
OWN_FILES = ("calibration.json", "differences.png")

TITLES: Mapping[Kind, str] = {
    Kind.REGULAR: "regular: one period",
    Kind.MISSED: "missed codes: several periods",
    Kind.NEIGHBOURING: "neighbouring code of the burst",
    Kind.SHIFTED: "shift of the clock, or a long gap",
}


@dataclass(frozen=True, kw_only=True)
class Calibrate:
    """Find the period of a tag's code from arrivals that were recorded with the tag beside the hydrophone.

    By a line through all arrivals, and by the mean of differences as in Lin et al. 2013. Differences that are not within tau
    of the nominal period are outliers; the table says how many of which kind.
    """

    arrivals: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """csv file with columns t_s,code: when each code arrived on the receiver's clock, in order."""
    code: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(the file's only one)")] = None
    """Which code to calibrate."""
    nominal_period: Annotated[float | None, tyro.conf.arg(metavar="S", help_behavior_hint="(2 or 4)")] = None
    """Its period, roughly [s]."""
    tau: float = TAU
    """How far a regular difference may lie from it [s]."""
    resolution: Annotated[float, tyro.conf.arg(help_behavior_hint="(1/4800)")] = TICK
    """Step in which the receiver can tell arrivals apart [s]; the file's decimals may be finer."""
    sound_speed: float = USUAL_SOUND_SPEED
    """Speed of sound [m/s], for the range at which the period aliases."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(none)")] = None
    """Folder to write calibration.json and differences.png to."""

    def run(self) -> None:
        """Run it."""
        if self.out is not None:
            require_replaceable(self.out, OWN_FILES, "calibration")
        heard = read_arrivals(self.arrivals)
        code = self.choose_code(heard)
        arrival = heard.of_code(code)
        step = time_resolution(arrival)
        if step > COARSEST and arrival.size >= ENOUGH:
            raise ValueError(
                f"{self.arrivals}: all times are multiples of {step:g} s, of which no clock can be calibrated; export them in "
                "milliseconds"
            )
        try:
            calibration = calibrate(arrival, self.nominal_period, tau=self.tau, resolution=self.resolution)
        except ValueError as error:
            raise ValueError(f"{self.arrivals}, code {code}: {error}") from None
        document = {
            "arrivals_file": str(self.arrivals),
            "code": code,
            "arrivals": arrival.size,
            "tau_s": self.tau,
            "resolution_s": self.resolution,
            **calibration_document(calibration, self.sound_speed),
            "versions": collect_versions(),
        }
        print_calibration(document)
        if self.out is not None:
            with replace_results(self.out, OWN_FILES) as folder:
                write_json(folder / "calibration.json", document)
                picture = plot_differences(calibration, title=f"code {code}, {self.arrivals.name}")
                save_figure(folder / "differences.png", picture)
            print(f"written: {self.out}")

    def choose_code(self, heard: Arrivals) -> int:
        """The code asked for, or the only one. Raises ValueError that lists those of the file."""
        listed = ", ".join(map(str, heard.codes))
        if self.code is not None and self.code not in heard.codes:
            raise ValueError(f"{self.arrivals} holds no code {self.code}; it holds {listed}")
        if self.code is None and len(heard.codes) > 1:
            raise ValueError(f"{self.arrivals} holds codes {listed}; choose one: --code {heard.codes[0]}")
        return heard.codes[0] if self.code is None else self.code


def calibration_document(calibration: Calibration, sound_speed: float) -> dict[str, Any]:
    """What calibration.json holds of a calibration: both estimates, the differences by kind, and as Table I lists them."""
    differences = calibration.differences
    return {
        "nominal_period_s": differences.nominal,
        "by_line": dataclasses.asdict(calibration.by_line),
        "by_differences": dataclasses.asdict(calibration.by_differences),
        "first_ping_s": calibration.clock.first_ping,
        "stretches": calibration.stretches,
        "sound_speed_m_s": sound_speed,
        "aliasing_range_m": float(aliasing_range(calibration.clock, sound_speed)),
        "outliers": int(np.sum(differences.kind != Kind.REGULAR)),
        "kinds": {kind.name.lower(): kind_figures(differences, kind) for kind in Kind},
        "differences": list_differences(differences),
    }


def kind_figures(differences: Differences, kind: Kind) -> dict[str, float | int | None]:
    """How many differences are of a kind, and between which values they lie [s]."""
    value = differences.of_kind(kind)
    shortest, longest = (round(float(value.min()), 5), round(float(value.max()), 5)) if value.size else (None, None)
    return {"count": int(value.size), "shortest_s": shortest, "longest_s": longest}


def list_differences(differences: Differences) -> list[dict[str, float | int | str]]:
    """Each difference, to 1e-5 s, with its frequency (Lin et al. 2013, Table I)."""
    pairs = zip(np.round(differences.value, 5).tolist(), differences.kind.tolist(), strict=True)
    found, frequency = np.unique(np.array(list(pairs)), axis=0, return_counts=True)
    return [
        {"difference_s": float(value), "frequency": int(count), "kind": Kind(int(kind)).name.lower()}
        for (value, kind), count in zip(found, frequency, strict=True)
    ]


def print_calibration(document: Mapping[str, Any]) -> None:
    """The differences by kind, and the period in two sentences."""
    rows = []
    for kind, title in TITLES.items():
        figures = document["kinds"][kind.name.lower()]
        if figures["count"]:
            rows.append([title, str(figures["count"]), f"{figures['shortest_s']:.5f}", f"{figures['longest_s']:.5f}"])
    note = (
        f"{document['arrivals']} arrivals of code {document['code']} in {document['arrivals_file']}; outliers removed: "
        f"{document['outliers']}, more than {document['tau_s']:g} s from {document['nominal_period_s']:g} s. Ranges alias at "
        f"+-{document['aliasing_range_m']:.0f} m for {document['sound_speed_m_s']:g} m/s."
    )
    show(as_console_table(["difference", "count", "shortest [s]", "longest [s]"], rows, note))
    line, paper = document["by_line"], document["by_differences"]
    print(f"T_c {line['period']:.8f} s, standard error {line['standard_error']:.1e} s (line through the arrivals)")
    print(
        f"T_c {paper['period']:.8f} s, standard error {paper['standard_error']:.1e} s, sigma {paper['sigma']:.5f} s "
        "(mean of differences, Lin et al. 2013)"
    )
    of_last = f", in the last of {document['stretches']} stretches" if document["stretches"] > 1 else ""
    print(f"t_0 {document['first_ping_s']:.5f} s{of_last}")
