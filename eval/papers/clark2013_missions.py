"""Clark et al. 2013, Tables II and V: what the standard filter did on board, with a moving and with resting tags."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.envs.belief.refilter import Recording
from tagtrack.envs.belief.summary import covariance
from tagtrack.envs.motions import MomentumRandomWalk
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sensors import StereoHydrophone
from tagtrack.eval.consistency import TABLE_II, table_ii_proportions
from tagtrack.eval.papers.clark2013_twin import (
    SETTLING,
    STATIONARY_SECONDS,
    TIME_STEP,
    moving_scenario,
    record_missions,
    stationary_scenario,
)
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size, make_row
from tagtrack.eval.papers.pictures import plot_rows
from tagtrack.eval.papers.printed import CLARK2013_SIGNAL_RATES, CLARK2013_TABLE_V
from tagtrack.eval.plots import COLOURS, Track, empty_figure, plot_track
from tagtrack.eval.statistics.estimate import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER = "clark2013"
NOISIER = 2.0  # [Lotek units]: twice the noise that the filter assumes
BOUND = 2.0  # [m/s] on the speed of particles

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
ON_BOUND = "As before, with that noise and the speed of the particles bounded by 2 m/s, which Alg. 2 does not do."


@dataclass(frozen=True, kw_only=True)
class Variant:
    """What is changed in the scenario, how the tables call it, and why."""

    suffix: str  # of the table's name
    noise: float | None = None  # sigma of the true readings [Lotek units]
    bound: float | None = None  # on the speed of the particles [m/s]
    note: str = ""

    def change(self, scenario: Scenario) -> Scenario:
        if self.noise is not None:
            scenario = replace(scenario, receiver=StereoHydrophone(bearing_sigma=self.noise))
        if self.bound is not None:
            motion = MomentumRandomWalk(max_speed=self.bound)
            scenario = replace(scenario, belief=replace(scenario.belief, motion=motion))
        return scenario


VARIANTS = (
    Variant(suffix=""),
    Variant(suffix=", noisier readings", noise=NOISIER, note=ON_NOISE),
    Variant(suffix=", noisier readings, bounded", noise=NOISIER, bound=BOUND, note=ON_BOUND),
)

NOTE_II = (
    "auv2Track, 98 minutes, many times; assumptions as for Table III. Errors are those of the particles' mean, sigma is "
    "sqrt(sigma_x^2 + sigma_y^2), which the paper does not define. The printed filter is too sure of itself, the twin's is "
    "not: Alg. 2, which bounds no speed, spreads its particles wider than the tag goes. Noisier readings alone change "
    "little; with the particles bounded as well the proportions of the axes are the printed ones. That e < sigma is printed "
    "above those of the axes no variant gives: another sigma may be meant."
)
NOTE_V = (
    "Many missions as the paper's single ones; assumptions as for Table III; start 20 to 100 m from the tag; no eel grass "
    "where the tag rests. The first minute is left out: sigma is 58 m in the square in which particles start, above any "
    "printed maximum of the stationary missions, so the paper cannot have counted it. At rest the paper's smallest sigmas "
    "and errors are several times ours, its largest smaller: as if its readings were worse than the filter assumes and its "
    "particles did not run away in silence. Noisier readings bring the errors to the printed ones (next table), a bound on "
    "the particles' speed the largest sigmas (the one after); neither brings both."
)


NOTE_8 = (
    "Our water is guessed without these figures, and is more extreme: nearly every ping is heard where it is clear, and for "
    "a minute none in eel grass or out of reach."
)


def record(scenario: Scenario, missions: int, setting: Setting) -> list[Recording]:
    return record_missions(scenario, missions, seed=setting.seed, threads=setting.threads, on_step=setting.advance)


def record_moving(variant: Variant, setting: Setting) -> list[Recording]:
    """auv2Track, as often as the size says."""
    size = setting.size
    return record(variant.change(moving_scenario(size.particles, size.moving_seconds)), size.moving, setting)


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
            rows += rate_rows(missions)
            figures |= draw_typical(missions)
        for name, seconds in STATIONARY_SECONDS.items():
            scenario = variant.change(stationary_scenario(setting.size.particles, seconds))
            rows += mission_rows(name, record(scenario, setting.size.stationary, setting), variant)
    errors = [row for row in rows if row.column in ("avg error", "max error")]
    figures["clark2013_table_v"] = plot_rows(errors, "error [m]", logarithmic=True)
    return Findings(rows=rows, figures=figures)


def mission_rows(name: str, missions: Sequence[Recording], variant: Variant) -> list[Row]:
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


def rate_rows(missions: Sequence[Recording]) -> list[Row]:
    """Highest and lowest number of signals in a minute."""
    rates = np.array([signals_a_minute(mission) for mission in missions])
    values = {"highest": rates.max(axis=1), "lowest": rates.min(axis=1)}
    return [
        make_row(
            values[column],
            paper=PAPER,
            table="Fig. 8",
            row="signals in a minute",
            column=column,
            paper_value=printed,
            unit="1/min",
            note=NOTE_8,
        )
        for column, printed in CLARK2013_SIGNAL_RATES.items()
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


def draw_typical(missions: Sequence[Recording]) -> dict[str, Figure]:
    """Path and course of the mission with the median error (Fig. 8)."""
    errors = [mission.error.mean() for mission in missions]
    mission = missions[int(np.argsort(errors)[(len(errors) - 1) // 2])]
    track = Track(fish=mission.fish, vehicle=mission.vehicle, belief=mean_of(mission.belief))
    path = plot_track({"auv2Track": track}, title="twin of auv2Track, the mission with the median error")
    return {"clark2013_fig_8a": path, "clark2013_fig_8b": plot_course(mission)}


def plot_course(mission: Recording) -> Figure:
    """Error, standard deviations, and signals a minute over time."""
    figure, (above, below) = empty_figure(width=9.0, height=5.5, rows=2)
    time = TIME_STEP * np.arange(mission.belief.size)
    belief = mission.belief
    curves = {"error": mission.error, "σ_x": np.sqrt(belief["xx"]), "σ_y": np.sqrt(belief["yy"])}
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
    return moving_steps(size) + len(VARIANTS) * round(stationary / TIME_STEP)


PROPORTIONS_TWIN = Experiment(paper=PAPER, table="Table II", run=run_proportions, steps=moving_steps)
MISSIONS_TWIN = Experiment(paper=PAPER, table="Table V", run=run_missions, steps=mission_steps)
