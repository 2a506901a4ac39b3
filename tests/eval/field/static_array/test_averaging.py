"""Several pings as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tagtrack.eval.field.static_array.averaging import Blocks, average_pings, number_by_count, number_by_time
from tagtrack.eval.field.static_array.maximum_likelihood import wls_ml
from tagtrack.eval.field.static_array.model import Pings, arrival_information
from tests.eval.field.static_array.scene import EPOCH, SETTING, SQUARE, hear

PLACE = np.array([30.0, -20.0])


def several(count: int, sigma: float = 1e-3, seed: int = 0) -> Pings:
    return hear(np.tile(PLACE, (count, 1)), SQUARE, sigma=sigma, seed=seed, time=EPOCH + 90.0 * np.arange(count))


def average(pings: Pings, count: int, sigma: float = SETTING.sigma, least_receivers: int = 1) -> Blocks:
    return average_pings(pings, number_by_count(pings, count, least_receivers), sigma)


def test_average_has_the_mean_differences_time_and_summed_information_of_its_pings():
    pings = several(7, sigma=1e-4)
    blocks = average(pings, 3)
    mean, information = blocks.pings, blocks.information
    assert blocks.count.tolist() == [3, 2, 2]
    np.testing.assert_allclose(mean.time - EPOCH, [90.0, 315.0, 495.0])
    for block, rows in enumerate(([0, 1, 2], [3, 4], [5, 6])):
        relative = pings.arrival[rows] - pings.arrival[rows].mean(axis=1, keepdims=True)
        found = mean.arrival[block] - mean.arrival[block].mean()
        np.testing.assert_allclose(found, relative.mean(axis=0), atol=1e-6)
        np.testing.assert_allclose(information[block], len(rows) * arrival_information(np.ones(4), SETTING.sigma))


def test_receivers_that_never_heard_the_same_ping_are_joined_by_a_third():
    """0 and 1 by 2: each hears with 2 only, and the differences add up. 3 heard only alone, so it stays unknown."""
    pings = several(3, sigma=0.0)
    for row, heard in enumerate(([0, 2], [1, 2], [3])):
        pings.arrival[row, [index for index in range(4) if index not in heard]] = np.nan
    blocks = average(pings, 3)
    mean, information = blocks.pings, blocks.information
    assert blocks.count.tolist() == [2]
    expected = np.linalg.norm(PLACE - SQUARE, axis=1) / 1500
    np.testing.assert_allclose(np.diff(mean.arrival[0, :3]), np.diff(expected[:3]), atol=1e-6)
    assert np.isnan(mean.arrival[0, 3]) and not information[0, 3].any()


def test_a_late_arrival_is_left_out_and_its_ping_still_counts():
    pings = several(20)
    clean = average(pings, 20).pings
    pings.arrival[4, 1] += 0.05
    blocks = average(pings, 20)
    mean, information = blocks.pings, blocks.information
    assert np.abs((mean.arrival - mean.arrival[:, :1]) - (clean.arrival - clean.arrival[:, :1])).max() < 3e-4
    assert information[0, 0, 0] > information[0, 1, 1]
    each = arrival_information(np.ones(4), SETTING.sigma)
    without = arrival_information([True, False, True, True], SETTING.sigma)
    np.testing.assert_allclose(information[0], 19 * each + without)


def test_average_of_a_hundred_pings_gets_below_the_tick_of_a_coarse_clock():
    """Rounded to 10 ms one ping is uncertain by 4 m; the mean of 100 by 0.4 m. 20 means: the rms is known to some 15 %."""
    pings = several(2000, sigma=1e-3)
    offset = np.random.default_rng(1).uniform(0, 1, (2000, 1))
    coarse = Pings(time=pings.time, arrival=np.round(pings.arrival + offset, 2))
    setting = replace(SETTING, sigma=0.01 / np.sqrt(12))
    blocks = average(coarse, 100, setting.sigma)
    found = wls_ml(blocks.pings, SQUARE, setting, information=blocks.information).position
    single = wls_ml(coarse, SQUARE, setting).position
    assert np.sqrt(np.mean(np.sum((found - PLACE) ** 2, axis=1))) < 0.65
    assert np.sqrt(np.mean(np.sum((single - PLACE) ** 2, axis=1))) > 3.5


def test_pings_of_few_receivers_go_with_their_neighbours_and_make_no_block_of_their_own():
    pings = several(10)
    pings.arrival[[0, 2, 3, 7], 2:] = np.nan  # heard by two: full are 1, 4, 5, 6, 8, 9
    assert number_by_count(pings, 2, 3).tolist() == [0, 0, 0, 0, 0, 1, 1, 2, 2, 2]
    assert number_by_count(pings, 4, 3).tolist() == [0, 0, 0, 0, 0, 0, 1, 1, 1, 1]
    assert average(pings, 4, least_receivers=3).count.tolist() == [6, 4]


def test_blocks_of_time_begin_at_whole_multiples():
    pings = several(5)
    moved = Pings(time=np.array([0.0, 86399.0, 86400.0, 2e5, 2.6e5]), arrival=pings.arrival)
    assert number_by_time(moved, 86400.0).tolist() == [0, 0, 1, 2, 3]
    with pytest.raises(ValueError, match="the time of a block must be positive, got 0"):
        number_by_time(moved, 0.0)


def test_what_averaging_does_not_remove_stays_in_the_information():
    """With m pings an arrival is known to sigma^2 / m + systematic^2: the information is that of one such arrival each."""
    pings = several(50)
    blocks = average_pings(pings, np.zeros(50, dtype=np.int64), 1e-3, systematic=5e-4)
    expected = arrival_information(np.ones(4), np.sqrt(1e-6 / 50 + 25e-8))
    np.testing.assert_allclose(blocks.information[0], expected, rtol=1e-9, atol=1e-3)


def test_no_pings_give_no_averages_and_a_block_holds_at_least_one():
    nothing = average(Pings(time=np.empty(0), arrival=np.empty((0, 4))), 5)
    assert nothing.pings.arrival.shape == (0, 4) and nothing.information.shape == (0, 4, 4) and nothing.count.size == 0
    with pytest.raises(ValueError, match="a block takes at least one ping, got 0"):
        average(several(2), 0)
