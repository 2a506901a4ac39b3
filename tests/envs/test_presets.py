"""Other people's settings: their published numbers, and the physics that they need (turns, noise, current, straight legs)."""

import dataclasses
import math

import gymnasium as gym
import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.motions import StraightLegs
from tagtrack.envs.presets import PRESETS
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import build_task

RANGE_ONLY = "TagTrack/RangeOnly-v0"


def simulate(
    preset: str, worlds: int, steps: int, course: tuple[float, float] = (0.0, 1.0), **overrides: object
) -> dict[str, np.ndarray]:
    """Vehicles and navigation (K, B) and fish (K, B, 4) after each step."""
    simulation = Simulation(build_task(RANGE_ONLY, preset=preset, particles=4, overrides=overrides).scenario, worlds)
    simulation.reset(seed=3)
    rows = []
    for step in range(steps + 1):
        if step > 0:
            simulation.step(np.tile(np.array(course, np.float32), (worlds, 1, 1)))
        of_world = simulation.worlds
        rows.append((of_world.vehicles[:, 0].copy(), of_world.navigation[:, 0].copy(), of_world.fish[:, 0, :, 0].astype(float)))
    vehicles, navigation, fish = (np.array(column) for column in zip(*rows, strict=True))
    return {"vehicles": vehicles, "navigation": navigation, "fish": fish}


def test_an_id_without_presets_names_those_that_have_some() -> None:
    with pytest.raises(ValueError, match="'surf_zone' of .*AreaOnly-v0; there are presets of TagTrack/Leop.*, .*RangeOnly"):
        build_task("AreaOnly-v0", preset="surf_zone")


def test_second_water_differs_in_its_water_alone() -> None:
    scenario = build_task("LeopardShark-v0", preset="surf_zone").scenario
    assert scenario.water != Scenario().water
    assert dataclasses.replace(scenario, water=Scenario().water) == build_task("LeopardShark-v0").scenario


@pytest.mark.parametrize("preset", PRESETS[RANGE_ONLY])
def test_presets_are_made_like_any_environment(preset: str) -> None:
    env = gym.make(RANGE_ONLY, preset=preset, particles=20)
    assert env.unwrapped.simulation.scenario.episode_steps == {"masmitja2023": 200}.get(preset, 256)
    observation, _ = env.reset(seed=0)
    for _ in range(50):
        assert observation in env.observation_space
        observation = env.step(env.action_space.sample())[0]


def test_belief_of_masmitja2023_starts_as_its_targets_do_and_silence_drives_it_beyond_reach() -> None:
    """All distances up to 1 km alike; two silences leave 1 % of what lies within reach, and the renewed come on top."""
    unheard = {"start.nearest": 990.0, "start.shallowest": 0.0, "start.deepest": 0.0, "fish.max_speed": 0.0}
    simulation = Simulation(build_task(RANGE_ONLY, preset="masmitja2023", particles=4000, overrides=unheard).scenario, 8)
    simulation.reset(seed=0)
    distance = np.hypot(simulation.worlds.particles[:, 0, 0, 0], simulation.worlds.particles[:, 0, 0, 1]).astype(float)
    assert stats.kstest(distance.ravel()[::8] / 1000.0, "uniform").pvalue > 1e-3
    for _ in range(2):
        simulation.step(np.ones((8, 1, 2), np.float32))
    assert not simulation.detected.any()
    distance = np.hypot(simulation.worlds.particles[:, 0, 0, 0], simulation.worlds.particles[:, 0, 0, 1])
    assert (distance < 800.0).mean() < 0.12  # 80 % at first


def test_published_numbers_of_masmitja2023() -> None:
    scenario: Scenario = PRESETS[RANGE_ONLY]["masmitja2023"]
    assert (scenario.time_step, scenario.episode_steps, scenario.vehicle.max_speed) == (30.0, 200, 1.0)
    assert scenario.vehicle.max_turn_rate * 30.0 == pytest.approx(0.3) and scenario.vehicle.random_current == 0.3
    assert scenario.fish == StraightLegs(max_speed=0.6)
    assert (scenario.start.shallowest, scenario.start.deepest, scenario.start.farthest) == (15.0, 300.0, 1000.0)
    assert (scenario.receiver.range_factor, scenario.receiver.range_tolerance, scenario.receiver.range_sigma) == (1.01, 1.0, 0.0)
    assert (scenario.water.reach, scenario.water.clear_hearing, scenario.water.noisy_share) == (900.0, 0.9, 0.0)


def test_turn_of_a_step_is_limited() -> None:
    """Asked for a right angle to the line, masmitja2023's vehicle turns by 0.3 rad a step and no more."""
    heading = simulate("masmitja2023", 50, 4)["vehicles"]["heading"]
    turns = np.abs((np.diff(heading, axis=0) + math.pi) % (2 * math.pi) - math.pi)
    assert turns.max() == pytest.approx(0.3, abs=1e-9)


def test_noise_of_the_speed_has_its_sigma() -> None:
    """1000 worlds whose vehicles keep on; the first steps, from rest, are left out."""
    vehicles = simulate("utracking_medium", 1000, 5)["vehicles"][2:]
    way = np.hypot(np.diff(vehicles["x"], axis=0), np.diff(vehicles["y"], axis=0)) / 30.0
    assert np.std(way) == pytest.approx(0.1, rel=0.1) and way.mean() == pytest.approx(1.0, abs=0.04)  # an arc's chord is shorter


def test_noise_of_the_heading_is_steered_out_and_drawn_anew() -> None:
    """Towards a belief very far off the course is one and the same: what is left of a heading is one step's noise."""
    simulation = Simulation(build_task(RANGE_ONLY, preset="utracking_medium", particles=4).scenario, 1000)
    simulation.reset(seed=3)
    for _ in range(4):
        simulation.worlds.beliefs["estimate_x"] = 1e7
        simulation.step(np.tile(np.array([1.0, 0.0], np.float32), (1000, 1, 1)))
    heading = simulation.worlds.vehicles["heading"][:, 0]
    assert np.std(heading) == pytest.approx(0.05, rel=4.0 / math.sqrt(2 * 1000))
    assert abs(heading.mean()) < 4.0 * 0.05 / math.sqrt(1000)


def test_current_differs_by_episode_and_carries_the_vehicle() -> None:
    course = simulate("masmitja2023", 500, 3, **{"vehicle.max_speed": 1e-9})
    vehicles, navigation = course["vehicles"], course["navigation"]
    drift = np.hypot(np.diff(vehicles["x"], axis=0), np.diff(vehicles["y"], axis=0)) / 30.0
    np.testing.assert_allclose(drift[0], drift[2], atol=1e-6)
    assert drift.max() <= 0.3 and drift[0].mean() == pytest.approx(0.15, abs=4 * 0.3 / math.sqrt(12 * 500))
    np.testing.assert_allclose(navigation["x"][1:], vehicles["x"][1:], atol=1e-9)  # it knows where it is all the same


def test_straight_target_keeps_course_and_speed() -> None:
    fish = simulate("masmitja2023", 300, 20)["fish"]
    assert (fish[1:, :, 2] == fish[0, :, 2]).all() and (fish[1:, :, 3] == fish[0, :, 3]).all()
    assert fish[0, :, 3].max() <= 0.6 and fish[0, :, 3].mean() == pytest.approx(0.3, abs=4 * 0.6 / math.sqrt(12 * 300))
    np.testing.assert_allclose(np.hypot(*(fish[20] - fish[0])[:, :2].T), 600.0 * fish[0, :, 3], rtol=1e-4, atol=1e-2)


@pytest.mark.parametrize(
    ("preset", "legs", "speeds"), [("utracking_medium", (35, 100), (0.2, 0.5)), ("utracking_hard", (10, 50), (0.5, 0.7))]
)
def test_legs_and_turns_keep_their_bounds(preset: str, legs: tuple[int, int], speeds: tuple[float, float]) -> None:
    fish = simulate(preset, 60, 256)["fish"]
    turns = (np.diff(fish[:, :, 2], axis=0) + math.pi) % (2 * math.pi) - math.pi
    sizes = np.abs(turns[np.abs(turns) > 1e-4])
    assert 0.6 - 1e-5 <= sizes.min() and sizes.max() <= 1.5 + 1e-5
    assert 0.3 < (turns[np.abs(turns) > 1e-4] > 0).mean() < 0.7
    for world in range(60):
        ends = np.flatnonzero(np.abs(turns[:, world]) > 1e-4)
        assert (np.diff(ends) >= legs[0]).all() and (np.diff(ends) <= legs[1] + 1).all()
    assert speeds[0] <= fish[0, :, 3].min() and fish[0, :, 3].max() <= speeds[1] + 1e-6
