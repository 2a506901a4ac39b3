"""Circles have the radius they are asked for."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tagtrack.baselines.circle import circling_course
from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.simulation import Simulation

Make = Callable[..., Simulation]


def sail(simulation: Simulation, policy: Any, steps: int) -> np.ndarray:
    """(K, B) distances to the fish."""
    distances, state = [], None
    for _ in range(steps):
        action, state = policy.predict(simulation.observation[:, 0], state)
        simulation.step(action[:, None])
        distances.append(simulation.range[:, 0, 0].copy())
    return np.array(distances)


def reveal_fish(simulation: Simulation) -> None:
    """Put all particles on the fish, which rests: the belief is perfect and stays so."""
    simulation.worlds.particles[:, :, :, :2] = simulation.worlds.fish[:, None, :, :2]


@pytest.mark.parametrize("radius", [15.0, 40.0])
@pytest.mark.parametrize("time_step", [1.0, 2.0])
def test_circle_converges_to_its_radius(make_exact_simulation: Make, radius: float, time_step: float) -> None:
    simulation = make_exact_simulation(worlds=8, time_step=time_step)
    simulation.reset(seed=5)
    reveal_fish(simulation)
    distances = sail(simulation, make_baseline(f"circle:{radius}", simulation), steps=300)
    np.testing.assert_allclose(distances[-60:], radius, rtol=0.02)


def test_oracle_circles_the_true_fish_whatever_the_belief(make_exact_simulation: Make) -> None:
    simulation = make_exact_simulation(worlds=4, **{"water.clear_hearing": 0.0, "water.noisy_hearing": 0.0})
    simulation.reset(seed=5)
    distances = sail(simulation, make_baseline("oracle_circle:25", simulation), steps=300)
    assert (simulation.error > 5.0).all()
    # The course is relative to a line that turns as the vehicle passes the belief.
    np.testing.assert_allclose(distances[-60:], 25.0, rtol=0.1)


def test_course_leads_in_from_afar_and_out_from_within(make_simulation: Make) -> None:
    scenario = make_simulation().scenario
    afar, outside, inside = np.degrees(circling_course(np.array([500.0, 40.0, 12.0]), 20.0, scenario))
    assert abs(afar) < 5
    assert 0 < outside < 60 < inside


def test_pursuit_is_straight_ahead_and_stops_at_its_perimeter(make_simulation: Make, sight: Callable[..., np.ndarray]) -> None:
    action, state = make_baseline("pursuit", make_simulation()).predict(sight(bearing=[0.0, 130.0]))
    np.testing.assert_array_equal(action, [[1.0, 0.0], [1.0, 0.0]])
    assert state is None
    policy = make_baseline("pursuit:30", make_simulation("LeopardSharkStandoff-v0"))
    assert policy.predict(sight(distance=[29.0, 31.0]))[0][:, 2].tolist() == [-1.0, 1.0]


def test_stationary_rests_where_it_can_and_else_turns_on_the_spot(make_exact_simulation: Make) -> None:
    for env_id, reach in (("LeopardSharkStandoff-v0", 0.0), ("LeopardShark-v0", None)):
        simulation = make_exact_simulation(env_id, worlds=4)
        vehicle = simulation.scenario.vehicle
        simulation.reset(seed=1)
        sail(simulation, make_baseline("stationary", simulation), steps=50)
        distance = np.hypot(*simulation.vehicle_position[:, 0].T)
        assert (distance <= (2.2 * vehicle.max_speed / vehicle.max_turn_rate if reach is None else reach)).all()
