"""Masmitja et al. 2020, Fig. 3E: a float that dives three times to 60 m, followed by a Wave Glider for fifteen hours.

The paper draws three tracks of it, by ultra-short baseline (USBL), by range-only and by area-only tracking (ROTT, AOTT), and
prints of the last alone how large the error grew. Here all three meet the same float from the same path. Assumed: the float
drifts with a current of some 5 cm/s that changes within hours, and is half as strong at depth; the pilots keep the glider on a
circle of 200 m about it at 0.7 m/s; each minute the modem gives a range and a position with errors of 0.5 m and 1 % of the range,
and the receiver hears the tag as often as in the campaign's own trials (Fig. S3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.envs.belief.assumptions import AOTT, Belief
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.measurement import MEASUREMENT, Status
from tagtrack.envs.sensors import RangeReceiver
from tagtrack.envs.sensors.presence import MeasuredReception
from tagtrack.envs.tag import Tag
from tagtrack.eval.papers.frame import Experiment, Findings, Setting, Size, make_row
from tagtrack.eval.papers.masmitja2020_twin import PAPER, RADIUS, area_belief
from tagtrack.eval.papers.printed import MASMITJA2020_FIG_3E
from tagtrack.eval.plots import COLOURS, empty_figure
from tagtrack.eval.statistics.estimate import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE = "Fig. 3E"
MINUTE = 60.0  # [s] between pings, and of each step
HOURS = 15
DEPTH = 60.0  # [m] of the three immersions
DIVES = ((2.0, 5.0), (6.5, 9.5), (11.0, 14.0))  # from when to when the float is down [h]; the times are not printed
SETTLING = 60  # steps left out: the filters still gather
CURRENT, MEMORY = 0.05, 4 * 3600.0  # of the surface [m/s], and how long it lasts [s]
GLIDER_SPEED = 0.7  # [m/s]
FIXED_ERROR, SHARE_ERROR = 0.5, 0.01  # of a range [m], and of it per metre

NOTE = (
    "Errors after the first hour. The paper draws three tracks and prints one figure: by area-only tracking, while the float was "
    "down, 'up to ~100 m'. Fifteen hours, three immersions to 60 m; assumed: a current of some 5 cm/s, half of it at depth, a "
    "circle of 200 m about the float at 0.7 m/s, ranges and USBL positions good to 0.5 m and 1 % of the range each minute, the "
    "tag heard as often as in Fig. S3. The depth is known."
)


@dataclass(frozen=True, kw_only=True)
class Voyage:
    """M voyages of K steps: places (M, K, 2) [m] of float and glider, and the float's depth (K,) [m]."""

    afloat: Floats
    glider: Floats
    depth: Floats

    @property
    def slant_range(self) -> Floats:
        """(M, K) [m]."""
        return np.sqrt(((self.afloat - self.glider) ** 2).sum(axis=-1) + self.depth**2)


def sail(voyages: int, generator: np.random.Generator) -> Voyage:
    """The float drifts, the glider circles it."""
    steps = round(HOURS * 3600 / MINUTE)
    time = MINUTE * np.arange(steps)
    depth = np.where([any(begin <= t / 3600 < end for begin, end in DIVES) for t in time], DEPTH, 0.0)
    keep = np.exp(-MINUTE / MEMORY)
    current = np.empty((voyages, steps, 2))
    current[:, 0] = CURRENT * generator.standard_normal((voyages, 2))
    for k in range(1, steps):
        current[:, k] = keep * current[:, k - 1] + CURRENT * np.sqrt(1 - keep**2) * generator.standard_normal((voyages, 2))
    drift = current * np.where(depth > 0, 0.5, 1.0)[:, None]
    afloat = np.concatenate([np.zeros((voyages, 1, 2)), np.cumsum(drift[:, :-1] * MINUTE, axis=1)], axis=1)
    angle = GLIDER_SPEED / RADIUS * time + generator.uniform(0, 2 * np.pi, (voyages, 1))
    return Voyage(afloat=afloat, glider=afloat + RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=-1), depth=depth)


def run_float(setting: Setting) -> Findings:
    """Fig. 3E."""
    generator = np.random.default_rng(setting.seed)
    voyages = setting.size.settings
    voyage = sail(voyages, generator)
    sigma = FIXED_ERROR + SHARE_ERROR * voyage.slant_range
    ranges = voyage.slant_range + sigma * generator.standard_normal(sigma.shape)
    fixes = voyage.afloat + sigma[..., None] * generator.standard_normal(voyage.afloat.shape)
    trials = MeasuredReception()
    heard = generator.random(sigma.shape) < np.interp(voyage.slant_range, trials.distances, trials.ratios, right=0.0)
    by_range = replace(AOTT, receiver=RangeReceiver(range_sigma=FIXED_ERROR + SHARE_ERROR * RADIUS), farthest=300.0)
    found = {
        "USBL": fixes,
        "ROTT": follow(by_range, voyage, setting, ranges=ranges),
        "AOTT": follow(area_belief(), voyage, setting, heard=heard),
    }
    errors = {name: np.linalg.norm(places - voyage.afloat, axis=-1)[:, SETTLING:] for name, places in found.items()}
    down = voyage.depth[SETTLING:] > 0
    make = partial(make_row, paper=PAPER, table=TABLE, unit="m", note=NOTE)
    rows = []
    for name, error in errors.items():
        rows.append(make(np.median(error[:, ~down], axis=1), row=name, column="median error, at the surface"))
        rows.append(make(np.median(error[:, down], axis=1), row=name, column="median error, at 60 m"))
        printed = MASMITJA2020_FIG_3E if name == "AOTT" else math.nan
        rows.append(make(error[:, down].max(axis=1), row=name, column="largest error, at 60 m", paper_value=printed))
    return Findings(rows=rows, figures={"masmitja2020_fig_3e": plot_voyage(voyage, found, errors)})


def follow(
    belief: Belief, voyage: Voyage, setting: Setting, *, ranges: Floats | None = None, heard: np.ndarray | None = None
) -> Floats:
    """Estimates (M, K, 2) [m] of a filter that is told a range each minute, or whether the tag was heard."""
    voyages, steps = voyage.afloat.shape[:2]
    sized = replace(belief, particles=setting.size.area_particles)
    filters = ParticleFilter(sized, Tag(period=MINUTE), rows=voyages, threads=setting.threads)
    filters.begin(voyage.glider[:, 0, 0], voyage.glider[:, 0, 1], seed=setting.seed)
    estimates = np.empty((voyages, steps, 2))
    told = np.zeros((voyages, 1), MEASUREMENT)
    told["readings"] = np.nan
    for k in range(steps):
        filters.predict(MINUTE)
        told["time"], told["arrival"], told["depth"] = filters.time, filters.time, voyage.depth[k]
        told["x"][:, 0], told["y"][:, 0] = voyage.glider[:, k].T
        if ranges is not None:
            told["status"], told["readings"][:, 0, 0] = Status.HEARD, ranges[:, k]
        elif heard is not None:
            told["status"][:, 0] = np.where(heard[:, k], Status.HEARD, Status.MISSED)
            told["arrival"][:, 0] = np.where(heard[:, k], filters.time, np.nan)
        filters.correct(told)
        estimates[:, k] = filters.mean
        setting.advance(voyages)
    filters.close()
    return estimates


def plot_voyage(voyage: Voyage, found: dict[str, Floats], errors: dict[str, Floats]) -> Figure:
    """The first voyage: the float and its three tracks, and their errors over time."""
    figure, (left, right) = empty_figure(width=11.0, height=4.6, columns=2)
    left.plot(*voyage.glider[0].T, color="0.8", lw=0.5, label="glider")
    left.plot(*voyage.afloat[0].T, color="0.2", lw=2.5, label="float")
    hours = MINUTE / 3600 * np.arange(SETTLING, voyage.depth.size)
    for (name, places), colour in zip(found.items(), COLOURS, strict=False):
        left.plot(*places[0, SETTLING:].T, color=colour, lw=0.9, label=name)
        right.plot(hours, errors[name][0], color=colour, lw=0.9, label=name)
    for begin, end in DIVES:
        right.axvspan(begin, end, color="0.93", lw=0)
    left.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    left.legend(frameon=False, fontsize=8)
    right.set(xlabel="time [h], shaded: at 60 m", ylabel="error [m]", yscale="log")
    return figure


def count_steps(size: Size) -> int:
    return 2 * size.settings * round(HOURS * 3600 / MINUTE)


FLOAT_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_float, steps=count_steps)
