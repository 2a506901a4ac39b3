"""Receptions of a tag become pings: nothing is lost, nothing is counted twice."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tagtrack.eval.field.static_array.detections import Detections, time_resolution
from tagtrack.eval.field.static_array.matching import (
    array_window,
    group_pings,
    impossible_differences,
    match_pings,
    remove_impossible,
    usual_interval,
)

SQUARE = np.array([[0.0, 0.0], [150.0, 0.0], [0.0, 150.0], [150.0, 150.0]])


def detections(rows: list[tuple[float, int]], receivers: int = 4) -> Detections:
    rows = sorted(rows)
    return Detections(
        time=np.array([time for time, _ in rows], dtype=np.float64),
        receiver=np.array([receiver for _, receiver in rows], dtype=np.int32),
        tag=np.zeros(len(rows), dtype=np.int32),
        receivers=tuple(f"R{index}" for index in range(receivers)),
        tags=("tag",),
    )


times = st.lists(st.tuples(st.floats(0, 30), st.integers(0, 3)), max_size=60)


@given(times, st.floats(0.1, 5))
def test_grouping_equals_going_through_the_receptions_one_by_one(rows, window):
    time = np.sort([moment for moment, _ in rows])
    expected, number, start = [], -1, -np.inf
    for moment in time:
        if moment > start + window:
            number, start = number + 1, moment
        expected.append(number)
    assert group_pings(time, window).tolist() == expected


@given(times)
def test_every_reception_is_an_arrival_an_echo_or_too_alone(rows):
    matching = match_pings(detections(rows), 1.0, least_receivers=2)
    assert int(matching.pings.heard.sum()) + matching.echoes + matching.too_few == len(rows)
    assert (matching.pings.heard.sum(axis=1) >= 2).all()
    assert (np.nanmax(matching.pings.arrival, axis=1, initial=0) - matching.pings.time <= 1.0).all()
    assert (np.diff(matching.pings.time) > 0).all()


def test_a_receiver_s_first_arrival_counts_and_its_later_ones_are_echoes():
    matching = match_pings(detections([(10.0, 0), (10.1, 1), (10.3, 0), (10.4, 0), (70.0, 1)]))
    np.testing.assert_array_equal(matching.pings.arrival, [[10.0, 10.1, np.nan, np.nan], [np.nan, 70.0, np.nan, np.nan]])
    assert matching.echoes == 2


def test_no_reception_gives_no_ping():
    matching = match_pings(detections([]))
    assert matching.pings.arrival.shape == (0, 4) and matching.pings.time.shape == (0,)


def test_window_of_an_array_is_what_sound_takes_along_its_diagonal():
    assert array_window(SQUARE, 1500.0, margin=0.0) == pytest.approx(150 * np.sqrt(2) / 1500)


def test_an_arrival_later_than_sound_allows_is_removed_and_the_ping_kept():
    rows = [(10.0, 0), (10.05, 1), (10.02, 2), (10.6, 3)]  # 10.6 is 0.55 s and more after the others, sound takes 0.14 s
    matching = remove_impossible(match_pings(detections(rows)), SQUARE, 1500.0, least_receivers=3)
    assert matching.impossible == 1 and matching.too_few == 0
    np.testing.assert_array_equal(matching.pings.heard, [[True, True, True, False]])
    assert impossible_differences(matching.pings.arrival, SQUARE, 1500.0).sum() == 0


def test_of_two_arrivals_that_exclude_each_other_the_later_goes():
    matching = remove_impossible(match_pings(detections([(10.0, 2), (10.9, 1)])), SQUARE, 1500.0)
    np.testing.assert_array_equal(matching.pings.heard, [[False, False, True, False]])


def test_possible_arrivals_stay():
    target = np.array([20.0, 130.0])
    arrival = 5.0 + np.hypot(*(SQUARE - target).T) / 1500
    matching = match_pings(detections([(time, index) for index, time in enumerate(arrival)]))
    assert remove_impossible(matching, SQUARE, 1500.0, margin=1e-9).impossible == 0


def test_bad_windows_and_mixed_tags_are_refused():
    with pytest.raises(ValueError, match="window of a ping must be positive, got 0"):
        match_pings(detections([]), 0)
    with pytest.raises(ValueError, match="at least 1, got 0"):
        match_pings(detections([]), least_receivers=0)
    one = detections([(1.0, 0), (2.0, 0)])
    mixed = Detections(time=one.time, receiver=one.receiver, tag=np.array([0, 1], np.int32), receivers=("R0",), tags=("a", "b"))
    with pytest.raises(ValueError, match="tag by tag"):
        match_pings(mixed)


@pytest.mark.parametrize(("step", "digits"), [(1.0, 0), (0.01, 2), (0.001, 3), (0.0, 6)])
def test_resolution_is_the_step_of_the_written_times(step, digits):
    time = 1.56e9 + np.random.default_rng(0).uniform(0, 1e6, 100)
    assert time_resolution(np.round(time, digits)) == pytest.approx(step)


def test_the_interval_is_told_from_receivers_that_miss_pings_and_hear_echoes():
    rng = np.random.default_rng(0)
    sent = np.cumsum(rng.uniform(1.1, 1.3, 500))
    rows = [(time + 0.3 * receiver, receiver) for time in sent for receiver in range(4) if rng.uniform() < 0.5]
    rows += [(time + 0.03, receiver) for time, receiver in rows[::3]]
    assert usual_interval(detections(rows)) == pytest.approx(1.2, abs=0.1)
    assert usual_interval(detections([(1.0, 0), (1.2, 1)])) is None
