"""Lin et al. 2013, IV.C.3: the way back of a belief that was led astray, with and without lines 9 to 16 of Alg. 2.

The paper says that in simulation there were "repeated cases of failure to recover" without these lines, and prints no number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.recovery import Recovery, SecondResampling
from tagtrack.envs.scenario import TIME_OF_FLIGHT
from tagtrack.envs.sensors import Measurements
from tagtrack.envs.simulation import Simulation
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting, Size, make_row
from tagtrack.eval.papers.lin2013_twin import Floats, with_measurements
from tagtrack.eval.plots import COLOURS, empty_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER, TABLE = "lin2013", "Alg. 2"
TRACKED = 120.0  # [s] before the particles are moved
WATCHED = 120.0  # [s] after it
OFFSET, HALF_WIDTH = 130.0, 15.0  # [m] of the square into which all particles are moved: none is left within 100 m of the fish
BACK = 15.0  # [m]: an error below it counts as recovered
SLOWER = 0.1  # alpha_fast, which the paper leaves open
GROUP = 20  # missions that make one repetition, whose shares and means are compared

RATES = TIME_OF_FLIGHT.belief.recovery
WAYS = {
    "as printed": SecondResampling.AS_PRINTED,
    "lines 9 to 16 where particles are random": SecondResampling.WITH_RANDOM,
    "without lines 9 to 16": SecondResampling.NEVER,
    "without random particles": None,
}


@dataclass(frozen=True, kw_only=True)
class RecoveryVariant:
    """The comparison under one belief."""

    table: str
    fewer: int = 1  # by how many times fewer particles
    measurements: Measurements = Measurements.BOTH
    fast_rate: float = RATES.fast_rate
    note: str


NOTE = (
    "TimeOfFlight-v0 under the three-step controller; after two minutes all particles are moved 130 m off. Ours: groups of 20 "
    "missions; who is not back counts with 120 s. The paper tells of repeated failures without lines 9 to 16, but prints no "
    "number. Ours come back just as often, some 4 s later; without random particles none does."
)
ON_RATE = "As Alg. 2 with random particles that come more slowly: so is the way back, and fewer missions find it in time."
ON_FEWER = "As Alg. 2 with 100 particles: the way back is longer, and what lines 9 to 16 save of it hardly shows."
ON_ANGLE = (
    "As Alg. 2 with angles alone: longest of all. Lines 9 to 16 are no help here, if anything a hindrance: fewer missions come "
    "back with them."
)

VARIANTS = (
    RecoveryVariant(table=TABLE, note=NOTE),
    RecoveryVariant(table=f"{TABLE}, a tenth of the particles", fewer=10, note=ON_FEWER),
    RecoveryVariant(table=f"{TABLE}, by angle alone", measurements=Measurements.ANGLE, note=ON_ANGLE),
    RecoveryVariant(table=f"{TABLE}, alpha_fast {SLOWER:g}", fast_rate=SLOWER, note=ON_RATE),
)


def run_recovery(setting: Setting) -> Findings:
    """Every way under every belief, on the same fish."""
    rows: list[Row] = []
    pictures = {}
    for variant in VARIANTS:
        particles = max(setting.size.particles // variant.fewer, 1)
        receiver = with_measurements(TIME_OF_FLIGHT.belief.receiver, variant.measurements)
        belief = replace(TIME_OF_FLIGHT.belief, particles=particles, receiver=receiver)
        errors = {way: errors_astray(replace(belief, recovery=recovery_of(variant, way)), setting) for way in WAYS}
        rows += rows_of(variant, errors)
        if variant is VARIANTS[0]:
            pictures = {"lin2013_alg_2": plot_recovery(errors)}
    return Findings(rows=rows, figures=pictures)


def recovery_of(variant: RecoveryVariant, way: str) -> Recovery:
    second = WAYS[way]
    return Recovery() if second is None else replace(RATES, fast_rate=variant.fast_rate, second_resampling=second)


def errors_astray(belief: Belief, setting: Setting) -> Floats:
    """(K, missions) errors [m] at each step after all particles were moved away, under the three-step controller."""
    scenario = replace(TIME_OF_FLIGHT, belief=belief)
    simulation = Simulation(scenario, setting.size.astray, threads=setting.threads)
    observation = simulation.reset(setting.seed)
    policy, state = make_baseline("three_step", simulation), None
    moved, last = (round(seconds / scenario.time_step) for seconds in (TRACKED, TRACKED + WATCHED))
    errors = []
    for step in range(last):
        if step == moved:
            lead_astray(simulation, np.random.default_rng([setting.seed, 7]))
        starts = np.full(simulation.num_worlds, step == 0)
        actions, state = policy.predict(observation[:, 0], state, starts, deterministic=True)
        simulation.step(actions[:, np.newaxis])
        setting.advance(simulation.num_worlds)
        if step >= moved:
            errors.append(simulation.error[:, 0, 0].copy())
    simulation.close()
    return np.array(errors)


def lead_astray(simulation: Simulation, generator: np.random.Generator) -> None:
    """Move all particles into a square off the fish, to a random side of it, and the estimate with them."""
    beliefs, particles = simulation.worlds.beliefs[:, 0, 0], simulation.worlds.particles[:, 0, 0]
    side = generator.uniform(0.0, 2.0 * np.pi, simulation.num_worlds)
    for axis, offset in enumerate((OFFSET * np.cos(side), OFFSET * np.sin(side))):
        centre = simulation.fish_position[:, 0, axis] + offset
        particles[:, axis] = centre[:, np.newaxis] + generator.uniform(-HALF_WIDTH, HALF_WIDTH, particles[:, axis].shape)
        for name in ("mean", "estimate"):
            beliefs[f"{name}_{'xy'[axis]}"] = particles[:, axis].mean(axis=-1)


def time_back(errors: Floats) -> Floats:
    """(missions,) time [s] until the error (K, missions) falls below ``BACK``; infinite where it does not."""
    back = errors < BACK
    return np.where(back.any(axis=0), TIME_OF_FLIGHT.time_step * (back.argmax(axis=0) + 1), np.inf)


def rows_of(variant: RecoveryVariant, errors: Mapping[str, Floats]) -> list[Row]:
    """Share back, time and error, each of groups of missions."""
    make = partial(make_row, paper=PAPER, table=variant.table, note=variant.note)
    rows = []
    for way, error in errors.items():
        groups = np.array_split(np.arange(error.shape[1]), max(error.shape[1] // GROUP, 1))
        time = time_back(error)
        figures = {
            ("back within two minutes", "%"): [100.0 * np.isfinite(time[group]).mean() for group in groups],
            ("time until then", "s"): [np.minimum(time[group], WATCHED).mean() for group in groups],
            ("mean error", "m"): [error[:, group].mean() for group in groups],
        }
        rows += [make(values, row=way, column=column, unit=unit) for (column, unit), values in figures.items()]
    return rows


def plot_recovery(errors: Mapping[str, Floats]) -> Figure:
    """Mean error and share of the missions that are not back yet, over the two minutes."""
    figure, (left, right) = empty_figure(width=9.5, height=4.2, columns=2)
    for (way, error), colour in zip(errors.items(), COLOURS, strict=False):
        time = TIME_OF_FLIGHT.time_step * np.arange(1, error.shape[0] + 1)
        left.plot(time, error.mean(axis=1), color=colour, lw=1.6, label=way)
        away = 100.0 * (time_back(error) > time[:, np.newaxis]).mean(axis=1)
        right.step(time, away, where="post", color=colour, lw=1.6)
    left.set(ylabel="mean error [m]", ylim=(0, None))
    right.set(ylabel=f"not yet below {BACK:g} m [% of missions]", ylim=(0, 102))
    for axes in (left, right):
        axes.set(xlabel="time since all particles were moved [s]", xlim=(0, WATCHED))
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


def count_steps(size: Size) -> int:
    return len(VARIANTS) * len(WAYS) * size.astray * round((TRACKED + WATCHED) / TIME_OF_FLIGHT.time_step)


RECOVERY_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_recovery, steps=count_steps)
