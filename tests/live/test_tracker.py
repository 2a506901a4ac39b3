"""A tracker that is told what an environment's episode holds is that episode, bit for bit; and what it does at sea."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.measurement import Status, measurement
from tagtrack.envs.task import build_task
from tagtrack.live import Conventions, Tracker
from tests.live.conftest import MATHEMATICAL, depths_of, events_of, feed, sail
from tests.tasks import LONE

CASES = [
    *((env_id, 1, "circle") for env_id in LONE),
    ("LeopardShark-v0", 3, "information"),
    ("RangeOnly-v0", 2, "uncertain"),
]


@pytest.mark.parametrize(("env_id", "tags", "policy"), CASES)
def test_belief_observation_and_orders_are_those_of_the_environment(env_id: str, tags: int, policy: str) -> None:
    task = build_task(env_id, particles=200, tags=tags)
    tracker: Tracker | None = None
    ordered = math.nan
    for step, simulation, _ in sail(task, policy, seed=5, steps=60):
        if tracker is None:
            tracker = Tracker(task, policy=policy, seed=5, conventions=MATHEMATICAL, depths=depths_of(simulation))
        feed(tracker, events_of(simulation, step))
        command = tracker.steer(step * task.scenario.time_step)
        np.testing.assert_array_equal(tracker.observation, simulation.observation[0, 0])
        np.testing.assert_array_equal(tracker.believer.worlds.particles, simulation.worlds.particles)
        estimates = tracker.estimates(step * task.scenario.time_step)
        assert [[each.best_x, each.best_y] for each in estimates] == simulation.estimate[0, 0].tolist()
        if step > 0:
            assert ordered == simulation.worlds.vehicles["course"][0, 0]
        ordered = command.course
    assert tracker is not None and not tracker.counts


def test_late_readings_give_the_belief_that_they_would_have_given_in_time() -> None:
    task = build_task("RangeOnly-v0", particles=200)
    rng = np.random.default_rng(3)
    trackers = [Tracker(task, conventions=MATHEMATICAL) for _ in range(2)]
    late: list[tuple[int, Any]] = []
    for step, simulation, _ in sail(task, "circle", seed=2, steps=60):
        navigation, *pings = events_of(simulation, step)
        feed(trackers[0], [navigation, *pings])
        feed(trackers[1], [navigation])
        late += [(step + int(rng.integers(0, 6)), ping) for ping in pings]
        for tracker in trackers:
            tracker.advance(step * task.scenario.time_step)
        due = [ping for when, ping in late if when <= step or step == 60]
        late = [(when, ping) for when, ping in late if when > step and step < 60]
        feed(trackers[1], [due[k] for k in rng.permutation(len(due))])
    in_time, afterwards = (tracker.believer.worlds for tracker in trackers)
    np.testing.assert_array_equal(afterwards.particles, in_time.particles)
    assert afterwards.listeners.tobytes() == in_time.listeners.tobytes()
    assert trackers[1].counts["late"] > 20 and not trackers[0].counts


def test_a_reading_within_a_step_counts_at_its_own_time_from_where_the_vehicle_was_then() -> None:
    task = build_task("RangeOnly-v0", particles=200)
    tracker = Tracker(task, conventions=MATHEMATICAL)
    tracker.navigate(0.0, 0.0, 0.0, 0.0, 1.0)
    tracker.hear(4.0, 0, range=120.0)
    tracker.navigate(10.0, 10.0, 0.0, 0.5, 1.0)
    tracker.advance(10.0)
    belief = ParticleFilter(task.scenario.belief, task.scenario.tag)
    belief.begin(0.0, 0.0)
    belief.predict(4.0)
    belief.correct(measurement(time=4.0, x=4.0, y=0.0, heading=0.2, readings=[120.0], arrival=4.0))
    belief.predict(6.0)
    belief.correct(measurement(time=10.0, x=10.0, y=0.0, heading=0.5, status=Status.NOTHING))
    np.testing.assert_array_equal(tracker.believer.filters[0].particles, belief.particles)


def at_sea(**options: Any) -> Tracker:
    tracker = Tracker("LeopardShark-v0", particles=100, tags=["A", "B"], policy="circle:20", **options)
    tracker.navigate(1e9, 0.0, 0.0, heading=90.0, speed=1.0)
    return tracker


def test_a_tag_that_never_pinged_is_lost_and_its_cloud_grows() -> None:
    tracker = at_sea()
    first = tracker.estimates(1e9)[1].covariance.trace()
    for second in range(1, 61):
        tracker.hear(1e9 + second, "A", bearing_units=0.0)
        tracker.navigate(1e9 + second, 0.0, 0.0, 90.0, 1.0)
    heard, silent = tracker.estimates(1e9 + 60)
    assert heard.heard == 1e9 + 60 and not heard.lost
    assert math.isnan(silent.heard) and silent.lost
    assert silent.covariance.trace() > first > heard.covariance.trace()


def test_headings_and_speeds_are_those_of_the_mission() -> None:
    """North is 0 for one and pi / 2 for the other; a knot is 1852 m an hour."""
    for conventions, heading, speed in ((Conventions(speeds="knots"), 0.0, 2.0), (MATHEMATICAL, math.pi / 2, 2 * 1852 / 3600)):
        tracker = Tracker("LeopardShark-v0", particles=50, policy="circle:20", conventions=conventions)
        tracker.navigate(0.0, 3.0, 4.0, heading, speed)
        own = tracker.believer.worlds.navigation[0, 0]
        assert own["heading"] == pytest.approx(math.pi / 2) and own["speed"] == pytest.approx(1.0289, abs=1e-4)
        command = tracker.steer(0.0)
        assert command.speed == pytest.approx(1.3 if conventions is MATHEMATICAL else 1.3 * 3600 / 1852)
        assert conventions.heading_in(command.course) == pytest.approx(tracker.believer.order(np.zeros(2))[0], abs=4)


def test_places_in_degrees() -> None:
    pytest.importorskip("pymap3d")
    tracker = Tracker("RangeOnly-v0", particles=500, conventions=Conventions(origin=(-118.0, 33.5)))
    for step in range(30):
        angle = 0.3 * step
        place = tracker.conventions.place_out(100.0 * math.cos(angle), 100.0 * math.sin(angle))
        tracker.navigate(10.0 * step, *place)
        if step:
            tracker.hear(10.0 * step, 0, range=math.dist((100.0 * math.cos(angle), 100.0 * math.sin(angle)), (30.0, 40.0)))
    (estimate,) = tracker.estimates(290.0)
    assert math.dist(tracker.conventions.place_in(estimate.x, estimate.y), (30.0, 40.0)) < 8.0
    with pytest.raises(ValueError, match="is 1.* km from the origin"):
        tracker.navigate(300.0, -100.0, 33.5)


def test_heading_and_speed_that_are_not_told_are_those_made_good() -> None:
    tracker = Tracker("RangeOnly-v0", particles=50)
    tracker.navigate(0.0, 0.0, 0.0)
    tracker.navigate(10.0, 0.0, 15.0)
    assert tracker.pose.heading == pytest.approx(math.pi / 2) and tracker.pose.speed == pytest.approx(1.5)


def test_navigation_that_stalls_is_reckoned_on_and_told() -> None:
    tracker = at_sea(stale=6.0)
    assert not tracker.steer(1e9 + 6.0).stale
    assert tracker.steer(1e9 + 30.0).stale
    own = tracker.believer.worlds.navigation[0, 0]
    assert own["x"] == pytest.approx(6.0)  # east at 1 m/s, and then nobody knows


def test_doubled_and_late_lines_are_dropped_and_counted() -> None:
    tracker = at_sea(late=10.0)
    tracker.navigate(1e9 + 60, 0.0, 0.0, 90.0, 1.0)
    tracker.advance(1e9 + 60)
    assert tracker.hear(1e9 + 55, "A", bearing_units=1.0)
    assert not tracker.hear(1e9 + 55.05, "A", bearing_units=1.0)
    assert tracker.hear(1e9 + 55.05, "B", bearing_units=1.0)
    assert not tracker.hear(1e9 + 40, "A", bearing_units=1.0)
    assert not tracker.hear(1e9 - 1, "A", bearing_units=1.0)
    assert tracker.counts == {"late": 2, "doubled": 1, "too late": 1, "before the first step": 1}
    assert not Tracker("LeopardShark-v0", particles=50).hear(0.0, 0, bearing_units=1.0)


BAD = {
    "tag": (lambda t: t.hear(1e9, "C", bearing_units=1.0), "tag 'C' is not in this mission; its tags are A, B"),
    "missing": (lambda t: t.hear(1e9, "A"), "tag 'A': a StereoHydrophone needs bearing_units"),
    "other sensor": (lambda t: t.hear(1e9, "A", range=3.0), "reads bearing_units, strength, got range"),
    "huge": (lambda t: t.hear(1e9, "A", bearing_units=1e300), "tag 'A': bearing_units must be within"),
    "time": (lambda t: t.hear(math.nan, "A", bearing_units=1.0), "tag 'A': t must be finite, got nan"),
    "place": (lambda t: t.navigate(1e9, math.inf, 0.0), "navigation: x must be finite, got inf"),
    "back": (lambda t: t.navigate(1e9 - 5, 0.0, 0.0), "navigation goes back in time, from 1000000000 to 999999995 s"),
    "leap": (lambda t: t.navigate(1e9 + 4000, 0.0, 0.0), "the clock leaps ahead to 1000004000 s, by more than 3600 s"),
    "leaping ping": (lambda t: t.hear(2e9, "A", bearing_units=1.0), "the clock leaps ahead"),
    "leaping order": (lambda t: t.steer(2e9), "the clock leaps ahead"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_is_refused_and_the_tracker_stays_as_it_was(name: str) -> None:
    act, message = BAD[name]
    tracker, other = at_sea(), at_sea()
    with pytest.raises(ValueError, match=message):
        act(tracker)
    for each in (tracker, other):
        each.hear(1e9 + 2, "A", bearing_units=-3.0)
        each.navigate(1e9 + 2, 1.0, 0.0, 90.0, 1.0)
        each.advance(1e9 + 2)
    np.testing.assert_array_equal(tracker.observation, other.observation)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"task": "Leopard-v0"}, "unknown"),
        ({"tags": ["a", "a"]}, "each tag is named once"),
        ({"policy": "circel"}, "unknown policy 'circel'"),
        ({"policy": "oracle_circle"}, "looks at the true place of the fish"),
        ({"late": -1.0}, "late must be at least 0 seconds, got -1.0"),
        ({"depths": {7: 1.0}}, "tag 7 is not in this mission"),
        ({"conventions": Conventions, "headings": "degrees"}, "headings must be nautical or mathematical, got 'degrees'"),
        ({"task": build_task("LeopardShark-v0", vehicles=2)}, "one vehicle's, got vehicles=2"),
    ],
)
def test_wrong_options_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        if "conventions" in options:
            Conventions(headings=options["headings"])
        Tracker(options.pop("task", "LeopardShark-v0"), **options)


def test_there_is_nothing_before_the_first_navigation_and_without_a_policy() -> None:
    with pytest.raises(RuntimeError, match="begins with the first navigation"):
        Tracker("LeopardShark-v0", particles=50).estimates(0.0)
    with pytest.raises(RuntimeError, match="nobody steers"):
        Tracker("LeopardShark-v0", particles=50).steer(0.0)
