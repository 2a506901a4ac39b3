"""The planner goes where readings tell most, by tables that say what the core's own models say."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import ndtr

from tagtrack.baselines.information import Information, expect_track
from tagtrack.baselines.information_loops import add_up_information
from tagtrack.baselines.particle_sample import draw_evenly
from tagtrack.baselines.reading_tables import tabulate_readings
from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.sensors.presence import normal_cdf
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.simulation import Simulation

Make = Callable[..., Simulation]
Sight = Callable[..., np.ndarray]


def information_of(particles: list[tuple[float, float]], headings: list[float], chance: float = 1.0) -> np.ndarray:
    """(K,) what one ping tells a vehicle at the origin on each heading [degrees] about particles at these places [m]."""
    x, y = np.array(particles, np.float32).T[:, None, :]
    angle = np.radians(np.array(headings, np.float32)).reshape(1, -1, 1)
    likelihood = tabulate_readings(Belief(weight_floor=0.0), Water()).likelihood
    entropy = -(likelihood * np.log(np.maximum(likelihood, 1e-30))).sum(axis=1)
    information = np.zeros((1, len(headings)), np.float32)
    zero = np.zeros_like(angle)
    table = np.full(200, chance, np.float32)
    none = np.zeros(1, np.float32)
    poses = (zero, zero, np.cos(angle), np.sin(angle))
    add_up_information(x, y, *poses, none, none, table, likelihood, entropy, False, np.empty_like(likelihood[0]), information)
    return information[0]


def test_mirror_pair_tells_nothing_on_the_line_and_one_bit_across_it() -> None:
    """Port and starboard read alike from between; with one ahead and one astern no reading fits both: ln 2."""
    np.testing.assert_allclose(information_of([(0, 40), (0, -40)], [0, 90]), [0.0, math.log(2)], atol=1e-5)


def test_information_is_worth_the_chance_of_hearing_it() -> None:
    assert information_of([(0, 40), (0, -40)], [90], chance=0.3)[0] == pytest.approx(0.3 * math.log(2), abs=1e-5)


def test_readings_beyond_the_edge_of_hearing_tell_nothing() -> None:
    chance = tabulate_readings(Belief(), Water()).chance
    assert chance[0] == pytest.approx(0.8 * 0.93**2 + 0.2 * 0.15**2, rel=1e-3)
    assert chance[100] == pytest.approx(chance[0] / 4, rel=0.1)  # at L either hydrophone hears half
    assert chance[-1] < 1e-12


def test_likelihood_peaks_at_the_units_of_equation_5() -> None:
    """Ahead is 90 degrees from the perpendicular: -0.729 + 0.162 + 8.523 - 0.2757 = 7.68 units; abeam -0.28, astern -8.18."""
    likelihood = tabulate_readings(Belief(), Water()).likelihood
    np.testing.assert_allclose(likelihood.sum(axis=1), 1.0, rtol=1e-5)
    astern, abeam, ahead = (likelihood[row].argmax() - 9 for row in (0, len(likelihood) // 2, -1))
    assert (astern, abeam, ahead) == (-8, 0, 8)


def test_normal_chance_keeps_its_digits_far_from_the_mean() -> None:
    z = np.linspace(-14.9, 14.9, 2001).reshape(3, -1)
    np.testing.assert_allclose(normal_cdf(z), ndtr(z), rtol=1e-12)
    np.testing.assert_array_equal(normal_cdf(np.array([-np.inf, -40.0, 0.0, 40.0, np.inf])), [0.0, 0.0, 0.5, 1.0, 1.0])


def test_planner_turns_off_the_line_to_tell_port_from_starboard(make_simulation: Make, sight: Sight, course_of: Sight) -> None:
    simulation = make_simulation()
    simulation.reset(seed=0)
    simulation.worlds.navigation[0, 0] = (0.0, 0.0, 0.0, 0.0, 1.0, True)
    side = np.where(np.arange(64) % 2 == 0, 1.0, -1.0)
    simulation.worlds.particles[0, 0, 0, 0] = 30.0
    simulation.worlds.particles[0, 0, 0, 1] = 30.0 * side
    action, _ = Information(simulation=simulation).predict(sight(distance=30.0))
    assert 30 <= abs(course_of(action)[0]) <= 150


def test_course_is_held_between_plans(make_simulation: Make, sight: Sight, course_of: Sight) -> None:
    simulation = make_simulation()
    simulation.reset(seed=0)
    policy = Information(simulation=simulation, hold=4.0 * simulation.scenario.time_step)
    action, state = policy.predict(sight(bearing=0))
    courses = [course_of(action)[0]]
    for _ in range(4):
        simulation.worlds.particles[...] = np.random.default_rng(1).normal(0.0, 30.0, simulation.worlds.particles.shape)
        action, state = policy.predict(sight(bearing=20), state)
        courses.append(course_of(action)[0] + 20)  # absolute: the line has turned
    np.testing.assert_allclose(courses[:4], courses[0], atol=1e-4)
    assert courses[4] != pytest.approx(courses[0], abs=1.0)


def test_planner_expects_the_vehicle_where_it_goes(make_exact_simulation: Make) -> None:
    simulation = make_exact_simulation(worlds=3)
    simulation.reset(seed=3)
    scenario = simulation.scenario
    course = np.array([0.3, 2.0, -1.5])
    expected = expect_track(
        simulation.worlds.navigation[:, 0].copy(), course[:, None], scenario.vehicle, scenario.time_step, steps=20
    )
    for s in range(20):
        line = np.arctan2(*(simulation.mean[:, 0, 0] - simulation.vehicle_position[:, 0]).T[::-1])
        simulation.step(np.stack([np.cos(course - line), np.sin(course - line)], axis=-1)[:, None])
        place = np.stack([expected.x[:, 0, s], expected.y[:, 0, s]], axis=-1)
        np.testing.assert_allclose(simulation.vehicle_position[:, 0], place, atol=0.05)  # a chord is 0.1 % less than its arc


def test_planner_keeps_out_of_its_perimeter(make_simulation: Make, sight: Sight, course_of: Sight) -> None:
    simulation = make_simulation()
    simulation.reset(seed=0)
    navigation = simulation.worlds.navigation[0, 0]
    simulation.worlds.beliefs["mean_x"] = navigation["x"] + 32.0
    simulation.worlds.beliefs["mean_y"] = navigation["y"]
    heading = np.degrees(navigation["heading"])
    observation = sight(distance=32.0, heading=heading, bearing=-heading)
    action, _ = Information(simulation=simulation, perimeter=31.0).predict(observation)
    assert abs(course_of(action)[0]) >= 60


def test_range_tells_which_of_two_places_ahead_is_right_and_nothing_about_two_abeam() -> None:
    """Particles 100 m apart along the line of sight: one bit; mirrored across it: none."""
    scenario = SCENARIOS["TagTrack/RangeOnly-v0"]
    likelihood = tabulate_readings(scenario.belief, scenario.water).likelihood
    np.testing.assert_allclose(likelihood.sum(axis=1), 1.0, rtol=1e-5)
    assert presence_or_range([(200, 0), (300, 0)], likelihood) == pytest.approx(math.log(2), abs=1e-3)
    assert presence_or_range([(200, 100), (200, -100)], likelihood) == pytest.approx(0.0, abs=1e-5)


def test_presence_tells_most_at_the_edge_and_little_within() -> None:
    scenario = SCENARIOS["TagTrack/AreaOnly-v0"]
    likelihood = tabulate_readings(scenario.belief, scenario.water).likelihood
    across_edge, within = (presence_or_range([(near, 0), (near + 150, 0)], likelihood) for near in (265, 20))
    assert across_edge > 10 * within > 0
    assert tabulate_readings(scenario.belief, scenario.water).chance.tolist() == [1.0]  # silence tells, too


def presence_or_range(particles: list[tuple[float, float]], likelihood: np.ndarray) -> float:
    """What one ping at the origin tells [nats] where readings go by distance."""
    x, y = np.array(particles, np.float32).T[:, None, :]
    entropy = -(likelihood * np.log(np.maximum(likelihood, 1e-30))).sum(axis=1)
    information, place, none = np.zeros((1, 1), np.float32), np.zeros((1, 1, 1), np.float32), np.zeros(1, np.float32)
    chance, mixture = np.ones(1, np.float32), np.empty_like(likelihood[0])
    add_up_information(x, y, place, place, place + 1, place, none, none, chance, likelihood, entropy, True, mixture, information)
    return float(information[0, 0])


def test_particles_that_carry_weights_are_drawn_by_them() -> None:
    """A fifth of the sum to each of five: 0.1, 0.3 ... of it lie where counted by hand."""
    np.testing.assert_array_equal(draw_evenly(np.ones((1, 10), np.float32), 5), [[1, 3, 5, 7, 9]])
    np.testing.assert_array_equal(draw_evenly(np.array([[0.0, 6.0, 0.0, 3.5, 0.5]] * 2), 5), [[1, 1, 1, 3, 3]] * 2)
    np.testing.assert_array_equal(draw_evenly(np.array([[0.0, 0.0, 2.0]]), 3), [[2, 2, 2]])


def test_planner_does_not_look_at_particles_without_weight(make_simulation: Make, sight: Sight, course_of: Sight) -> None:
    """One mirror image weighs nothing, so that there is nothing to tell apart: the plan is that of the other alone."""
    side = np.where(np.arange(64) % 2 == 0, 1.0, -1.0)
    courses = []
    for across, weight in ((side, side + 1.0), (1.0, 1.0), (side, 1.0)):
        simulation = make_simulation(**{"belief.resample_below": 0.5})
        simulation.reset(seed=0)
        simulation.worlds.navigation[0, 0] = (0.0, 0.0, 0.0, 0.0, 1.0, True)
        simulation.worlds.particles[0, 0, 0, 0] = 30.0
        simulation.worlds.particles[0, 0, 0, 1] = 30.0 * across
        simulation.worlds.carried[0, 0, 0] = weight
        action, _ = Information(simulation=simulation).predict(sight(distance=30.0))
        courses.append(float(course_of(action)[0]))
    assert courses[0] == courses[1] != courses[2]
