"""The vehicle: P control of the heading, its limits, and what it believes of its own place (Clark et al. 2013, 3, 4.2).

Bounds are four standard errors of the sample (two-sided chance 6e-5) unless a test says otherwise; seeds are fixed.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import NAVIGATION
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sim.vehicle import VEHICLE, Vehicle, hold_course, steer
from tagtrack.envs.simulation import Simulation

ERRORS = 4.0
WORLDS = 4000
# Knows where it is and where it points; its limits stand here, so that the tests can say them.
EXACT = Vehicle(
    max_speed=1.3,
    acceleration=0.3,
    max_turn_rate=0.26,
    heading_gain=0.5,
    compass_sigma=0.0,
    fix_sigma=0.0,
    drift_sigma=0.0,
)


SWINGING = "Vehicle.heading_gain must be below 2 / control_interval (2), or the heading swings ever wider, got 2.0"


class Boat:
    """One vehicle, steered from Python."""

    def __init__(self, parameters=EXACT, heading=0.0, speed=0.0, time_step=1.0):
        self.parameters = to_record(parameters)[0]
        self.time_step, self.step = time_step, 0
        self.state, self.believed = np.zeros(1, VEHICLE), np.zeros(1, NAVIGATION)
        self.state["heading"] = self.believed["heading"] = heading
        self.state["speed"] = self.believed["speed"] = speed

    def steer(self, course, speed=1.0):
        self.step += 1
        stream = (np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(self.step))
        steer(
            self.state[0], self.believed[0], float(course), float(speed), stream, 0, self.parameters, self.time_step
        )  # fmt: skip
        return self

    def __getattr__(self, name):
        return float(self.state[name][0])


def turned(angle):
    """An angle within half a turn."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def fleet(parameters, steps, seed=0, action=(1.0, 0.0), time_step=1.0):
    """Truth and navigation, each (steps + 1, WORLDS), of as many vehicles, the first from before the first step."""
    scenario = dataclasses.replace(
        Scenario(), vehicle=parameters, belief=Belief(particles=1), time_step=time_step, episode_steps=steps
    )
    simulation = Simulation(scenario, WORLDS)
    simulation.reset(seed=seed)
    worlds = simulation.worlds
    states, believed = [worlds.vehicles[:, 0].copy()], [worlds.navigation[:, 0].copy()]
    for _ in range(steps):
        simulation.step(np.tile(np.array(action, np.float32), (WORLDS, 1, 1)))
        states.append(worlds.vehicles[:, 0].copy())
        believed.append(worlds.navigation[:, 0].copy())
    return np.array(states), np.array(believed)


# Steering.


@pytest.mark.parametrize("time_step", [0.5, 1.0])
@pytest.mark.parametrize("gain", [0.2, 0.5, 0.9])
def test_heading_error_decays_by_the_gain_at_every_step(gain, time_step):
    """P control without noise and within the limits: the error after n steps is (1 - gain * time_step)^n of the first."""
    parameters = dataclasses.replace(EXACT, heading_gain=gain, max_turn_rate=10.0)
    boat = Boat(parameters, heading=0.2, time_step=time_step)
    for n in range(1, 20):
        boat.steer(course=1.2)
        assert 1.2 - boat.heading == pytest.approx((1 - gain * time_step) ** n, abs=1e-12)


def test_error_halves_every_second_at_a_gain_of_one_half():
    boat = Boat(heading=0.0)
    for n in range(1, 6):
        boat.steer(course=0.5)
        assert 0.5 - boat.heading == pytest.approx(0.5 * 0.5**n)


def test_far_course_is_approached_at_the_largest_turn_rate():
    boat = Boat(heading=0.0)
    for n in range(1, 9):
        boat.steer(course=3.0)
        assert boat.heading == pytest.approx(0.26 * n)  # until the error times 0.5 is below 0.26, at 0.52 rad


@pytest.mark.parametrize(("heading", "course", "side"), [(3.0, -3.0, 1), (-3.0, 3.0, -1), (0.5, -0.5, -1), (0.1, 6.0, -1)])
def test_vehicle_turns_the_shorter_way(heading, course, side):
    boat = Boat(heading=heading).steer(course)
    assert math.copysign(1, turned(boat.heading - heading)) == side
    for _ in range(60):
        boat.steer(course)
    assert turned(boat.heading - course) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("time_step", [0.25, 1.0])
def test_no_turn_is_faster_than_the_largest_turn_rate(time_step):
    boat = Boat(dataclasses.replace(EXACT, compass_sigma=0.3), time_step=time_step)  # even where the compass is wild
    for n in range(200):
        before = boat.heading
        boat.steer(course=3.0 * math.sin(n))
        assert abs(turned(boat.heading - before)) <= 0.26 * time_step + 1e-12


@pytest.mark.parametrize("time_step", [0.25, 1.0])
def test_speed_changes_by_the_acceleration_at_most_and_then_stays(time_step):
    boat = Boat(time_step=time_step)
    speeds = [boat.steer(0.0, speed=1.3).speed for _ in range(round(6 / time_step))]
    ramp = np.minimum(0.3 * time_step * np.arange(1, len(speeds) + 1), 1.3)
    np.testing.assert_allclose(speeds, ramp)
    slower = [boat.steer(0.0, speed=0.0).speed for _ in range(round(6 / time_step))]
    np.testing.assert_allclose(slower, np.maximum(1.3 - 0.3 * time_step * np.arange(1, len(slower) + 1), 0.0), atol=1e-12)


def test_straight_run_covers_speed_times_time():
    boat = Boat(heading=math.radians(30), speed=1.0)
    for _ in range(10):
        boat.steer(math.radians(30), speed=1.0)
    assert (boat.x, boat.y) == (pytest.approx(10 * math.sqrt(3) / 2), pytest.approx(5.0))


def test_vehicle_turning_all_the_time_runs_a_circle():
    """At the largest turn rate and 1 m/s the radius is 1/0.26 m; an arc, so points lie on the circle itself."""
    boat = Boat(speed=1.0)
    centre_y = 1 / 0.26
    for _ in range(100):
        boat.steer(boat.heading + 2.0, speed=1.0)
        assert math.hypot(boat.x, boat.y - centre_y) == pytest.approx(centre_y)


@pytest.mark.parametrize(("time_step", "corrections"), [(0.5, 1), (1.0, 1), (2.0, 2), (5.0, 5)])
def test_heading_is_corrected_at_the_control_interval_however_long_a_step(time_step, corrections):
    """The paper's controller runs at 1 Hz (4.2); a policy may choose a course more seldom."""
    boat = Boat(time_step=time_step)
    held, believed = boat.state.copy(), boat.believed.copy()
    stream = (np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(1))
    hold_course(held[0], believed[0], 0.4, 1.0, stream, 0, boat.parameters, time_step)
    for _ in range(corrections):
        steer(boat.state[0], boat.believed[0], 0.4, 1.0, stream, 0, boat.parameters, time_step / corrections)
    for name in ("x", "y", "heading", "speed"):
        assert held[name][0] == pytest.approx(boat.state[name][0], abs=1e-12)
        assert believed[name][0] == pytest.approx(boat.believed[name][0], abs=1e-12)
    assert 0.4 - boat.heading == pytest.approx(0.4 * (1 - 0.5 * time_step / corrections) ** corrections)


def test_controller_sees_the_compass_and_not_the_true_heading():
    boat = Boat(heading=0.0)
    boat.believed["heading"] = 0.1
    assert boat.steer(course=0.1).heading == 0.0


def test_compass_errs_by_its_sigma_afresh_at_every_step():
    states, believed = fleet(Vehicle(compass_sigma=0.05), steps=3)
    errors = turned(believed["heading"] - states["heading"])
    for row in errors:
        assert stats.kstest(row / 0.05, "norm").pvalue > 1e-4
    correlation = np.corrcoef(errors)
    assert np.abs(correlation - np.eye(4)).max() < ERRORS / math.sqrt(WORLDS)


def test_vehicles_start_at_rest_at_the_origin_on_any_heading():
    start = fleet(Vehicle(), steps=1)[0][0]
    for name in ("x", "y", "speed"):
        assert not start[name].any()
    assert stats.kstest((start["heading"] + math.pi) / (2 * math.pi), "uniform").pvalue > 1e-4


# Navigation.


def test_first_position_is_a_gps_fix_independent_of_the_compass():
    start, believed = (rows[0] for rows in fleet(Vehicle(fix_sigma=2.0, compass_sigma=0.03), steps=1))
    errors = np.stack([believed["x"] / 2.0, believed["y"] / 2.0, turned(believed["heading"] - start["heading"]) / 0.03])
    for row in errors:
        assert stats.kstest(row, "norm").pvalue > 1e-4
    assert np.abs(np.corrcoef(errors) - np.eye(3)).max() < ERRORS / math.sqrt(WORLDS)


@pytest.mark.parametrize("time_step", [0.5, 1.0])
def test_dead_reckoning_error_grows_with_the_root_of_time(time_step):
    """Variance sigma^2 t along each axis, from an exact first fix; the variance of n normals is known to sqrt(2/n)."""
    seconds = 16
    parameters = Vehicle(fix_interval=1e6, fix_sigma=0.0, drift_sigma=0.25)
    states, believed = fleet(parameters, steps=round(seconds / time_step), time_step=time_step)
    for elapsed in (1, 4, 16):
        at = round(elapsed / time_step)
        for axis in ("x", "y"):
            error = believed[axis][at] - states[axis][at]
            assert np.var(error) == pytest.approx(0.0625 * elapsed, rel=ERRORS * math.sqrt(2 / WORLDS))
            assert abs(error.mean()) < ERRORS * 0.25 * math.sqrt(elapsed / WORLDS)


def test_a_fix_at_every_interval_resets_the_error():
    """Every 10 s the error is that of GPS alone; a second before, that of nine seconds of drift on top."""
    states, believed = fleet(Vehicle(fix_interval=10.0, fix_sigma=0.5, drift_sigma=1.0), steps=31)
    error = believed["x"] - states["x"]
    for step in (10, 20, 30):
        assert np.var(error[step]) == pytest.approx(0.25, rel=ERRORS * math.sqrt(2 / WORLDS))
        assert np.var(error[step - 1]) == pytest.approx(0.25 + 9.0, rel=ERRORS * math.sqrt(2 / WORLDS))
        assert np.var(error[step + 1]) == pytest.approx(0.25 + 1.0, rel=ERRORS * math.sqrt(2 / WORLDS))
        assert not states["since_fix"][step].any()
    assert abs(np.corrcoef(error[10], error[20])[0, 1]) < ERRORS / math.sqrt(WORLDS)


def test_long_steps_draw_noise_of_their_own_for_every_correction():
    """Two corrections a step: drift and compass as in two steps of half the length, and two vehicles share no draw."""
    swaying = Vehicle(fix_interval=1e6, fix_sigma=0.0, drift_sigma=0.25, compass_sigma=0.03)
    states, believed = fleet(swaying, steps=4, time_step=2.0)
    assert np.var(believed["x"][4] - states["x"][4]) == pytest.approx(0.5, rel=ERRORS * math.sqrt(2 / WORLDS))
    scenario = dataclasses.replace(Scenario(), vehicles=2, time_step=2.0, belief=Belief(particles=1))
    simulation = Simulation(scenario, WORLDS)
    simulation.reset(seed=0)
    simulation.step(np.zeros((WORLDS, 2, 2)))
    true, believes = simulation.worlds.vehicles, simulation.worlds.navigation
    errors = np.concatenate([(believes["x"] - true["x"]).T, turned(believes["heading"] - true["heading"]).T])
    assert np.abs(np.corrcoef(errors) - np.eye(4)).max() < ERRORS / math.sqrt(WORLDS)


def test_vehicle_that_stays_at_the_surface_has_a_fix_at_every_step():
    states, believed = fleet(Vehicle(fix_interval=0.0, fix_sigma=0.5, drift_sigma=5.0), steps=5)
    for row in (believed["x"] - states["x"])[1:]:
        assert np.std(row) == pytest.approx(0.5, rel=ERRORS * math.sqrt(0.5 / WORLDS))


def test_exact_vehicle_knows_where_it_is():
    states, believed = fleet(dataclasses.replace(EXACT, fix_interval=1e6), steps=40, action=(0.3, 1.0))
    for name in ("x", "y", "heading", "speed"):
        np.testing.assert_allclose(believed[name], states[name], atol=1e-9)
    assert np.hypot(states["x"][-1], states["y"][-1]).min() > 1.0  # and it has moved


def test_current_carries_the_vehicle_and_dead_reckoning_does_not_see_it():
    """Half a metre a second to the north-west: 20 m in 40 s between what is and what is believed."""
    drifting = dataclasses.replace(EXACT, current_speed=0.5, current_heading=0.75 * math.pi, fix_interval=1e6)
    boat, still = Boat(drifting, speed=1.0), Boat(EXACT, speed=1.0)
    for _ in range(40):
        boat.steer(0.3)
        still.steer(0.3)
    carried = 20.0 * math.cos(0.75 * math.pi), 20.0 * math.sin(0.75 * math.pi)
    assert (boat.x - still.x, boat.y - still.y) == (pytest.approx(carried[0]), pytest.approx(carried[1]))
    assert (boat.believed["x"][0], boat.believed["y"][0]) == (pytest.approx(still.x), pytest.approx(still.y))
    assert boat.speed == pytest.approx(1.0)  # speed is through the water


def test_fix_ends_the_error_that_a_current_has_made():
    boat = Boat(dataclasses.replace(EXACT, current_speed=0.5, fix_interval=10.0), speed=1.0)
    for _ in range(9):
        boat.steer(0.0)
    assert boat.x - boat.believed["x"][0] == pytest.approx(4.5)
    boat.steer(0.0)
    assert boat.x == boat.believed["x"][0]


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"max_speed": 0}, "Vehicle.max_speed must be positive, got 0.0"),
        ({"max_turn_rate": -1}, "Vehicle.max_turn_rate must be positive, got -1.0"),
        ({"heading_gain": 2.0}, SWINGING),
        ({"drift_sigma": -0.1}, "Vehicle.drift_sigma must be at least 0, got -0.1"),
        ({"compass_sigma": math.nan}, "Vehicle.compass_sigma must be finite, got nan"),
        ({"fix_interval": "often"}, "Vehicle.fix_interval must be a number, got 'often'"),
    ],
)
def test_impossible_vehicles_are_refused_by_name_and_value(values, says):
    with pytest.raises(ValueError) as caught:
        Vehicle(**values)
    assert str(caught.value) == says
