"""Clark et al. 2013, Tables II and V: what the standard filter did on board, with a moving and with resting tags."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull

from tagtrack.envs.belief.refilter import Recording
from tagtrack.envs.belief.summary import covariance
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sensors import StereoHydrophone
from tagtrack.eval.consistency import TABLE_II, table_ii_proportions
from tagtrack.eval.papers.clark2013_twin import (
    FLOWN,
    SETTLING,
    SHARK_SECONDS,
    STATIONARY_SECONDS,
    TIME_STEP,
    moving_scenario,
    record_missions,
    shark_scenario,
    stationary_scenario,
)
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size, make_row
from tagtrack.eval.papers.pictures import plot_rows
from tagtrack.eval.papers.printed import (
    CLARK2013_AREAS,
    CLARK2013_SIGNAL_RATES,
    CLARK2013_TABLE_V,
    CLARK2013_TABLE_V_SHARKS,
)
from tagtrack.eval.plots import COLOURS, EpisodePaths, empty_figure, plot_track
from tagtrack.eval.statistics.estimate import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER = "clark2013"
NOISIER = 2.0  # [Lotek units]: twice the noise that the filter assumes
TYPICAL_REST = "stationaryTrackB"  # drawn as Fig. 7, of which the paper does not say which mission it is

PROPORTIONS = {
    "ex_below_mean_sigma_x": "e_x < σ_avgX",
    "ey_below_mean_sigma_y": "e_y < σ_avgY",
    "ex_below_sigma_x": "e_x < σ_X",
    "ey_below_sigma_y": "e_y < σ_Y",
    "e_below_sigma": "e < σ",
}
ON_NOISE = (
    "As the table before, but the true readings have twice the noise that the filter assumes (2 Lotek units, some 20 "
    "degrees), as echoes in 2 m of water may give."
)
ON_FLOWN = (
    "As the first table, but the controller flies each leg until it is within 10 degrees of it, and never searches: the twins' "
    "usual one gives up a leg at 45 degrees and circles after 30 s of silence, which the authors' vehicle did not."
)


@dataclass(frozen=True, kw_only=True)
class MissionsVariant:
    """What is changed in the scenario, how the tables call it, and why."""

    suffix: str  # of the table's name
    noise: float | None = None  # sigma of the true readings [Lotek units]
    controller: str = "three_step"
    note: str = ""

    def change(self, scenario: Scenario) -> Scenario:
        if self.noise is not None:
            scenario = replace(scenario, receiver=StereoHydrophone(bearing_sigma=self.noise))
        return scenario


VARIANTS = (
    MissionsVariant(suffix=""),
    MissionsVariant(suffix=", noisier readings", noise=NOISIER, note=ON_NOISE),
    MissionsVariant(suffix=", legs flown", controller=FLOWN, note=ON_FLOWN),
)

NOTE_II = (
    "auv2Track, 98 minutes, many times; assumptions as for Table III. Errors are those of the particles' mean, sigma is "
    "sqrt(sigma_x^2 + sigma_y^2), which the paper does not define. The printed filter is too sure of itself, the twin's is not "
    "under any variant: its particles, whose speed Alg. 2 lets walk without bound, spread wider than its errors. The paper's "
    "readings must have been worse than its filter assumed. That e < sigma is printed above those of the axes no variant "
    "gives: another sigma may be meant."
)
NOTE_V = (
    "Many missions as the paper's single ones; assumptions as for Table III; start 20 to 100 m from the tag; no eel grass "
    "where the tag rests. Particles start at up to 1 m/s, which the paper leaves open: drawn up to any speed, most would leave "
    "the lagoon. The first minute is left out: sigma is 58 m in the square in which particles start, above any printed maximum "
    "of the stationary missions, so the paper cannot have counted it. At rest the largest sigmas are near the printed ones; the "
    "paper's smallest sigmas and its mean errors are several times ours, as if its readings were worse than the filter assumes: "
    "with twice the noise (next table) printed values fall within. How the legs are flown changes little (the table after)."
)


NOTE_SHARKS = (
    "Missions of the paper's lengths after a fish that swims as that of LeopardShark-v0, up to 0.5 m/s, in water with eel grass; "
    "where the shark was nobody knew, so that the paper prints standard deviations alone. The first minute is left out."
)
NOTE_IV = (
    "Area: of the convex hull of the vehicle's path; the paper does not say how it measured, nor how far the vehicle was from "
    "the tag but in Figs. 7b and 8b, of which the twin draws its own. That of auv2Track is printed '27,7148'."
)
NOTE_8 = (
    "Our water is guessed without these figures, and is more extreme: nearly every ping is heard where it is clear, and for "
    "a minute none in eel grass or out of reach."
)


def record(scenario: Scenario, missions: int, setting: Setting, variant: MissionsVariant) -> list[Recording]:
    """Missions in a scenario, with what a variant changes."""
    return record_missions(
        variant.change(scenario),
        missions,
        seed=setting.seed,
        controller=variant.controller,
        threads=setting.threads,
        on_step=setting.advance,
    )


def record_moving(variant: MissionsVariant, setting: Setting) -> list[Recording]:
    """auv2Track, as often as the size says."""
    size = setting.size
    return record(moving_scenario(size.particles, size.moving_seconds), size.moving, setting, variant)


def run_proportions(setting: Setting) -> Findings:
    """Table II."""
    rows = []
    for variant in VARIANTS:
        missions = record_moving(variant, setting)
        beliefs = np.array([mission.belief[1:] for mission in missions])
        error = mean_of(beliefs) - np.array([mission.fish[1:] for mission in missions])
        shares = table_ii_proportions(error, covariance(beliefs))
        rows += [
            make_row(
                100 * shares[key],
                paper=PAPER,
                table="Table II" + variant.suffix,
                row=title,
                column="proportion of time",
                paper_value=100 * TABLE_II[key],
                unit="%",
                note=variant.note or NOTE_II,
            )
            for key, title in PROPORTIONS.items()
        ]
    return Findings(rows=rows, figures={"clark2013_table_ii": plot_rows(rows, "proportion of time [%]")})


def mean_of(beliefs: np.ndarray) -> Floats:
    """(..., 2) mean of the particles [m]."""
    return np.stack([beliefs["mean_x"], beliefs["mean_y"]], axis=-1)


def run_missions(setting: Setting) -> Findings:
    """Table V and Fig. 8."""
    rows: list[Row] = []
    figures: dict[str, Figure] = {}
    for variant in VARIANTS:
        missions = record_moving(variant, setting)
        rows += mission_rows("auv2Track", missions, variant)
        if not variant.suffix:
            rows += rate_rows("moving tag", missions) + covered_rows("auv2Track", missions)
            figures |= draw_typical(missions, "clark2013_fig_8")
        for name, seconds in STATIONARY_SECONDS.items():
            scenario = stationary_scenario(setting.size.particles, seconds)
            resting = record(scenario, setting.size.stationary, setting, variant)
            rows += mission_rows(name, resting, variant)
            if not variant.suffix:
                rows += covered_rows(name, resting)
            if not variant.suffix and name == TYPICAL_REST:
                rows += rate_rows("resting tag", resting)
                figures |= draw_typical(resting, "clark2013_fig_7")
    for name, seconds in SHARK_SECONDS.items():
        sharks = record(shark_scenario(setting.size.particles, seconds), setting.size.sharks, setting, VARIANTS[0])
        rows += shark_rows(name, sharks) + covered_rows(name, sharks)
    errors = [row for row in rows if row.column in ("avg error", "max error")]
    figures["clark2013_table_v"] = plot_rows(errors, "error [m]", logarithmic=True)
    return Findings(rows=rows, figures=figures)


def mission_rows(name: str, missions: Sequence[Recording], variant: MissionsVariant) -> list[Row]:
    settled = round(SETTLING / TIME_STEP)
    beliefs = np.array([mission.belief[settled:] for mission in missions])
    errors = np.array([mission.error[settled:] for mission in missions])
    return [
        make_row(
            values,
            paper=PAPER,
            table="Table V" + variant.suffix,
            row=name,
            column=column,
            paper_value=CLARK2013_TABLE_V[name][column],
            unit="m",
            note=variant.note or NOTE_V,
        )
        for column, values in figures_of(errors, beliefs).items()
    ]


def shark_rows(name: str, missions: Sequence[Recording]) -> list[Row]:
    """The standard deviations of a mission after a shark."""
    settled = round(SETTLING / TIME_STEP)
    beliefs = np.array([mission.belief[settled:] for mission in missions])
    found = figures_of(np.array([mission.error[settled:] for mission in missions]), beliefs)
    return [
        make_row(
            found[column],
            paper=PAPER,
            table="Table V, sharks",
            row=name,
            column=column,
            paper_value=printed,
            unit="m",
            note=NOTE_SHARKS,
        )
        for column, printed in CLARK2013_TABLE_V_SHARKS[name].items()
    ]


def covered_rows(name: str, missions: Sequence[Recording]) -> list[Row]:
    """Area that the vehicle covers (Table IV), and its distance from the tag (a metric of section 6, drawn but not printed)."""
    areas = [ConvexHull(mission.vehicle).volume for mission in missions]  # in the plane scipy calls the area volume
    apart = [np.linalg.norm(mission.vehicle - mission.fish, axis=1).mean() for mission in missions]
    make = partial(make_row, paper=PAPER, row=name, note=NOTE_IV)
    return [
        make(areas, table="Table IV", column="area covered", paper_value=CLARK2013_AREAS[name], unit="m²"),
        make(apart, table="Fig. 7 and 8", column="mean distance between AUV and tag", unit="m"),
    ]


def rate_rows(name: str, missions: Sequence[Recording]) -> list[Row]:
    """Highest and lowest number of signals in a minute."""
    rates = np.array([signals_a_minute(mission) for mission in missions])
    values = {"highest": rates.max(axis=1), "lowest": rates.min(axis=1)}
    return [
        make_row(
            values[column],
            paper=PAPER,
            table="Fig. 8",
            row=f"signals in a minute, {name}",
            column=column,
            paper_value=printed,
            unit="1/min",
            note=NOTE_8,
        )
        for column, printed in CLARK2013_SIGNAL_RATES[name].items()
    ]


def signals_a_minute(mission: Recording) -> Floats:
    """Usable signals in each sixty seconds (K - 59,), running."""
    minute = round(60 / TIME_STEP)
    return np.convolve(mission.detected[1:].astype(float), np.ones(minute), mode="valid")


def figures_of(error: Floats, beliefs: np.ndarray) -> Mapping[str, Floats]:
    """The columns of Table V (M,) [m] from errors [m] and beliefs, each (M, K)."""
    sigma_x, sigma_y = np.sqrt(beliefs["xx"]), np.sqrt(beliefs["yy"])
    return {
        "avg error": error.mean(axis=1),
        "min error": error.min(axis=1),
        "max error": error.max(axis=1),
        "min σ_x": sigma_x.min(axis=1),
        "max σ_x": sigma_x.max(axis=1),
        "min σ_y": sigma_y.min(axis=1),
        "max σ_y": sigma_y.max(axis=1),
    }


def draw_typical(missions: Sequence[Recording], figure: str) -> dict[str, Figure]:
    """Path and course of the mission with the median error (Figs. 7 and 8)."""
    errors = [mission.error.mean() for mission in missions]
    mission = missions[int(np.argsort(errors)[(len(errors) - 1) // 2])]
    track = EpisodePaths(fish=mission.fish, vehicle=mission.vehicle, belief=mean_of(mission.belief))
    name = TYPICAL_REST if figure.endswith("7") else "auv2Track"
    path = plot_track({name: track}, title=f"twin of {name}, the mission with the median error")
    return {f"{figure}a": path, f"{figure}b": plot_course(mission)}


def plot_course(mission: Recording) -> Figure:
    """Error, distance to the tag, standard deviations, and signals a minute over time."""
    figure, (above, below) = empty_figure(width=9.0, height=5.5, rows=2)
    time = TIME_STEP * np.arange(mission.belief.size)
    belief = mission.belief
    apart = np.linalg.norm(mission.vehicle - mission.fish, axis=1)
    curves = {"error": mission.error, "distance to the tag": apart, "σ_x": np.sqrt(belief["xx"]), "σ_y": np.sqrt(belief["yy"])}
    for (name, values), colour in zip(curves.items(), COLOURS, strict=False):
        above.plot(time, values, color=colour, lw=0.9, label=name)
    rate = signals_a_minute(mission)
    below.plot(time[-rate.size :], rate, color=COLOURS[6], lw=0.9)
    above.set(ylabel="[m]", ylim=(0, None))
    above.legend(frameon=False)
    below.set(xlabel="time [s]", ylabel="signals in the last minute", ylim=(0, None))
    return figure


def moving_steps(size: Size) -> int:
    return len(VARIANTS) * size.moving * round(size.moving_seconds / TIME_STEP)


def mission_steps(size: Size) -> int:
    stationary = sum(STATIONARY_SECONDS.values()) * size.stationary
    sharks = sum(SHARK_SECONDS.values()) * size.sharks
    return moving_steps(size) + round((len(VARIANTS) * stationary + sharks) / TIME_STEP)


PROPORTIONS_TWIN = Experiment(paper=PAPER, table="Table II", run=run_proportions, steps=moving_steps)
MISSIONS_TWIN = Experiment(paper=PAPER, table="Table V", run=run_missions, steps=mission_steps)
