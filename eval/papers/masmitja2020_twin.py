"""Area-only tracking as Masmitja et al. 2020 simulate it ("AOTT simulations"): the scenario, its filters, and iterations of it.

A vehicle circles its estimate of a tag that rests or swims at 0.2 m/s and turns right by 90 degrees after 67 minutes. The
maximum particle range (MPR) is read as in the first author's published filter (github.com/imasmitja/RLforUTracking,
tracking/target_pf.py, "area"): the disc in which particles start, the radius within which a share is spread anew, and the
distance mu about which weights change, which are a Cauchy distribution's. Not printed, and assumed here: the covariance of Eq.
8, by which particles move (``AOTT``), that a tag is heard just up to the maximum range and is at first within the circle's
radius of the vehicle, and how long a mission lasts. The share spread anew is spread before weighing.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.belief.assumptions import AOTT, Belief
from tagtrack.envs.motions import StraightLegs
from tagtrack.envs.scenario import Scenario, Start
from tagtrack.envs.sensors import PresenceReceiver
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.sim.vehicle import Vehicle
from tagtrack.envs.tag import Tag
from tagtrack.envs.task import Task
from tagtrack.eval.papers.frame import Setting
from tagtrack.eval.rollout import roll_out
from tagtrack.eval.statistics.estimate import Floats

PAPER = "masmitja2020"
TIME_STEP = 10.0  # [s]
MAX_RANGE = 250.0  # maximum tag transmission range, MTR [m]
RADIUS = 200.0  # tracker radius, TCR [m]
PARTICLE_RANGE = AOTT.renewed_radius  # maximum particles range, MPR [m]
RENEWED = AOTT.renewed_share  # ratio of the compound resampling
TURN = 67 * 60.0  # [s]: when the tag turns, to a side drawn by chance
EDGE = 1.0  # sigma of the true edge of hearing [m]: hard, for all else is "considered ideal"

RESTING = StraightLegs(max_speed=0.0)
SWIMMING = StraightLegs(
    least_speed=0.2, max_speed=0.2, shortest_leg=TURN, longest_leg=TURN, least_turn=math.pi / 2, largest_turn=math.pi / 2
)

EQUATION_22 = PresenceReceiver()  # the normal weights as the text has them, 4.5 and 9 m
PUBLISHED = PresenceReceiver(detection_sigma=1.0, silence_sigma=40.0, heavy_tails=True)  # those of the published filter [m]


def area_belief(
    particle_range: float = PARTICLE_RANGE, receiver: PresenceReceiver = PUBLISHED, mu: float | None = None
) -> Belief:
    """The filter whose particles start, are spread anew and change their weights at a particle range [m].

    Args:
        mu: the last of these, if it is another distance [m].
    """
    return replace(
        AOTT,
        receiver=replace(receiver, max_range=particle_range if mu is None else mu),
        farthest=particle_range,
        renewed_radius=particle_range,
    )


def make_scenario(
    *,
    seconds: float,
    particles: int,
    reception: float = 1.0,
    fish: StraightLegs = SWIMMING,
    belief: Belief | None = None,
    true_range: float = MAX_RANGE,
) -> Scenario:
    """The paper's experiment with the second set's parameters: a ping every 60 s, 250 m, 1 m/s."""
    return Scenario(
        time_step=TIME_STEP,
        episode_steps=round(seconds / TIME_STEP),
        vehicle=Vehicle(max_speed=1.0, max_turn_rate=0.05, heading_gain=0.05, control_interval=5.0, fix_interval=0.0),
        fish=fish,
        start=Start(nearest=0.0, farthest=RADIUS),
        tag=Tag(period=60.0),
        water=Water(reach=20 * MAX_RANGE, edge_width=1.0, clear_hearing=1.0, noisy_share=0.0),  # all losses are the receiver's
        receiver=PresenceReceiver(max_range=true_range, detection_sigma=EDGE, reception=reception),
        belief=replace(belief or area_belief(), particles=particles),
    )


def told_of(reception: float) -> Belief:
    """Eq. 22's filter, but with the reception ratio in its weights of silence."""
    return area_belief(receiver=replace(EQUATION_22, reception=reception), mu=MAX_RANGE)


def iterate(scenario: Scenario, iterations: int, setting: Setting, radius: float = RADIUS) -> Floats:
    """Localization error (iterations, steps) [m] of a vehicle that circles its estimate at a radius [m]."""
    record = roll_out(
        Task(scenario=scenario, tracks=None),
        lambda simulation: make_baseline(f"circle:{radius}", simulation),
        episodes=iterations,
        seed=setting.seed,
        threads=setting.threads,
        on_step=setting.advance,
    )
    return record.error


def resample_iterations(iterations: int, seed: int, repetitions: int = 1000) -> np.ndarray:
    """(repetitions, iterations) which iterations each repeated set of as many holds (bootstrap)."""
    return np.random.default_rng(seed).integers(0, iterations, (repetitions, iterations))
