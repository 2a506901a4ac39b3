"""Pings that fit two places: the way through their neighbours tells which, or that nothing does."""

import numpy as np

from tagtrack.eval.field.static_array.choosing import choose_places

TIME = 60.0 * np.arange(20.0)
TRUE = np.stack([5.0 * np.arange(20.0), 0.5 * np.arange(20.0)], axis=1)
COVARIANCE = np.tile(np.eye(2), (20, 1, 1))
NONE = np.full((20, 2), np.nan)


def test_neighbours_tell_where_a_lone_ping_was():
    position, other = TRUE.copy(), NONE.copy()
    position[7], other[7] = TRUE[7] + (80.0, 60.0), TRUE[7]  # the estimate is the wrong one
    other[12] = TRUE[12] + (0.0, 90.0)  # here it is the right one
    at_other, undecided = choose_places(TIME, position, other, COVARIANCE)
    assert np.flatnonzero(at_other).tolist() == [7] and not undecided.any()


def test_a_run_of_such_pings_is_led_by_its_ends():
    position, other = TRUE.copy(), NONE.copy()
    position[5:15], other[5:15] = TRUE[5:15] * (1.0, -1.0) - (0.0, 100.0), TRUE[5:15]
    at_other, undecided = choose_places(TIME, position, other, COVARIANCE)
    assert np.flatnonzero(at_other).tolist() == list(range(5, 15)) and not undecided.any()


def test_mirror_images_all_along_cannot_be_told_apart():
    _, undecided = choose_places(TIME, TRUE + (0.0, 50.0), TRUE * (1.0, -1.0) - (0.0, 50.0), COVARIANCE)
    assert undecided.all()


def test_without_another_place_nothing_is_chosen():
    at_other, undecided = choose_places(TIME, TRUE, NONE, COVARIANCE)
    assert not at_other.any() and not undecided.any()
    assert [part.tolist() for part in choose_places(TIME[:1], TRUE[:1], NONE[:1], COVARIANCE[:1])] == [[False], [False]]
