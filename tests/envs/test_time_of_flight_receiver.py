"""Bearing and one-way range of one ping: arrivals, clocks, aliasing, gate and Eq. 8, against float64 and ``time_of_flight.py``.

Sampled shares and means are allowed four standard errors.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.belief.assumptions import Belief, filter_rule
from tagtrack.envs.belief.row import is_told
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import LISTENER, Status, measurement
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.sensors import Measurements, TimeOfFlightReceiver
from tagtrack.envs.sensors.bearing import bearing_in_units
from tagtrack.envs.sensors.time_of_flight import SLANT_RANGE
from tagtrack.envs.simulation import Simulation
from tagtrack.eval.field.tag_clock.time_of_flight import TagClock, gate_range, time_of_flight_range

TASK = SCENARIOS["TagTrack/TimeOfFlight-v0"]
SPEED, ERRORS = 1500.0, 4.0
EXACT = {"receiver.range_sigma": 0.0, "receiver.misread": 0.0, "receiver.hours_since_calibration": 0.0, "receiver.tick": 1e-9}


def hear(distance: float, worlds: int, steps: int, **changes: object) -> tuple[np.ndarray, Simulation]:
    """Ranges (steps, worlds), NaN where none was heard, of a vehicle and a fish at rest in clear water that carries far."""
    still = {"fish.max_speed": 1e-9, "vehicle.max_speed": 1e-9, "belief.particles": 1}
    still |= {"water.reach": 1e6, "water.noisy_share": 0.0}
    start = replace(TASK.start, nearest=distance, farthest=distance)
    simulation = Simulation(with_overrides(TASK, {**still, "start": start, **changes}), worlds)
    simulation.reset(seed=5)
    ranges = []
    for _ in range(steps):
        simulation.step(np.zeros((worlds, 1, 2), np.float32))
        ranges.append(simulation.worlds.measurements["readings"][:, 0, 0, SLANT_RANGE].copy())
    return np.array(ranges), simulation


@pytest.mark.parametrize(("distance", "reading"), [(60.0, 60.0), (1499.0, 1499.0), (1501.0, -1499.0), (3100.0, 100.0)])
def test_range_is_wrapped_at_half_a_period(distance: float, reading: float) -> None:
    """v * T_c / 2 = 1500 m; a tag beyond seems nearer by 3000 m."""
    ranges, _ = hear(distance, 20, 5, **EXACT)
    assert ranges[np.isfinite(ranges)] == pytest.approx(reading, abs=0.01)


def test_reading_is_the_range_of_the_arrival() -> None:
    """The compiled range is that of ``time_of_flight_range`` for an arrival late by flight and clock, to half a tick (0.16 m)."""
    ranges, simulation = hear(70.0, 200, 3, **{**EXACT, "receiver.tick": 1 / 4800, "receiver.hours_since_calibration": 22.0})
    heard = np.isfinite(ranges[-1])
    target, encounter = simulation.worlds.targets[heard, 0], simulation.worlds.encounters[heard, 0, 0]
    arrival = target["last_ping"] + encounter["range"] / SPEED + encounter["clock_error"]
    clock = TagClock(period=np.full(heard.sum(), 2.0), first_ping=target["first_ping"])
    expected = time_of_flight_range(arrival[None, :], clock, SPEED)[0]
    assert np.abs(ranges[-1][heard] - expected).max() <= 0.5 * SPEED / 4800 + 1e-6
    assert np.ptp(ranges[-1][heard]) > 5.0  # the clocks of 200 episodes differ


def test_negative_range_reveals_clock_drift() -> None:
    ranges, _ = hear(1.0, 400, 1, **{**EXACT, "receiver.hours_since_calibration": 22.0})
    assert 0.2 < (ranges[np.isfinite(ranges)] < 0.0).mean() < 0.6


@pytest.mark.parametrize("hours", [4.0, 22.0])
def test_drift_is_drawn_for_each_episode_with_either_sign(hours: float) -> None:
    """5.8 m root mean square after 22 h (1.5 and 8 m in V.C), by a rate that walks: as the hours to the power 1.5."""
    simulation = Simulation(with_overrides(TASK, {"belief.particles": 1, "receiver.hours_since_calibration": hours}), 4000)
    simulation.reset(seed=0)
    first = SPEED * simulation.worlds.encounters["clock_error"][:, 0, 0].copy()
    sigma = math.sqrt((1.5**2 + 8.0**2) / 2) * (hours / 22.0) ** 1.5
    assert stats.kstest(first / first.std(), "norm").pvalue > 1e-3
    assert first.std() == pytest.approx(sigma, rel=0.02 + ERRORS / math.sqrt(2 * 4000))  # wander has one digit
    simulation.reset()
    assert (SPEED * simulation.worlds.encounters["clock_error"][:, 0, 0] != first).all()


def test_noise_and_misread_codes_are_as_the_parameters_say() -> None:
    """A neighbouring code is 0.04876 s or 73.1 m too late."""
    ranges, _ = hear(60.0, 400, 60, **{"receiver.hours_since_calibration": 0.0, "receiver.misread": 0.05})
    miss = ranges[np.isfinite(ranges)] - 60.0
    misread = miss > 40.0
    assert abs(misread.mean() - 0.05) < ERRORS * math.sqrt(0.05 * 0.95 / miss.size)
    for part, mean in ((miss[~misread], 0.0), (miss[misread], 0.04876 * SPEED)):
        assert abs(part.mean() - mean) < ERRORS * 2.0 / math.sqrt(part.size)
        assert part.std() == pytest.approx(2.0, rel=ERRORS / math.sqrt(2 * part.size) + 0.01)


def test_gate_is_algorithm_1() -> None:
    """An outlier costs two pings: the one before is the one heard before, whether or not it passed."""
    ranges = np.array([60.0, 62.0, 133.0, 61.0, 63.0, 113.0, 112.9, np.nan, 64.0])
    rule = to_record(filter_rule(TASK.belief, TASK.tag))[0]
    listener, previous, used, expected = np.zeros(1, LISTENER), math.nan, [], []
    listener["status"] = int(Status.HEARD)
    for heard in ranges[~np.isnan(ranges)]:
        listener["readings"][0, SLANT_RANGE], listener["previous"][0, SLANT_RANGE] = heard, previous
        used.append(bool(is_told(listener[0], rule)))
        passed, previous = gate_range(heard, previous)
        expected.append(not np.isnan(passed))
    assert used == expected == [True, True, False, False, True, True, True, True]
    by_angle = with_overrides(TASK, {"belief.receiver": TimeOfFlightReceiver(measurements=Measurements.ANGLE)}).belief
    angle = to_record(filter_rule(by_angle, TASK.tag))[0]
    listener["readings"][0, SLANT_RANGE], listener["previous"][0, SLANT_RANGE] = 0.0, 500.0
    assert is_told(listener[0], angle) and not is_told(listener[0], rule)


def test_listener_keeps_the_range_heard_before() -> None:
    """Each listener's `previous` is the range before the last one that was heard, NaN with the first."""
    simulation = Simulation(with_overrides(TASK, {"water.clear_hearing": 0.8, "belief.particles": 1}), 5)
    simulation.reset(seed=5)
    heard: list[list[float]] = [[math.nan] for _ in range(5)]
    for _ in range(80):
        simulation.step(np.zeros((5, 1, 2), np.float32))
        for world in np.flatnonzero(simulation.detected[:, 0, 0]):
            heard[world].append(float(simulation.worlds.measurements["readings"][world, 0, 0, SLANT_RANGE]))
            listener = simulation.listeners[world, 0, 0]
            kept = [listener[name][SLANT_RANGE] for name in ("previous", "readings")]
            np.testing.assert_array_equal(kept, heard[world][-2:])
    assert min(len(each) for each in heard) > 3  # each world's first has none before it


@pytest.mark.parametrize("measurements", list(Measurements))
def test_weight_is_equation_8(measurements: Measurements) -> None:
    """Float32 against float64: 1e-4 of the largest weight, and w_min where nothing fits."""
    receiver = TimeOfFlightReceiver(range_sigma=3.0, measurements=measurements)
    belief = Belief(particles=20_000, receiver=receiver, weight_floor=1e-7)
    particles = np.zeros((4, belief.particles), np.float32)
    particles[:2] = np.random.default_rng(3).uniform(-150, 150, (2, belief.particles))
    told = measurement(time=0.0, x=40.0, y=-25.0, heading=0.7, readings=[3.0, 70.0])
    weight, work = np.ones(belief.particles, np.float32), np.zeros(belief.particles, np.float32)
    assert receiver.weigh is not None
    receiver.weigh(weight, particles, told[0], np.float32(belief.weight_floor), work, np.array(receiver.padded_row()))
    dx, dy = particles[0].astype(float) - 40.0, particles[1].astype(float) + 25.0
    bearing = np.abs(np.angle(np.exp(1j * (np.arctan2(dy, dx) - 0.7))))
    angle = stats.norm.pdf([bearing_in_units.py_func(each) for each in bearing], 3.0, 1.0)
    distance = stats.norm.pdf(np.hypot(dx, dy), 70.0, 3.0)
    product = {Measurements.BOTH: angle * distance, Measurements.ANGLE: angle, Measurements.DISTANCE: distance}[measurements]
    np.testing.assert_allclose(weight, 1e-7 + product, rtol=0, atol=1e-4 * product.max())
    assert weight.min() >= np.float32(1e-7)


def test_clock_needs_a_fixed_period() -> None:
    with pytest.raises(ValueError, match="random_delay must be 0 with a TimeOfFlightReceiver"):
        with_overrides(TASK, {"tag.random_delay": 1.0})


@pytest.mark.parametrize(
    ("name", "value"), [("tick", 0.0), ("misread", 1.5), ("hours_since_calibration", -1.0), ("sound_speed", 0.0)]
)
def test_bad_parameter_is_named(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"TimeOfFlightReceiver.{name} must be"):
        TimeOfFlightReceiver(**{name: value})
