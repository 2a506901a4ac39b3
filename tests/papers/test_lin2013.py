"""Lin et al. 2013, time-of-flight distance: the numbers of IV.B and IV.C, Tables I, II and IV, and what follows from them."""

import numpy as np
import pytest

from tagtrack.envs.belief.recovery import LARGEST_SHARE
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.sensors import TimeOfFlightReceiver
from tagtrack.envs.simulation import Simulation
from tagtrack.eval.field.tag_clock.calibration import (
    NOMINAL_PERIODS,
    TAU,
    TICK,
    Kind,
    average_differences,
    calibrate,
    sort_differences,
)
from tagtrack.eval.field.tag_clock.coded_tag import CodedTag, CodeReceiver, clock_wander, simulate_arrivals
from tagtrack.eval.field.tag_clock.time_of_flight import LARGEST_JUMP, TagClock, aliasing_range, time_of_flight_range
from tagtrack.eval.papers.lin2013_localization import MEASUREMENTS, VARIANTS, rows_by_distance
from tagtrack.eval.papers.lin2013_recovery import lead_astray, time_back
from tagtrack.eval.papers.printed import LIN2013_TABLE_I

OUTLIERS = [[0.04875, 3.95104]] * 3 + [[0.04896, 7.95063], [7.99937], [7.99958]]  # the pairs sum to one or two periods
SPEED = 1500.0  # [m/s] (Fig. 6)
TIME_OF_FLIGHT = SCENARIOS["TagTrack/TimeOfFlight-v0"]
TAG_55488 = CodedTag(codes=(117, 2, 3, 4, 5), burst_period=1.99988)  # of five codes 117 is in every burst
HUNDRED_MINUTES, DAY_OF_FIG_6 = 6000.0, 22 * 3600.0


def arrivals_of_table_one():
    """A record with just these differences: regular ones in any order, outliers spread among them."""
    regular = [[value] * frequency for value, frequency in LIN2013_TABLE_I.items() if abs(value - 4.0) <= 0.01]
    steps = np.random.default_rng(0).permutation(np.concatenate(regular))
    for place, outlier in zip(range(1400, 0, -230), OUTLIERS, strict=False):
        steps = np.insert(steps, place, outlier)
    return np.append(0.0, np.cumsum(steps))


def records(tag, number, duration=HUNDRED_MINUTES):
    """Arrivals of code 117 in independent records."""
    for seed in range(number):
        yield simulate_arrivals(tag, CodeReceiver(), duration=duration, generator=np.random.default_rng(seed)).of_code(117)


def test_constants_of_the_method():
    assert TAU == 0.01  # [s] (IV.B.2)
    assert NOMINAL_PERIODS == (2.0, 4.0)  # [s] (IV.B.1)
    assert LARGEST_JUMP == 50.0  # [m] (Alg. 1)
    assert CodeReceiver().resolution == 1e-5  # [s] (III.A)


def test_receiver_of_the_task_has_the_tag_and_the_gate_of_the_bench():
    receiver, tag, bench = TimeOfFlightReceiver(), CodedTag(), CodeReceiver()
    assert (receiver.wander, receiver.code_spacing) == (tag.wander, tag.code_spacing)
    assert (receiver.tick, receiver.misread) == (bench.tick, bench.misread)
    assert bench.tick == TICK
    assert receiver.largest_jump == LARGEST_JUMP


def test_table_one_gives_table_two():
    arrival = arrivals_of_table_one()
    found = average_differences(sort_differences(arrival))
    assert round(found.period, 5) == 3.99979
    assert round(found.sigma, 5) == 0.00006  # its "error" is the spread of the differences, not of their mean
    assert round(arrival[-1] / 60) == 103  # "roughly 100 minutes", "105 minutes"


def test_outliers_of_table_one_are_told_by_their_cause():
    differences = sort_differences(arrivals_of_table_one())
    counts = {kind.name: len(differences.of_kind(kind)) for kind in Kind}
    assert counts == {"REGULAR": 1536, "MISSED": 2, "NEIGHBOURING": 8, "SHIFTED": 0}
    assert sum(LIN2013_TABLE_I.values()) == 1546


def test_the_line_agrees_with_the_mean_within_the_means_standard_error():
    found = calibrate(arrivals_of_table_one())
    assert found.stretches == 1
    assert abs(found.by_line.period - found.by_differences.period) < found.by_differences.standard_error < 2e-6


def test_differences_of_table_one_are_whole_ticks_of_the_receiver():
    differences = np.array(list(LIN2013_TABLE_I))
    off = np.abs(differences - np.round(differences / TICK) * TICK)
    assert off.max() <= 1e-5 + 1e-12  # two arrivals, each rounded to 1e-5 s


def test_ticks_explain_five_to_one_between_the_last_digits():
    """19199 ticks are 399979 1/6 steps of 1e-5 s: five times in six 3.99979, else 3.99980."""
    assert LIN2013_TABLE_I[3.99979] / (LIN2013_TABLE_I[3.99979] + LIN2013_TABLE_I[3.99980]) == pytest.approx(5 / 6, abs=0.02)


@pytest.mark.parametrize(("tag", "period", "sigma"), [(CodedTag(), 3.99979, 0.00006), (TAG_55488, 1.99988, 0.00010)])
def test_the_simulated_tags_have_the_rows_of_table_two(tag, period, sigma):
    estimates = [calibrate(arrival).by_differences for arrival in records(tag, 20)]
    assert round(float(np.mean([estimate.period for estimate in estimates])), 5) == period
    assert round(float(np.mean([estimate.sigma for estimate in estimates])), 5) == sigma


def test_the_simulated_record_has_the_outliers_of_table_one():
    """8 differences by neighbours, 2 by missed codes in 1546; the means of 40 records within three standard errors."""
    found = [calibrate(arrival[:1547]).differences for arrival in records(CodedTag(), 40, duration=6300.0)]
    assert {differences.value.size for differences in found} == {1546}
    neighbouring, missed = (np.mean([len(each.of_kind(kind)) for each in found]) for kind in (Kind.NEIGHBOURING, Kind.MISSED))
    assert neighbouring == pytest.approx(8, abs=3 * 2 * 2 / 40**0.5)  # two differences by each of four strays
    assert missed == pytest.approx(3, abs=3 * 3**0.5 / 40**0.5)  # Table I's third miss follows a neighbour
    assert all(len(each.of_kind(Kind.SHIFTED)) == 0 for each in found)


def test_period_is_within_2e_6_of_the_truth_after_100_minutes():
    for arrival in records(CodedTag(), 50):
        found = calibrate(arrival)
        for estimate in (found.by_line, found.by_differences):
            assert abs(estimate.period - CodedTag().period(117)) < 2e-6
            assert estimate.standard_error < 2e-6


def test_the_error_of_a_mean_of_differences_is_as_large_as_the_drift_of_figure_6():
    """With clocks that do not drift at all: 1.5 m and 8 m after 22 h were seen, and the line would err by less than 0.5 m."""
    tag = CodedTag(wander=0.0)
    found = [calibrate(arrival) for arrival in records(tag, 60)]
    pings = DAY_OF_FIG_6 / tag.period(117)
    by_mean, by_line = (
        SPEED * pings * np.std([getattr(each, by).period - tag.period(117) for each in found])
        for by in ("by_differences", "by_line")
    )
    assert 1.5 < by_mean < 8.0
    assert by_line < 0.5


def test_clocks_wander_as_far_as_in_figure_6():
    """1.5 m and 8 m are 5.8 m root mean square; 400 walks know theirs to 4 %."""
    generator = np.random.default_rng(0)
    errors = [clock_wander(CodedTag().wander, 120.0, 660, generator)[-1] for _ in range(400)]
    assert SPEED * np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.sqrt((1.5**2 + 8.0**2) / 2), rel=0.12)


def test_ranges_four_hours_after_calibration_are_good_to_3_metres():
    """Tag and hydrophone stay together; the clock of the first 100 minutes is trusted until the end (Table III)."""
    for arrival in records(TAG_55488, 20, duration=HUNDRED_MINUTES + 4 * 3600.0):
        clock = calibrate(arrival[arrival < HUNDRED_MINUTES]).clock
        ranges = time_of_flight_range(arrival[arrival > arrival[-1] - 1200.0, None], clock, SPEED)
        ranges = ranges[np.abs(ranges) < LARGEST_JUMP]  # a neighbouring code is 73 m off
        assert abs(np.mean(ranges)) < 3.0
        assert np.std(ranges) < 3.0


def test_reach_of_a_period_of_two_seconds_is_1500_metres():
    assert aliasing_range(TagClock(period=1.99988, first_ping=0.0), SPEED) == pytest.approx(1500.0, abs=0.1)


def test_constants_of_the_task():
    belief = TIME_OF_FLIGHT.belief
    assert belief.weight_floor == 1e-7  # w_min (IV.C.3)
    assert belief.receiver.largest_jump == 50.0  # [m] (Alg. 1)
    assert LARGEST_SHARE == 0.5  # (Alg. 2, line 9)
    assert TIME_OF_FLIGHT.tag.period == 2.0  # [s] (III.A)
    assert TIME_OF_FLIGHT.start.farthest == 85.0  # [m] (V.B)


def errors_of(measurements, courses=None, worlds=256):
    """Errors (K, W) of a belief that hears the same pings on the same path, and the courses of that path.

    Without ``courses`` the vehicle sails by the belief, on a slant of 60 degrees.
    """
    scenario = with_overrides(TIME_OF_FLIGHT, {"belief.receiver.measurements": measurements})
    simulation = Simulation(scenario, worlds)
    simulation.reset(seed=900)
    errors, sailed = [], []
    for step in range(scenario.episode_steps):
        navigation, mean = simulation.worlds.navigation[:, 0], simulation.mean[:, 0, 0]
        line = np.arctan2(mean[:, 1] - navigation["y"], mean[:, 0] - navigation["x"])
        sailed.append(line + np.radians(60.0) if courses is None else courses[step])
        turn = sailed[-1] - line
        simulation.step(np.stack([np.cos(turn), np.sin(turn)], axis=-1).astype(np.float32)[:, None])
        errors.append(simulation.error[:, 0, 0].copy())
    return np.array(errors), sailed


def test_both_measurements_together_are_1_6_times_better_than_the_better_one():
    """Table IV: 16.38 m by angle, 19.43 m by distance, 8.76 m by both (1.87 times). One path for all three, as there."""
    both, courses = errors_of("both")
    angle, distance = (errors_of(single, courses)[0] for single in ("angle", "distance"))
    print(f"both {both.mean():.2f} m, angle {angle.mean():.2f} m, distance {distance.mean():.2f} m")
    assert min(angle.mean(), distance.mean()) > 1.6 * both.mean()


def test_time_back_is_that_of_the_first_error_below_15_metres():
    error = np.array([[130.0, 14.9, 130.0], [15.0, 20.0, 130.0], [14.0, 3.0, 130.0]])
    assert time_back(error).tolist() == [6.0, 2.0, np.inf]  # steps of 2 s


def test_led_astray_no_particle_is_within_100_metres_of_the_fish():
    simulation = Simulation(TIME_OF_FLIGHT, 50)
    simulation.reset(seed=0)
    lead_astray(simulation, np.random.default_rng(0))
    away = simulation.worlds.particles[:, 0, 0, :2] - simulation.fish_position[:, 0, :, None]
    assert np.hypot(away[:, 0], away[:, 1]).min() > 100.0
    miss = simulation.estimate[:, 0, 0] - simulation.fish_position[:, 0]
    np.testing.assert_allclose(np.hypot(*miss.T), 130.0, atol=3.0)  # the mean of 1,000 within 15 m on each axis


def test_errors_fall_into_the_bin_of_their_distance():
    """A mission that is 20 m off for a minute and 70 m for ten seconds, with errors of 1 and 9 m: too short to count."""
    distance = np.repeat([20.0, 70.0], [60, 10])[None]
    errors = {name: np.where(distance < 30.0, 1.0, 9.0)[:, None] for name in MEASUREMENTS}
    found = {(row.row, row.column): row.ours for row in rows_by_distance(VARIANTS[0], errors, distance)}
    assert found["Angle, 0 to 30 m", "median"] == found["Angle and Distance, 0 to 30 m", "75th percentile"] == 1.0
    assert all(np.isnan(value) for (row, _), value in found.items() if "60 m" in row or "90 m" in row)
    assert len(found) == 3 * 3 * 2
