"""Calibration of a tag's clock: periods by hand, outliers by kind, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tagtrack.eval.field.tag_clock.calibration import (
    TICK,
    Kind,
    average_differences,
    calibrate,
    fit_line,
    sort_differences,
)

PERIOD = 3.9997


def pings(count, period=PERIOD, start=100.0):
    return start + period * np.arange(count)


def kinds(arrival, **choices):
    return [Kind(kind).name for kind in sort_differences(arrival, **choices).kind]


def test_a_perfect_record_gives_the_period_and_the_first_ping():
    found = calibrate(pings(50))
    assert found.by_line.period == pytest.approx(PERIOD, abs=1e-12)
    assert found.by_differences.period == pytest.approx(PERIOD, abs=1e-12)
    assert found.clock.first_ping == pytest.approx(100.0, abs=1e-9)
    assert found.stretches == 1


def test_a_perfect_record_is_trusted_no_further_than_the_receivers_tick():
    found = calibrate(pings(51))
    assert found.by_line.standard_error == pytest.approx(TICK / 2 / 50)
    assert found.by_differences.standard_error == pytest.approx(TICK / 50)


def test_mean_of_differences_is_last_minus_first_over_their_number():
    arrival = pings(5) + [0.0, 0.003, -0.002, 0.001, 0.002]
    found = average_differences(sort_differences(arrival))
    assert found.period == pytest.approx(PERIOD + 0.002 / 4)
    steps = np.array([0.003, -0.005, 0.003, 0.001])
    assert found.sigma == pytest.approx(np.sqrt(np.sum((steps - 0.0005) ** 2) / 3))
    assert found.standard_error == pytest.approx(found.sigma / 2)


def test_line_is_least_squares():
    """Residuals -e, 2e, -e about a line are orthogonal to it, so the slope is the period: sigma^2 = 6 e^2 / 1, leverage 2."""
    e = 1e-3
    found = fit_line(pings(3) + [-e, 2 * e, -e], np.arange(3), np.zeros(3, dtype=int), resolution=1e-9)
    assert found.period == pytest.approx(PERIOD, abs=1e-12)
    assert found.sigma == pytest.approx(np.sqrt(6) * e)
    assert found.standard_error == pytest.approx(np.sqrt(6) * e / np.sqrt(2))


def test_line_is_the_same_slope_before_and_after_a_shift():
    arrival = np.concatenate([pings(20), pings(30, start=1000.7)])
    found = calibrate(arrival)
    assert found.by_line.period == pytest.approx(PERIOD, abs=1e-12)
    assert found.clock.first_ping == pytest.approx(1000.7, abs=1e-9)  # of the stretch that goes on
    assert found.stretches == 2


def test_missed_codes_are_outliers_but_keep_their_place_in_the_count():
    arrival = np.delete(pings(12), [3, 6, 7])
    assert kinds(arrival) == ["REGULAR"] * 2 + ["MISSED", "REGULAR", "MISSED"] + ["REGULAR"] * 3
    found = calibrate(arrival)
    assert found.by_line.period == pytest.approx(PERIOD, abs=1e-12)
    assert found.stretches == 1


@pytest.mark.parametrize("place", [0, 4, 9])
def test_a_neighbouring_code_is_left_out_wherever_it_stands(place):
    arrival = np.sort(np.append(pings(10), pings(10)[place] + 0.04875))
    if place == 0:
        arrival = arrival[1:]  # the record begins with it
    differences = sort_differences(arrival)
    assert len(differences.of_kind(Kind.NEIGHBOURING)) == (2 if place == 4 else 1)
    assert calibrate(arrival).by_line.period == pytest.approx(PERIOD, abs=1e-12)


def test_a_neighbouring_code_before_a_missed_one():
    arrival = np.sort(np.append(np.delete(pings(10), 5), pings(10)[4] + 0.04896))
    assert kinds(arrival)[4:6] == ["NEIGHBOURING", "NEIGHBOURING"]
    assert calibrate(arrival).stretches == 1


def test_a_difference_that_is_no_number_of_periods_is_a_shift():
    arrival = np.concatenate([pings(5), pings(5, start=121.0)])
    assert kinds(arrival)[4] == "SHIFTED"


def test_a_gap_too_long_to_count_over_begins_a_new_stretch():
    """Three arrivals tell the period to half a tick at best: after 17 minutes the count is a guess, after 17 s it is not."""
    assert calibrate(np.append(pings(3), pings(3, start=100.0 + 256 * PERIOD))).stretches == 2
    assert calibrate(np.append(pings(3), pings(3, start=100.0 + 4 * PERIOD))).stretches == 1


def test_without_a_nominal_period_the_one_with_most_differences_near_is_taken():
    assert sort_differences(pings(20, period=1.99988)).nominal == 2.0
    assert sort_differences(np.delete(pings(20, period=1.99988), [3, 8, 9, 15])).nominal == 2.0
    assert sort_differences(pings(20)).nominal == 4.0
    assert sort_differences(pings(20, period=60.2), 60.2).nominal == 60.2


def test_period_holds_at_times_since_1970():
    """float64 has 2.4e-7 s there; 100 pings still give the slope to 1e-8 s."""
    assert calibrate(pings(100, start=1.7e9)).by_line.period == pytest.approx(PERIOD, abs=1e-8)


def test_standard_error_of_the_line_is_honest_under_jitter():
    """z-scores of 300 records have a root mean square of 1 (+-0.1, about 2.5 standard errors)."""
    generator = np.random.default_rng(3)
    scores = []
    for _ in range(300):
        found = calibrate(pings(200) + generator.normal(0.0, 1e-3, 200), resolution=1e-9).by_line
        scores.append((found.period - PERIOD) / found.standard_error)
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("period", [4.0, 4.0 + 1e-8, 4.0 + 1e-7, 3.9998])
def test_a_slip_of_less_than_a_tick_is_within_the_standard_error(period):
    """Nothing scatters while the clock stays within one tick, so the error is not in the residuals."""
    scores = []
    for start in np.linspace(100.0, 100.0 + TICK, 20, endpoint=False):
        ticks = np.floor(pings(1500, period=period, start=start) / TICK)
        found = calibrate(ticks * TICK).by_line
        scores.append(abs(found.period - period) / found.standard_error)
    assert max(scores) < 3


@given(st.lists(st.sampled_from([4.0, 3.9901, 4.0099, 8.0, 0.04875, 3.95125, 2.0, 1e-9, 1e6, 1e15]), min_size=2, max_size=12))
def test_any_record_gives_finite_numbers_or_a_refusal(steps):
    try:
        found = calibrate(np.append(0.0, np.cumsum(steps)))
    except ValueError:
        return
    for estimate in (found.by_line, found.by_differences):
        assert 1.9 < estimate.period < 4.1
        assert 0 < estimate.standard_error < 0.1
    assert np.isfinite(found.clock.first_ping)


@pytest.mark.parametrize(
    ("arrival", "choices", "complaint"),
    [
        ([], {}, "at least three arrivals of a code, got 0"),
        ([7.0], {}, "at least three arrivals of a code, got 1"),
        ([7.0, 11.0], {}, "at least three arrivals of a code, got 2"),
        ([0.0, 4.0, 4.0, 8.0], {}, r"arrivals must rise, got 4.00000 s after 4.00000 s; sort them and drop duplicates"),
        ([0.0, 8.0, 4.0], {}, "arrivals must rise, got 4.00000 s after 8.00000 s"),
        ([0.0, np.nan, 4.0], {}, "arrivals must rise, got nan s"),
        ([[0.0, 4.0, 8.0]], {}, r"got shape \(1, 3\)"),
        ([0.0, 3.0, 6.0, 9.0], {}, "0 of 3 differences lie within 0.01 s of the nominal period 2 s.* median .* 3.00000 s"),
        (pings(9), {"nominal_period": 2.0}, "0 of 8 differences .* median difference is 3.99970 s"),
        (np.delete(pings(90), [3, 7, 20]), {"nominal_period": 8.0}, "which is 2 periods: give a nominal period of 4 s"),
        (np.delete(pings(90), [3, 4, 7, 8]), {"nominal_period": 12.0}, "which is 3 periods: give a nominal period of 4 s"),
        (pings(9), {"nominal_period": -4.0}, "nominal period must be positive, got -4 s"),
        (pings(9), {"nominal_period": np.nan}, "nominal period must be positive, got nan s"),
        (pings(9), {"tau": 0.0}, "tau must be positive and below a quarter of the nominal period 2 s, got 0 s"),
        (pings(9), {"tau": 1.0}, "tau must be .* got 1 s"),
        (pings(9), {"resolution": 0.0}, "resolution must be positive and at most tau, 0.01 s, got 0 s"),
        (pings(9), {"resolution": np.nan}, "resolution must be positive"),
    ],
)
def test_what_gives_no_period_is_refused_with_the_way_out(arrival, choices, complaint):
    with pytest.raises(ValueError, match=complaint):
        calibrate(arrival, **choices)
