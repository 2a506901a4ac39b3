"""The filter by itself: the simulation's own, bit for bit; late measurements give the belief that they would have given in time.

Measurements are those of a simulation, or written by hand; the filter never sees the world.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.measurement import MEASUREMENT, Status, measurement
from tagtrack.envs.motions import MomentumRandomWalk
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sensors import RangeReceiver, StereoHydrophone
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.tag import Tag

RANGE_ONLY = SCENARIOS["TagTrack/RangeOnly-v0"]


def recorded(scenario: Scenario, steps: int, seed: int = 3) -> tuple[Simulation, np.ndarray, np.ndarray]:
    """A simulation after some steps, its measurements (K, V), and where its vehicles began (V, 2)."""
    simulation = Simulation(scenario)
    simulation.reset(seed)
    navigation = simulation.worlds.navigation[0]
    begun = np.stack([navigation["x"], navigation["y"]], axis=-1)
    rng, told = np.random.default_rng(1), []
    for _ in range(steps):
        simulation.step(rng.uniform(-1, 1, (1, scenario.vehicles, len(simulation.action_names))).astype(np.float32))
        told.append(simulation.worlds.measurements[0, :, 0].copy())
    return simulation, np.array(told), begun


def state_of(particle_filter: ParticleFilter) -> bytes:
    """All that a belief holds; reading the summary brings it up to date."""
    return b"".join(
        array.tobytes() for array in (particle_filter.summary, particle_filter.particles, particle_filter.listeners)
    )


@pytest.mark.parametrize("env_id", [name.split("/")[1] for name in SCENARIOS])
def test_filter_is_the_simulations_own_bit_for_bit(env_id: str) -> None:
    scenario = with_overrides(SCENARIOS[f"TagTrack/{env_id}"], {"belief.particles": 200})
    simulation, told, begun = recorded(scenario, 60)
    own = ParticleFilter(scenario.belief, scenario.tag)
    own.begin(*begun[0], seed=3)
    for measurements in told:
        own.predict(scenario.time_step)
        own.correct(measurements)
        own.summary  # noqa: B018 - as the simulation does at each step
    worlds = simulation.worlds
    assert own.particles.tobytes() == worlds.particles[0, 0].tobytes()
    assert own.summary.tobytes() == worlds.beliefs[0, 0].tobytes()
    assert own.listeners.tobytes() == worlds.listeners[0].tobytes()


FLEET = with_overrides(replace(RANGE_ONLY, vehicles=3), {"belief.particles": 100, "start.separation": 100.0})
STEPS = 14


@pytest.fixture(scope="module")
def fleet() -> tuple[np.ndarray, np.ndarray]:
    """Measurements (K, 3) of three vehicles that share a belief, and where they began."""
    _, told, begun = recorded(FLEET, STEPS)
    return told, begun


def run_late(told: np.ndarray, begun: np.ndarray, delays: np.ndarray, order: np.random.Generator) -> bytes:
    """The belief after all messages have come, each after so many steps, those of one step in any order, one by one."""
    own = ParticleFilter(FLEET.belief, FLEET.tag, vehicles=3, remember=10)
    own.begin(*begun[0], seed=3)
    last = int(delays.max()) + len(told)
    for step in range(len(told)):
        own.predict(FLEET.time_step)
        arrived = [told[k, v] for k, v in np.argwhere(np.arange(len(told))[:, None] + delays == step)]
        for message in order.permutation(len(arrived)):
            own.correct(arrived[message][None])
    for step in range(len(told), last):
        for k, v in np.argwhere(np.arange(len(told))[:, None] + delays == step):
            own.correct(told[k, v][None])
    return state_of(own)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 6), min_size=3 * STEPS, max_size=3 * STEPS), st.integers(0, 1000))
def test_late_messages_in_any_order_give_the_belief_that_they_would_have_given_in_time(fleet, delays, seed) -> None:
    """Three vehicles, up to six steps late and out of order: bit for bit."""
    told, begun = fleet
    punctual = ParticleFilter(FLEET.belief, FLEET.tag, vehicles=3)
    punctual.begin(*begun[0], seed=3)
    for measurements in told:
        punctual.predict(FLEET.time_step)
        punctual.correct(measurements)
    in_time = state_of(punctual)
    late = run_late(told, begun, np.array(delays).reshape(STEPS, 3), np.random.default_rng(seed))
    assert late == in_time


def test_measurement_between_two_predictions_is_as_if_one_had_predicted_to_it() -> None:
    def begin() -> ParticleFilter:
        own = ParticleFilter(RANGE_ONLY.belief, RANGE_ONLY.tag, remember=5)
        own.begin(0.0, 0.0)
        return own

    between = measurement(time=14.0, x=5.0, y=0.0, readings=[210.0])
    after = measurement(time=20.0, x=9.0, y=1.0, readings=[208.0])
    late, in_time = begin(), begin()
    late.predict(10.0)
    late.predict(10.0)
    late.correct(after)
    late.correct(between)
    for until, told in ((10.0, None), (14.0, between), (20.0, after)):
        in_time.predict(until - in_time.time)
        if told is not None:
            in_time.correct(told)
    assert state_of(late) == state_of(in_time)


def test_any_time_step_will_do_and_the_spread_grows_with_the_time_that_passed() -> None:
    still = Belief(particles=4000, motion=MomentumRandomWalk(speed_sigma=0.0, turn_sigma=0.0, max_speed=1.0), half_width=1.0)
    spread = []
    for steps in ((10.0,), (1.0, 2.5, 6.5)):
        own = ParticleFilter(still)
        own.begin(0.0, 0.0)
        for step in steps:
            own.predict(step)
        assert own.time == 10.0
        spread.append(own.covariance[0, 0, 0])
    assert spread[0] == pytest.approx(spread[1], rel=1e-5)
    assert spread[0] == pytest.approx(10.0**2 / 6.0 + 1.0 / 3.0, rel=0.1)  # speeds uniform to 1 m/s, all directions


PLACES = [(0.0, 0.0), (100.0, 0.0), (50.0, 86.6)]  # 100 m apart


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_first_three_ranges_find_the_fish_in_any_order_of_vehicles(order: tuple[int, ...]) -> None:
    """Three exact ranges at the first correction: at least 70 % of 1,000 particles within 30 m (median of 20 fish)."""
    rng, shares = np.random.default_rng(5), []
    for seed in range(20):
        direction, distance = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(100.0, 300.0)
        fish = np.array([50.0 + distance * math.cos(direction), 29.0 + distance * math.sin(direction)])
        own = ParticleFilter(RANGE_ONLY.belief, RANGE_ONLY.tag, vehicles=3)
        own.begin(50.0, 29.0, seed=seed)
        own.predict(10.0)
        ranges = [np.hypot(*(fish - PLACES[v])) for v in order]
        told = [
            measurement(time=10.0, vehicle=k, x=PLACES[v][0], y=PLACES[v][1], readings=[ranges[k]]) for k, v in enumerate(order)
        ]
        own.correct(np.concatenate(told))
        shares.append((np.hypot(own.particles[0, 0] - fish[0], own.particles[0, 1] - fish[1]) < 30.0).mean())
    assert np.median(shares) >= 0.7


def ready(**options: int) -> ParticleFilter:
    own = ParticleFilter(Belief(particles=50, receiver=RangeReceiver()), Tag(period=10.0), **options)
    own.begin(0.0, 0.0)
    own.predict(10.0)
    own.predict(10.0)
    return own


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"time": math.nan}, "time must be finite, got nan"),
        ({"x": math.nan}, "at 20 s: x must be finite, got nan"),
        ({"heading": math.inf}, "heading must be finite, got inf"),
        ({"depth": math.nan}, "depth must be finite, got nan"),
        ({"readings": [math.nan]}, "the reading 'slant_range' must be finite, got nan"),
        ({"readings": []}, "the reading 'slant_range' must be finite, got nan"),
        ({"time": 25.0}, "is from the future: the belief is at 20 s; predict first"),
        ({"time": 5.0}, "is too old: the belief remembers what came after 10 s; raise remember"),
        ({"tag": 7}, "the measurement of tag 7 by vehicle 0 at 20 s: this belief is about tag 0"),
        ({"vehicle": 1}, "vehicles are numbered from 0 to 0"),
    ],
)
def test_bad_measurement_is_named_and_changes_nothing(changes: dict, says: str) -> None:
    own = ready(remember=1)
    before = state_of(own)
    with pytest.raises(ValueError, match=says):
        own.correct(measurement(**{"time": 20.0, "x": 0.0, "y": 0.0, "readings": [100.0], **changes}))
    assert state_of(own) == before and own.time == 20.0


def test_second_measurement_of_a_vehicle_at_one_time_is_refused() -> None:
    own = ready()
    told = measurement(time=20.0, x=0.0, y=0.0, readings=[100.0])
    with pytest.raises(ValueError, match="this vehicle has told another one of that time; predict to the time of each"):
        own.correct(np.concatenate([told, told]))
    own.correct(told)
    with pytest.raises(ValueError, match="the belief was corrected at 20 s already"):
        own.correct(told)


def test_wrong_records_status_and_beginnings_are_named() -> None:
    own = ready()
    with pytest.raises(ValueError, match="measurements must be .* of MEASUREMENT, got float64"):
        own.correct(np.zeros(3))
    told = measurement(time=20.0, x=0.0, y=0.0, readings=[100.0])
    told["status"] = 9
    with pytest.raises(ValueError, match="status must be one of ABSENT, NOTHING, HEARD, MISSED, got 9"):
        own.correct(told)
    own.correct(np.zeros(2, MEASUREMENT))  # nothing there
    assert Status(0) == Status.ABSENT
    with pytest.raises(RuntimeError, match="the belief has not begun; call begin first"):
        ParticleFilter(Belief()).predict(1.0)
    with pytest.raises(ValueError, match="x must be finite, got nan"):
        ParticleFilter(Belief()).begin(math.nan, 0.0)


@pytest.mark.parametrize("time_step", [-1.0, 0.0, math.nan, math.inf])
def test_time_step_must_be_positive_and_finite(time_step: float) -> None:
    with pytest.raises(ValueError, match="time_step must be a positive number of seconds"):
        ready().predict(time_step)


@pytest.mark.parametrize("options", [{"rows": 0}, {"vehicles": True}, {"remember": -1}, {"threads": 0}])
def test_bad_sizes_are_named(options: dict) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(options))} must be a whole number of at least"):
        ParticleFilter(Belief(), **options)


def test_rows_are_told_by_their_tags_and_threads_change_nothing() -> None:
    belief = Belief(particles=50, receiver=RangeReceiver())
    states = []
    for threads in (1, 2):
        own = ParticleFilter(belief, rows=4, tags=[5, 6, 5, 6], threads=threads)
        own.begin(0.0, 0.0)
        own.predict(10.0)
        own.correct(measurement(time=10.0, tag=5, x=0.0, y=0.0, readings=[80.0]))
        states.append(state_of(own))
        assert own.summary["corrections"].tolist() == [1, 0, 1, 0]
        own.close()
    assert states[0] == states[1]


def test_jitter_parts_the_children_of_one_particle_and_widens_the_cloud_as_said() -> None:
    """Regularized resampling, no motion: no two particles alike, and the covariance times 1 + (jitter N^(-1/6))^2, within 2 %."""
    clouds = []
    for jitter in (0.0, 1.0):
        still = MomentumRandomWalk(speed_sigma=0.0, turn_sigma=0.0, max_speed=1e-9)
        belief = Belief(particles=20_000, motion=still, receiver=StereoHydrophone(), jitter=jitter)
        own = ParticleFilter(belief)
        own.begin(0.0, 0.0)
        own.predict(1.0)
        own.correct(measurement(time=1.0, x=0.0, y=0.0, readings=[7.0, 10.0]))
        clouds.append((len(np.unique(own.particles[0, 0])), own.covariance[0]))
    (alike, before), (parted, after) = clouds
    assert alike < 12_000 and parted > 19_900
    np.testing.assert_allclose(np.diag(after) / np.diag(before), 1.0 + 20_000 ** (-1.0 / 3.0), rtol=0.02)
