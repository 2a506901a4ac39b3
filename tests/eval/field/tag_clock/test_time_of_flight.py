"""Ranges from one-way travel times: Eqs. 4-7 and Alg. 1 of Lin et al. 2013, by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tagtrack.eval.field.tag_clock.time_of_flight import (
    TagClock,
    aliasing_range,
    correct_first_ping,
    gate_range,
    time_of_flight_range,
    transmission_count,
)

CLOCK = TagClock(period=2.0, first_ping=10.0)
SPEED = 1500.0


def test_a_hundred_metres_are_a_fifteenth_of_a_second():
    arrival = 10.0 + 7 * 2.0 + 1 / 15
    assert transmission_count(arrival, CLOCK) == 7
    assert time_of_flight_range(arrival, CLOCK, SPEED) == pytest.approx(100.0)


def test_an_arrival_before_the_first_ping_counts_backwards():
    assert transmission_count(10.0 - 4.0 + 0.1, CLOCK) == -2


def test_negative_range_reveals_clock_drift():
    assert time_of_flight_range(10.0 + 200.0 - 0.01, CLOCK, SPEED) == pytest.approx(-15.0)


def test_a_tag_beyond_the_reach_seems_nearer_by_one_period_of_sound():
    assert aliasing_range(CLOCK, SPEED) == 1500.0
    seen = [float(time_of_flight_range(10.0 + range_ / SPEED, CLOCK, SPEED)) for range_ in (1499.0, 1501.0, 3100.0)]
    assert seen == pytest.approx([1499.0, 1501.0 - 3000.0, 3100.0 - 3000.0])


@given(st.floats(-1499.0, 1499.0), st.integers(0, 40_000))
def test_any_range_within_reach_comes_back_at_any_ping(range_, count):
    arrival = CLOCK.first_ping + count * CLOCK.period + range_ / SPEED
    assert time_of_flight_range(arrival, CLOCK, SPEED) == pytest.approx(range_, abs=1e-4)


def test_silence_is_nan_and_stays_nan():
    ranges = time_of_flight_range([[10.1], [np.nan]], TagClock(period=np.array([2.0]), first_ping=np.array([10.0])), SPEED)
    np.testing.assert_allclose(ranges, [[150.0], [np.nan]])


def test_each_vehicle_reads_each_tag_by_that_tags_clock():
    clocks = TagClock(period=np.array([2.0, 4.0, 4.0]), first_ping=np.array([0.0, 0.0, 1.0]))
    ranges = time_of_flight_range([[2.01, 4.02, 5.03], [4.04, 8.05, 9.06]], clocks, SPEED)
    np.testing.assert_allclose(ranges, [[15.0, 30.0, 45.0], [60.0, 75.0, 90.0]])


def test_equation_4_makes_the_range_the_known_one():
    arrival = 10.0 + 0.5  # a power cycle has shifted the tag: 750 m, though it hangs 30 m away
    shifted = time_of_flight_range(arrival, CLOCK, SPEED)
    corrected = correct_first_ping(CLOCK, shifted, 30.0, SPEED)
    assert corrected.first_ping == pytest.approx(10.0 + (750.0 - 30.0) / 1500.0)
    assert time_of_flight_range(arrival + 6.0, corrected, SPEED) == pytest.approx(30.0)


def test_equation_4_passes_the_error_of_the_filters_own_estimate_on():
    arrival, estimated = 10.0 + 0.02, 25.0  # the tag is 30 m away, the filter believes in 25 m
    corrected = correct_first_ping(CLOCK, time_of_flight_range(arrival, CLOCK, SPEED), estimated, SPEED)
    assert time_of_flight_range(arrival + 40.0, corrected, SPEED) == pytest.approx(25.0)


def test_equation_4_leaves_the_clock_alone_in_silence():
    assert correct_first_ping(CLOCK, np.nan, 30.0, SPEED).first_ping == 10.0


def test_gate_rejects_a_jump_and_the_way_back():
    ranges, previous, passed = [100.0, 149.0, 300.0, 100.0, 104.0], np.nan, []
    for range_ in ranges:
        accepted, previous = gate_range(range_, previous)
        passed.append(float(accepted))
    np.testing.assert_equal(passed, [100.0, 149.0, np.nan, np.nan, 104.0])


def test_gate_remembers_over_a_silence():
    accepted, previous = gate_range([np.nan, 80.0], [100.0, 100.0])
    np.testing.assert_equal(accepted, [np.nan, 80.0])
    np.testing.assert_equal(previous, [100.0, 80.0])


@pytest.mark.parametrize("period", [0.0, -2.0, np.nan, np.inf, np.array([2.0, -1.0])])
def test_a_period_that_is_not_positive_is_refused(period):
    with pytest.raises(ValueError, match="tag period must be positive, got"):
        TagClock(period=period, first_ping=0.0)


@pytest.mark.parametrize("speed", [0.0, -1500.0, np.nan, np.inf])
def test_a_speed_that_is_not_positive_is_refused(speed):
    with pytest.raises(ValueError, match="speed of sound must be positive, got"):
        time_of_flight_range(10.0, CLOCK, speed)
