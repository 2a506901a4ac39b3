"""Fleets: rows of vehicles, equal angles on a circle, tags that are shared out, and what that is worth."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from tagtrack.baselines.division import Assignment, Uncertain
from tagtrack.baselines.formation import crowding
from tagtrack.baselines.heuristic import InformedHeuristic
from tagtrack.baselines.registry import BASELINES, make_baseline
from tagtrack.baselines.sharing import assign_jointly, choose_in_turn
from tagtrack.baselines.surroundings import read_surroundings
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import build_task
from tagtrack.eval.rollout import SeedBlock, block_seed, roll_out

Make = Callable[..., Simulation]


def rows_of(simulation: Simulation) -> np.ndarray:
    return simulation.observation.reshape(-1, simulation.observation.shape[-1])


def sail(simulation: Simulation, policy: Any, steps: int) -> list[Any]:
    """The states after each step."""
    states, state = [], None
    for _ in range(steps):
        action, state = policy.predict(rows_of(simulation), state)
        simulation.step(action.reshape(simulation.num_worlds, simulation.scenario.vehicles, -1))
        states.append(state)
    return states


def mean_error(env_id: str, specification: str, episodes: int, **fleet: Any) -> np.ndarray:
    """(E,) [m] in paired episodes that no table uses."""
    task = build_task(env_id, particles=500, **fleet)
    seed = block_seed(SeedBlock.VALIDATION, 0)
    return roll_out(task, lambda s: make_baseline(specification, s), episodes=episodes, seed=seed).error.mean(axis=1)


@pytest.mark.parametrize("name", [name for name in BASELINES if getattr(BASELINES[name], "fleets", True)])
@pytest.mark.parametrize("modem", ["perfect", "none", "tdma"])
@pytest.mark.parametrize("steer_by", ["auto", "line", "chosen"])
def test_every_baseline_steers_a_fleet_with_any_modem(make_simulation: Make, name: str, modem: str, steer_by: str) -> None:
    simulation = make_simulation(worlds=2, vehicles=3, targets=2, modem=modem, steer_by=steer_by)
    simulation.reset(seed=3)
    policy, state = make_baseline(name, simulation), None
    for _ in range(15):
        action, state = policy.predict(rows_of(simulation), state)
        assert action.shape == (6, len(simulation.action_names)) and action.dtype == np.float32
        assert (np.abs(action) <= 1.0).all()
        simulation.step(action.reshape(2, 3, -1))


@pytest.mark.parametrize("name", [name for name in BASELINES if not issubclass(BASELINES[name], InformedHeuristic)])
def test_worlds_of_a_batch_act_as_one_alone(make_simulation: Make, name: str) -> None:
    fleet = {"vehicles": 2, "targets": 3, "modem": "tdma", "vehicle.battery": 0.2, "vehicle.battery_spread": 0.9}
    actions = []
    for seed, worlds in ((5, 3), (6, 1)):
        simulation = make_simulation(worlds=worlds, **fleet)
        simulation.reset(seed=seed)
        policy, state, kept = make_baseline(name, simulation), None, []
        for _ in range(25):  # until batteries are empty
            action, state = policy.predict(rows_of(simulation), state)
            simulation.step(action.reshape(worlds, 2, -1))
            kept.append(action.reshape(worlds, 2, -1))
        actions.append(np.array(kept))
    np.testing.assert_array_equal(actions[0][:, 1], actions[1][:, 0])


def test_course_to_a_tag_is_the_same_in_every_frame(make_simulation: Make) -> None:
    courses = []
    for frame in ("heading", "line", "chosen"):
        simulation = make_simulation(targets=3, steer_by=frame)
        simulation.reset(seed=4)
        action, _ = make_baseline("uncertain", simulation).predict(rows_of(simulation))
        simulation.step(action[:, None])
        courses.append(float(simulation.worlds.vehicles[0, 0]["course"]))
    np.testing.assert_allclose(np.angle(np.exp(1j * (np.array(courses) - courses[0]))), 0.0, atol=1e-5)


def test_surroundings_are_what_the_vehicle_believes(make_simulation: Make) -> None:
    simulation = make_simulation(worlds=2, vehicles=3, targets=2)
    simulation.reset(seed=1)
    sail(simulation, make_baseline("random", simulation), 20)
    around = read_surroundings(rows_of(simulation), simulation.scenario)
    navigation = simulation.worlds.navigation
    for row, (b, v) in enumerate(itertools.product(range(2), range(3))):
        turn = np.exp(1j * navigation[b, v]["heading"])
        own = navigation[b, v]["x"] + 1j * navigation[b, v]["y"]
        mates = navigation[b]["x"] + 1j * navigation[b]["y"]
        tags = simulation.estimate[b, 0] @ np.array([1.0, 1j])
        np.testing.assert_allclose(around.places[row] @ np.array([1.0, 1j]), (mates - own) / turn, atol=1e-3)
        np.testing.assert_allclose(around.tags[row] @ np.array([1.0, 1j]), (tags - own) / turn, atol=1e-3)
        spread = np.sqrt(np.trace(simulation.covariance[b, 0], axis1=1, axis2=2))
        np.testing.assert_allclose(around.spread[row], spread, rtol=1e-3)
    assert np.allclose(around.age, 0.0)


def test_crowding_is_the_difference_of_the_gaps() -> None:
    """Clockwise from 90 degrees: 60 degrees to the next ahead, 120 to the next behind; one alone is not crowded."""
    angles = np.radians([90.0, 30.0, 210.0])
    places = 20.0 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)[None]
    centre, lag = np.zeros((1, 2)), np.zeros((1, 3))
    assert crowding(centre, places, lag, np.array([0]))[0] == pytest.approx(1 / 3)
    told_late = np.array([[0.0, 20.0 * np.radians(30.0), 0.0]])  # the one ahead has gone on 30 degrees since
    assert crowding(centre, places, told_late, np.array([0]))[0] == pytest.approx((120 - 90) / 210)
    unknown = np.full_like(places, np.nan)
    unknown[:, 0] = places[:, 0]
    assert crowding(centre, unknown, lag, np.array([0]))[0] == 0.0


@pytest.mark.parametrize(("vehicles", "env_id"), [(2, "LeopardShark-v0"), (3, "RangeOnly-v0"), (3, "LeopardSharkStandoff-v0")])
def test_angles_between_vehicles_on_a_circle_become_equal(make_exact_simulation: Make, vehicles: int, env_id: str) -> None:
    """By a wider circle or, where it can be chosen, by speed; after 560 s by speed up to 10 degrees are left."""
    simulation = make_exact_simulation(env_id, worlds=6, vehicles=vehicles, **{"start.formation": "line"})
    simulation.reset(seed=2)
    policy = make_baseline("circle:40", simulation)
    for _ in range(280):
        simulation.worlds.particles[:, :, :, :2] = simulation.worlds.fish[:, None, :, :2]
        sail(simulation, policy, steps=1)
    away = simulation.vehicle_position - simulation.fish_position[:, :1]
    angles = np.sort(np.degrees(np.arctan2(away[..., 1], away[..., 0])), axis=1)
    gaps = np.diff(np.concatenate([angles, angles[:, :1] + 360.0], axis=1), axis=1)
    np.testing.assert_allclose(gaps, 360.0 / vehicles, atol=15.0)


def test_circle_about_the_middle_of_all_tags(make_exact_simulation: Make) -> None:
    simulation = make_exact_simulation(worlds=4, vehicles=2, targets=3)
    simulation.reset(seed=2)
    simulation.worlds.particles[:, :, :, :2] = simulation.worlds.fish[:, None, :, :2]
    sail(simulation, make_baseline("circle:radius=50,centroid=1,spacing=0", simulation), steps=280)
    away = simulation.vehicle_position - simulation.fish_position.mean(axis=1)[:, None]
    np.testing.assert_allclose(np.hypot(away[..., 0], away[..., 1]), 50.0, rtol=0.05)


def test_circles_of_their_own_are_as_far_apart_as_asked(make_exact_simulation: Make) -> None:
    simulation = make_exact_simulation(worlds=4, vehicles=3)
    simulation.reset(seed=2)
    simulation.worlds.particles[:, :, :, :2] = simulation.worlds.fish[:, None, :, :2]
    sail(simulation, make_baseline("circle:radius=20,radius_step=15,spacing=0", simulation), steps=280)
    np.testing.assert_allclose(simulation.range[..., 0], np.tile([20.0, 35.0, 50.0], (4, 1)), rtol=0.05)


@pytest.mark.parametrize(("vehicles", "tags"), [(1, 4), (2, 4), (3, 3), (5, 3), (4, 2), (5, 1)])
def test_joint_assignment_is_the_best_of_all(vehicles: int, tags: int) -> None:
    """Against every way to give each tag to as many vehicles as evenness allows, and against scipy where none is shared."""
    generator = np.random.default_rng(vehicles * 10 + tags)
    least, most = vehicles // tags, -(-vehicles // tags)
    for _ in range(8):
        value = generator.normal(0.0, 20.0, (vehicles, tags))
        rows = np.repeat(value[None], vehicles, axis=0)
        found = assign_jointly(rows, np.arange(vehicles))
        counts = [np.bincount(way, minlength=tags) for way in itertools.product(range(tags), repeat=vehicles)]
        ways = [way for way, count in zip(itertools.product(range(tags), repeat=vehicles), counts, strict=True)
                if least <= count.min() and count.max() <= most]  # fmt: skip
        best = max(value[np.arange(vehicles), way].sum() for way in ways)
        assert value[np.arange(vehicles), found].sum() == pytest.approx(best)
        if vehicles <= tags:
            np.testing.assert_array_equal(found, linear_sum_assignment(value, maximize=True)[1])


def test_vehicles_choose_in_turn_what_no_one_before_has_taken() -> None:
    value = np.array([[9.0, 5.0, 1.0], [8.0, 7.0, 1.0], [9.0, 2.0, 0.0], [3.0, 2.0, 1.0]])
    rows = np.repeat(value[None], 4, axis=0)
    assert choose_in_turn(rows, np.arange(4)).tolist() == [0, 1, 2, 0]  # the fourth: all are taken once
    rows[:, 0] = np.nan  # nobody knows of the first
    rows[0, 0] = value[0]
    assert choose_in_turn(rows, np.arange(4)).tolist() == [0, 0, 1, 2]
    assert assign_jointly(rows, np.arange(4)).tolist()[0] == 0


@pytest.mark.parametrize("kind", [Assignment, Uncertain])
def test_a_choice_is_held(make_simulation: Make, kind: type[Uncertain]) -> None:
    """Twelve seconds are six steps."""
    simulation = make_simulation(worlds=8, vehicles=2, targets=4)
    simulation.reset(seed=0)
    tags = np.array([state.tag for state in sail(simulation, kind(scenario=simulation.scenario), 60)])
    changes = np.flatnonzero((np.diff(tags, axis=0) != 0).any(axis=1)) + 1
    assert len(changes) > 3
    assert (changes % 6 == 0).all()
    two = tags.reshape(60, 8, 2)
    assert (two[..., 0] != two[..., 1]).all()  # both know the same, so neither takes the other's


def test_uncertain_beats_the_nearest_circle_with_more_tags_than_vehicles() -> None:
    """7.5 m against 11 m; in 24 episodes the difference has a standard error of 0.8 m."""
    fleet = {"vehicles": 2, "tags": 4}
    circle, uncertain = (mean_error("LeopardShark-v0", name, 24, **fleet) for name in ("circle", "uncertain"))
    assert (circle - uncertain).mean() > 1.0


def test_three_vehicles_halve_the_error_of_one_that_measures_ranges() -> None:
    """5.6 m against 13; in 32 episodes the ratio has a standard error of 0.04."""
    one, three = (mean_error("RangeOnly-v0", "circle", 32, vehicles=vehicles) for vehicles in (1, 3))
    assert three.mean() <= 0.5 * one.mean()


def test_half_a_fleet_is_refused(make_simulation: Make) -> None:
    simulation = make_simulation(vehicles=3)
    simulation.reset(seed=0)
    with pytest.raises(ValueError, match="observations must be of whole fleets, 3 rows for each world, got 2 rows"):
        make_baseline("circle", simulation).predict(rows_of(simulation)[:2])
    with pytest.raises(ValueError, match="observations must be of all 1 worlds of 3 vehicles, got 6"):
        make_baseline("oracle_circle", simulation).predict(np.tile(rows_of(simulation), (2, 1)))
