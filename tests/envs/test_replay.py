"""Herds as targets: tracks cut at gaps, every beginning equally likely, and no episode across a gap or from animal to animal."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy import stats

from tagtrack.envs.kernels.random import TRACK, uniform_pair
from tagtrack.envs.motions import Replay
from tagtrack.envs.motions.replay import END_ROW, START_ROW, cut_at_gaps, find_stretches, make_table, resample_track
from tagtrack.envs.motions.tracks import Track, find_unbroken
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import build_task

EPISODE = 10  # steps of one second
GAP = 900.0


def swim(rows, *, first=0.0, speed=1.0, tag=""):
    """An animal that swims east at one speed, with a row each second."""
    time = np.arange(rows, dtype=np.float64)
    return Track(time=first + time, position=np.stack([speed * time, 0 * time], axis=1), tag=tag)


def join(*tracks, tag=""):
    """One animal's track of several stretches."""
    return Track(
        time=np.concatenate([track.time for track in tracks]),
        position=np.concatenate([track.position for track in tracks]),
        tag=tag,
    )


def replay(tracks, worlds, *, seed=0, longest_gap=GAP):
    """A simulation of these tracks that has just begun."""
    changes = {"belief.particles": 1, "episode_steps": EPISODE, "time_step": 1.0, "fish": Replay(longest_gap=longest_gap)}
    simulation = Simulation(with_overrides(Scenario(), changes), worlds, tracks=tracks)
    simulation.reset(seed)
    return simulation


def paths_of(simulation, steps=EPISODE):
    """(worlds, steps + 1) positions on the way [m], as complex numbers."""
    path = [simulation.fish_position[:, 0].astype(np.float64)]
    for _ in range(steps):
        simulation.step(np.zeros((simulation.num_worlds, 1, 2)))
        path.append(simulation.fish_position[:, 0].astype(np.float64))
    return np.stack(path, axis=1) @ [1, 1j]


def test_resampling_walks_the_straight_lines_between_rows():
    track = Track(time=np.array([10.0, 14.0, 16.0]), position=np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 6.0]]))
    np.testing.assert_allclose(resample_track(track, 1.0), [[0, 0], [1, 0], [2, 0], [3, 0], [4, 0], [4, 3], [4, 6]])


def test_half_the_time_scale_doubles_the_rows():
    track = Track(time=np.array([0.0, 4.0]), position=np.array([[0.0, 0.0], [4.0, 8.0]]))
    table = make_table((track,), Replay(time_scale=0.5), time_step=1.0, episode_steps=8)
    np.testing.assert_allclose(table.position, np.linspace([0, 0], [4, 8], 9))


@pytest.mark.parametrize("step", [0.1, 0.3, 1.0])
def test_last_row_of_the_file_is_reached_in_spite_of_rounding(step):
    """Thirty is a whole multiple of all three steps, but not of their binary forms."""
    table = resample_track(Track(time=np.array([0.0, 30.0]), position=np.array([[0.0, 0.0], [30.0, 0.0]])), step)
    assert len(table) == round(30 / step) + 1
    assert table[-1, 0] == pytest.approx(30.0)


@given(st.lists(st.floats(0.1, 2000.0), min_size=1, max_size=30))
def test_cutting_loses_only_lone_rows_and_leaves_no_long_gap(waits):
    time = np.cumsum([0.0, *waits])
    track = Track(time=time, position=np.stack([time, -time], axis=1), tag="7")
    pieces = cut_at_gaps(track, GAP)
    gaps = np.array([True, *(np.diff(time) > GAP), True])
    alone = gaps[:-1] & gaps[1:]
    kept = np.concatenate([piece.time for piece in pieces]) if pieces else np.empty(0)
    np.testing.assert_array_equal(kept, time[~alone])
    for piece in pieces:
        assert piece.tag == "7"
        assert np.diff(piece.time).max() <= GAP
        np.testing.assert_array_equal(piece.position, np.stack([piece.time, -piece.time], axis=1))
    for one, other in zip(pieces, pieces[1:], strict=False):
        assert other.time[0] - one.time[-1] > GAP


def test_a_gap_just_within_the_limit_is_interpolated_and_a_longer_one_is_not():
    for wait, stretches in ((GAP, 1), (GAP + 0.5, 2)):
        track = join(swim(20), swim(20, first=19 + wait))
        assert len(find_stretches([track], Replay(), 1.0, EPISODE)) == stretches


def test_a_single_track_begins_where_one_always_did():
    """The rule of one track: a uniform number times the rows that leave a whole episode, rounded down."""
    simulation = replay([swim(173)], worlds=50, seed=3)
    for world, start in enumerate(simulation.worlds.targets["memory"][:, 0, START_ROW]):
        key = (np.uint64(3 + world), np.uint64(0), np.uint64(0), np.uint64(0))
        assert start == int(uniform_pair(key, TRACK, 0)[0] * (173 - EPISODE))
    np.testing.assert_array_equal(simulation.worlds.targets["memory"][..., END_ROW], 172)


def test_every_beginning_of_a_herd_is_equally_likely():
    """Chi-square over all beginnings of three stretches of two animals; refused only at a chance of one in ten thousand."""
    herd = [join(swim(EPISODE + 3), swim(EPISODE + 1, first=5000.0), tag="a"), swim(EPISODE + 8, first=7.0, tag="b")]
    simulation = replay(herd, worlds=12_000)
    starts, counts = np.unique(simulation.worlds.targets["memory"][..., START_ROW], return_counts=True)
    np.testing.assert_array_equal(starts, [0, 1, 2, 13, 24, 25, 26, 27, 28, 29, 30, 31])
    assert stats.chisquare(counts).pvalue > 1e-4


lengths = st.lists(st.lists(st.integers(1, 4 * EPISODE), min_size=1, max_size=4), min_size=1, max_size=4)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(lengths=lengths, seed=st.integers(0, 1000))
def test_no_episode_crosses_a_gap_or_goes_from_one_animal_to_another(lengths, seed):
    """Each stretch has a speed of its own, and swims far from the others: a path at one speed keeps to one stretch."""
    herd, speeds = [], []
    for animal, rows_of in enumerate(lengths):
        pieces = []
        for k, rows in enumerate(rows_of):
            speed = 0.1 + 0.1 * len(speeds)
            speeds.append(speed if rows > EPISODE else np.nan)
            piece = swim(rows, first=3000.0 * k, speed=speed)
            pieces.append(Track(time=piece.time, position=piece.position + 1e5 * len(speeds)))
        herd.append(join(*pieces, tag=str(animal)))
    if np.isnan(speeds).all():
        with pytest.raises(ValueError, match="lower time_scale or episode_steps|no two rows"):
            replay(herd, worlds=4)
        return
    swum = np.abs(np.diff(paths_of(replay(herd, worlds=32, seed=seed)), axis=1))
    np.testing.assert_allclose(swum, np.broadcast_to(swum[:, :1], swum.shape), atol=1e-3)
    assert np.abs(swum[:, :1] - speeds).min(axis=1, initial=np.inf, where=~np.isnan(speeds)).max() < 1e-3


def test_beyond_the_end_of_its_stretch_an_animal_rests():
    simulation = replay([swim(EPISODE + 1), swim(EPISODE + 1)], worlds=4)
    swum = np.abs(np.diff(paths_of(simulation, steps=EPISODE + 5), axis=1))
    np.testing.assert_allclose(swum, [[1.0] * EPISODE + [0.0] * 5] * 4, atol=1e-4)


@pytest.mark.parametrize(
    ("tracks", "says"),
    [
        ([swim(8)], "the track lasts 7 s at time_scale=1, an episode 10 s; lower time_scale or episode_steps$"),
        (
            [swim(8), swim(10)],
            r"the longest of 2 unbroken stretches lasts 9 s at time_scale=1, an episode 10 s; lower time_scale or "
            r"episode_steps, or raise fish.longest_gap \(900 s\)",
        ),
        ([swim(1), swim(1, first=2000.0)], "no two rows lie within 900 s of each other; raise fish.longest_gap"),
    ],
)
def test_tracks_without_a_whole_episode_are_refused_with_the_way_out(tracks, says):
    with pytest.raises(ValueError, match=says):
        replay(tracks, worlds=1)


@pytest.fixture
def herd_file(tmp_path):
    """Two animals for 20 minutes at rows of 60 s, one of them heard again for 30 minutes after an hour."""
    spans = (("a", 0, 1200), ("b", 0, 1200), ("b", 4800, 6600))
    rows = [(tag, t) for tag, first, last in spans for t in range(first, last + 1, 60)]
    path = tmp_path / "herd.csv"
    path.write_text("tag,t_unix_s,x,y\n" + "".join(f"{tag},{t},{0.02 * t},0\n" for tag, t in rows))
    return path


def test_a_task_tells_which_animals_it_replays(herd_file):
    told = build_task("LeopardShark-v0", tracks=herd_file, time_scale=2).describe_tracks()
    assert told == {
        "file": str(herd_file), "animals": 2, "stretches": 3, "hours": 1.167, "time_scale": 2.0, "longest_gap": 900.0,
    }  # fmt: skip
    told = build_task("LeopardShark-v0", tracks=herd_file, time_scale=2.5).describe_tracks()
    assert (told["animals"], told["stretches"]) == (1, 1)  # 600 s of an episode at 2.5 are 25 minutes
    assert build_task("LeopardShark-v0").describe_tracks() is None


def test_longest_gap_is_set_as_any_parameter(herd_file):
    told = build_task("LeopardShark-v0", tracks=herd_file, overrides={"fish.longest_gap": 3600}).describe_tracks()
    assert (told["animals"], told["stretches"]) == (2, 2)
    with pytest.raises(ValueError, match=r"herd.csv: no two rows lie within 30 s of each other; raise fish.longest_gap"):
        build_task("LeopardShark-v0", tracks=herd_file, overrides={"fish.longest_gap": 30})
    with pytest.raises(ValueError, match="longest_gap must be positive, got -1"):
        build_task("LeopardShark-v0", tracks=herd_file, overrides={"fish.longest_gap": -1})


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        ({"fish": "levy"}, r"swims either the tracks of .*herd.csv or by a motion \(fish=levy\); drop one of the two"),
        ({"fish.time_scale": 3}, "time_scale=2 and fish.time_scale=3 are one; drop one"),
        ({"fish.max_speed": 3}, "unknown parameter 'fish.max_speed'"),
    ],
)
def test_two_wishes_for_one_fish_are_refused(herd_file, overrides, says):
    with pytest.raises(ValueError, match=says):
        build_task("LeopardShark-v0", tracks=herd_file, time_scale=2, overrides=overrides)


def test_record_is_cut_where_a_gap_is_longer_than_allowed() -> None:
    time = np.array([0.0, 10.0, 20.0, 100.0, 110.0, 300.0])
    assert find_unbroken(time, 80.0) == [slice(0, 5), slice(5, 6)]
    assert find_unbroken(time, 79.0) == [slice(0, 3), slice(3, 5), slice(5, 6)]
    assert find_unbroken(np.empty(0), 1.0) == []
