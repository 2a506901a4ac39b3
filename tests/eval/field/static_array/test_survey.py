"""Distances from two-way times, and places from distances."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tagtrack.eval.field.static_array.detections import Detections
from tagtrack.eval.field.static_array.places import place_freely, place_on, places_from_distances
from tagtrack.eval.field.static_array.survey import survey_distances, survey_receivers

PLACES = np.array([[0.0, 0.0], [130.0, -10.0], [-5.0, -145.0], [155.0, -150.0]])
PAIRS = np.stack(np.triu_indices(4, 1), axis=1)
DISTANCES = np.hypot(*(PLACES[PAIRS[:, 0]] - PLACES[PAIRS[:, 1]]).T)
CLOCK = np.array([0.0, 0.003, -0.002, 0.001])  # [s]
OWN_TAGS = {f"R{index}": f"T{index}" for index in range(4)}


def record(*, sigma: float = 0.0, rounded: int = 9, pings: int = 400, deaf: tuple[tuple[int, int], ...] = ()) -> Detections:
    """Each receiver logs its own tag and hears the others, but for ``deaf`` pairs (tag, receiver), on clocks slightly apart."""
    rng = np.random.default_rng(3)
    rows = []
    for tag in range(4):
        ping = np.cumsum(rng.uniform(540, 660, pings)) + 100 * tag
        for receiver in range(4):
            if (tag, receiver) not in deaf:
                sound = np.hypot(*(PLACES[tag] - PLACES[receiver])) / 1512
                time = ping + sound + CLOCK[receiver] + sigma * rng.standard_normal(pings)
                rows += [(moment, receiver, tag) for moment in np.round(time, rounded)]
    rows.sort()
    time, receiver, tag = (np.array(column) for column in zip(*rows, strict=True))
    return Detections(
        time=time,
        receiver=receiver.astype(np.int32),
        tag=tag.astype(np.int32),
        receivers=tuple(OWN_TAGS),
        tags=tuple(OWN_TAGS.values()),
    )


def test_two_way_means_are_free_of_the_clocks_and_their_difference_is_the_clocks_offset():
    baselines = survey_distances(record(), OWN_TAGS, 1512.0)
    np.testing.assert_allclose([line.distance for line in baselines], DISTANCES, atol=1e-4)
    offset = CLOCK[PAIRS[:, 1]] - CLOCK[PAIRS[:, 0]]
    np.testing.assert_allclose([line.clock_offset for line in baselines], offset, atol=1e-7)
    np.testing.assert_allclose([line.asymmetry for line in baselines], 2 * 1512 * offset, atol=1e-3)


def test_the_stated_uncertainty_is_that_of_the_mean():
    baselines = survey_distances(record(sigma=1e-3), OWN_TAGS, 1512.0)
    # Each way is a mean of 400 differences of two arrivals of 1 ms; 38 degrees of freedom make its sd known to 11 %.
    expected = 1512 * 1e-3 * np.sqrt(2) / np.sqrt(400) / np.sqrt(2)
    np.testing.assert_allclose([line.sd for line in baselines], expected, rtol=0.45)
    assert np.all(np.abs(np.array([line.distance for line in baselines]) - DISTANCES) < 4 * expected)


def test_times_rounded_to_10_ms_still_give_decimetres():
    # Most differences are then one and the same number, and the rest 10 ms off: no outliers.
    baselines = survey_distances(record(rounded=2), OWN_TAGS, 1512.0)
    np.testing.assert_allclose([line.distance for line in baselines], DISTANCES, atol=1.0)
    assert sum(line.there.outliers + line.back.outliers for line in baselines) == 0


def test_one_way_alone_gives_a_distance_and_says_so():
    lines = survey_distances(record(deaf=((1, 0),)), OWN_TAGS, 1512.0)
    (line,) = (line for line in lines if line.receivers == ("R0", "R1"))
    assert np.isnan(line.asymmetry) and np.isnan(line.clock_offset)
    assert line.distance == pytest.approx(DISTANCES[0] + 1512 * 0.003, abs=1e-3)  # with the offset of the clocks in it


def test_pairs_that_never_hear_each_other_have_no_distance():
    lines = survey_distances(record(deaf=((1, 0), (0, 1))), OWN_TAGS, 1512.0)
    assert len(lines) == 5 and survey_receivers(lines) == ("R0", "R2", "R3", "R1")


@settings(max_examples=25, deadline=None)
@given(st.floats(-np.pi, np.pi), st.booleans(), st.floats(-1e6, 1e6))
def test_exact_distances_give_the_shape_and_references_its_place(angle, mirrored, shift):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    target = (PLACES * [1, -1 if mirrored else 1]) @ turn.T + shift
    shape = places_from_distances(PAIRS, DISTANCES, np.full(6, 0.1))
    placed = place_on(shape.position[:3], target[:3]).place(shape)
    np.testing.assert_allclose(placed.position, target, atol=1e-5)


def test_rough_places_tell_the_side_where_a_distance_is_missing():
    rough = PLACES + np.random.default_rng(1).uniform(-20, 20, PLACES.shape)  # 2 and 3 may lie on either side of 0 - 1
    shape = places_from_distances(PAIRS[:5], DISTANCES[:5], np.full(5, 0.1), rough)
    np.testing.assert_allclose(place_on(shape.position, PLACES).place(shape).position, PLACES, atol=1e-4)


def test_the_stated_covariance_is_that_of_repeated_surveys():
    rng, sd = np.random.default_rng(5), np.array([0.1, 0.5, 0.1, 0.2, 0.3, 0.2])
    shapes = [places_from_distances(PAIRS, DISTANCES + sd * rng.standard_normal(6), sd) for _ in range(300)]
    placed = np.array([place_on(shape.position, PLACES).place(shape).position for shape in shapes])
    expected = place_on(shapes[0].position, PLACES).place(places_from_distances(PAIRS, DISTANCES, sd)).sd
    np.testing.assert_allclose(placed.std(axis=0), expected, rtol=0.15)  # sd of an sd over 300: 4 %


def test_free_placing_puts_the_first_at_the_origin_and_the_second_east():
    shape = places_from_distances(PAIRS, DISTANCES, np.full(6, 0.1))
    placed = place_freely(shape.position).place(shape)
    np.testing.assert_allclose(placed.position[:2], [[0, 0], [DISTANCES[0], 0]], atol=1e-6)
    assert placed.position[2, 1] > 0


def test_two_reference_points_do_not_mirror():
    assert np.linalg.det(place_on([[0, 0], [1, 0]], [[5, 5], [5, 6]]).rotation) == pytest.approx(1.0)


def test_a_receiver_with_two_tags_is_measured_by_the_pings_of_both():
    once = record(sigma=1e-3)
    later = (once.tag == 0) & (once.time > 120_000.0)  # half of its 400 pings, some 600 s apart, by another tag
    twice = replace(once, tag=np.where(later, 4, once.tag).astype(np.int32), tags=(*once.tags, "T0-new"))
    both = survey_distances(twice, {**OWN_TAGS, "R0": ("T0", "T0-new")}, 1512.0)
    for line, same in zip(both, survey_distances(once, OWN_TAGS, 1512.0), strict=True):
        assert line.there == same.there and line.back == same.back
    assert survey_distances(twice, OWN_TAGS, 1512.0)[0].there.pings == pytest.approx(200, abs=10)


def test_mistakes_are_named():
    with pytest.raises(ValueError, match="two receivers with own sync tags, got R0"):
        survey_distances(record(), {"R0": "T0"}, 1512.0)
    with pytest.raises(ValueError, match="of R0, R1 none logged its own tag's pings"):
        survey_distances(record(), {"R0": "X", "R1": "Y"}, 1512.0)
    with pytest.raises(ValueError, match="shape of 4 receivers takes 5 distances"):
        places_from_distances(PAIRS[:4], DISTANCES[:4], np.ones(4))
    with pytest.raises(ValueError, match="must be positive, got -1"):
        places_from_distances(PAIRS, [-1.0, *DISTANCES[1:]], np.ones(6))
    with pytest.raises(ValueError, match="groups of receivers"):
        places_from_distances([[0, 1], [1, 2], [0, 2], [3, 4], [4, 5], [3, 5], [0, 1], [1, 2], [0, 2]], np.ones(9), np.ones(9))
    swinging = np.array([[0, 1], [0, 2], [1, 2], [0, 3], [0, 3]])  # 3 hangs by one distance, measured twice
    with pytest.raises(ValueError, match="a receiver can swing"):
        places_from_distances(swinging, [1.0, 1.0, 1.0, 1.0, 1.0], np.ones(5))
    with pytest.raises(ValueError, match="two reference points at least, got 1"):
        place_on([[0, 0]], [[0, 0]])
