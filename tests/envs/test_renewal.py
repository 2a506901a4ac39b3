"""Where new particles come from: compound resampling, the ring of a first range, and the ring that ends a refuted belief."""

import math

import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.belief.assumptions import Belief, filter_rule
from tagtrack.envs.belief.renewal import is_refuted, renew, scatter_on_ring
from tagtrack.envs.belief.row import BELIEF, make_scratch
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import measurement
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.sensors import RangeReceiver
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.tag import Tag

STREAM = (np.uint64(7), np.uint64(0), np.uint64(0), np.uint64(4))
NONE_CARRIED = np.zeros(0, np.float32)  # every correction resamples
RANGING = Belief(particles=40_000, receiver=RangeReceiver(range_sigma=6.0), renewed_share=0.015, renewed_radius=300.0)
RULE = to_record(filter_rule(RANGING, Tag(period=10.0)))[0]


def test_compound_resampling_moves_its_share_to_a_disc_about_the_estimate_and_takes_from_all_alike() -> None:
    belief = np.zeros(1, BELIEF)
    belief["estimate_x"], belief["estimate_y"] = 1000.0, -500.0
    particles = np.zeros((4, RANGING.particles), np.float32)
    renew(particles, NONE_CARRIED, belief[0], STREAM, 0, RULE)
    moved = np.flatnonzero(particles[0])
    assert moved.size == 600 and set(np.diff(moved)) <= {66, 67}  # 1.5 % of 40,000, every 66.7th
    distance = np.hypot(particles[0, moved] - 1000.0, particles[1, moved] + 500.0)
    assert stats.kstest((distance / 300.0) ** 2, "uniform").pvalue > 1e-3  # uniform over the disc
    direction = np.arctan2(particles[1, moved] + 500.0, particles[0, moved] - 1000.0)
    assert stats.kstest(direction, "uniform", (-math.pi, 2.0 * math.pi)).pvalue > 1e-3
    assert not particles[2:].any()


@pytest.mark.parametrize(("slant_range", "depth"), [(250.0, 30.0), (40.0, 38.0), (20.0, 60.0)])
def test_ring_of_a_range_lies_where_a_fish_of_that_depth_can_be(slant_range: float, depth: float) -> None:
    """Every slant range within four sigmas of the reading, none shorter than the depth, in all directions, all finite."""
    told = measurement(time=0.0, x=80.0, y=0.0, depth=depth, readings=[slant_range])
    particles = np.zeros((4, RANGING.particles), np.float32)
    scatter_on_ring(particles, NONE_CARRIED, told[0], STREAM, 0, RULE, make_scratch(RANGING.particles))
    slant = np.sqrt((particles[0].astype(float) - 80.0) ** 2 + particles[1].astype(float) ** 2 + depth**2)
    assert np.isfinite(particles).all()
    least, largest = max(slant_range - 24.0, depth), max(slant_range + 24.0, depth + 24.0)
    assert slant.min() >= least - 0.01 and slant.max() <= largest + 0.01
    assert np.abs(np.hypot(*np.array([particles[0] - 80.0, particles[1]]).mean(axis=1))) < 0.02 * largest


def test_belief_is_refuted_when_hardly_any_particle_fits() -> None:
    peak, floor = 1.0 / (math.sqrt(2.0 * math.pi) * 6.0), 0.001
    weight = np.full(1000, floor, np.float32)
    weight[:4] += peak
    assert is_refuted(weight, 1, RULE)
    weight[:6] += peak
    assert not is_refuted(weight, 1, RULE)


def test_filter_that_was_led_astray_is_back_within_a_quarter_of_an_hour() -> None:
    """All particles 500 m off in every world: a ring, a turn, and the fish is found (median below 20 m)."""
    simulation = Simulation(with_overrides(SCENARIOS["TagTrack/RangeOnly-v0"], {"belief.particles": 1000}), 64)
    simulation.reset(seed=1)
    crossing = np.tile(np.array([1.0, 0.8], np.float32), (64, 1, 1))
    for _ in range(60):
        simulation.step(crossing)
    simulation.worlds.particles[:, 0, 0, 0] += 500.0
    simulation.worlds.beliefs["mean_x"] += 500.0
    simulation.worlds.beliefs["estimate_x"] += 500.0
    for _ in range(90):
        simulation.step(crossing)
    error = simulation.error[:, 0, 0]
    assert np.median(error) < 20.0 and (error < 60.0).mean() > 0.9
