"""Ranging and presence receivers: readings drawn and particles scored, against float64 formulae and counts by hand.

Sampled shares and means are allowed four standard errors.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.belief.assumptions import AOTT, Belief, filter_rule
from tagtrack.envs.belief.row import is_told
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import LISTENER, Status, measurement
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sensors import MeasuredReception, PresenceReceiver, RangeReceiver, TimeOfFlightReceiver
from tagtrack.envs.sensors.presence import MAX_RANGE, RECEPTION
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.tag import Tag

RANGE_ONLY, AREA_ONLY = SCENARIOS["TagTrack/RangeOnly-v0"], SCENARIOS["TagTrack/AreaOnly-v0"]
OWN_X, OWN_Y, DEPTH = 40.0, -25.0, 30.0
ERRORS = 4.0


def weights_of(belief: Belief, *, detected: bool, slant_range: float = math.nan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compiled weights, and the slant ranges and fifth row (or NaN) of the particles, which lie within 600 m."""
    rng = np.random.default_rng(3)
    particles = np.zeros((belief.rows, belief.particles), np.float32)
    particles[:2] = rng.uniform(-600, 600, (2, belief.particles))
    if belief.rows > 4:
        particles[4] = rng.uniform(150, 400, belief.particles)
    status = Status.HEARD if detected else Status.MISSED
    told = measurement(time=0.0, x=OWN_X, y=OWN_Y, depth=DEPTH, status=status, readings=[slant_range])
    weight, work = np.ones(belief.particles, np.float32), np.zeros(belief.particles, np.float32)
    sensor = belief.receiver
    assert sensor.weigh is not None
    sensor.weigh(weight, particles, told[0], np.float32(belief.weight_floor), work, np.array(sensor.padded_row()))
    x, y = particles[:2].astype(np.float64)
    reach = particles[4].astype(np.float64) if belief.rows > 4 else np.full(belief.particles, np.nan)
    return weight.astype(np.float64), np.sqrt((x - OWN_X) ** 2 + (y - OWN_Y) ** 2 + DEPTH**2), reach


def test_weight_of_a_range_is_the_normal_density_of_equation_21() -> None:
    """Float32 places at 600 m are sure to 6e-5 m: 1e-5 of a sigma of 6 m."""
    belief = Belief(particles=20_000, receiver=RangeReceiver(range_sigma=6.0, range_factor=1.02), weight_floor=0.0)
    weight, slant, _ = weights_of(belief, detected=True, slant_range=250.0)
    expected = stats.norm.pdf(250.0, loc=1.02 * slant, scale=6.0)
    np.testing.assert_allclose(weight, expected, rtol=0, atol=1e-4 * expected.max())
    assert abs(1.02 * slant[weight.argmax()] - 250.0) < 1.0


def test_silence_of_a_ranging_tag_weighs_only_where_the_belief_is_told_how_far_it_is_heard() -> None:
    """Three pings in ten are missed: out of reach silence is ten thirds as likely as within. Without a reach it says nothing."""
    receiver = RangeReceiver(range_sigma=6.0, max_range=250.0, silence_sigma=15.0, reception=0.7)
    belief = Belief(particles=20_000, receiver=receiver, weight_floor=0.0)
    weight, slant, _ = weights_of(belief, detected=False)
    np.testing.assert_allclose(weight, 1.0 - 0.7 * stats.norm.sf(slant, 250.0, 15.0), rtol=0, atol=1e-5)
    listener = np.zeros(1, LISTENER)
    listener["status"] = int(Status.MISSED)
    told = (to_record(filter_rule(each, Tag()))[0] for each in (belief, replace(belief, receiver=RangeReceiver())))
    assert [bool(is_told(listener[0], rule)) for rule in told] == [True, False]


def test_detection_weighs_by_the_survival_function_and_silence_by_the_cdf() -> None:
    """Equation 22 by its text: heard speaks for near, unheard for far; printed it is the other way round."""
    belief = Belief(particles=20_000, receiver=PresenceReceiver(), weight_floor=0.0)
    heard, slant, _ = weights_of(belief, detected=True)
    np.testing.assert_allclose(heard, stats.norm.sf(slant, 250.0, 4.5), rtol=0, atol=1e-5)
    unheard, slant, _ = weights_of(belief, detected=False)
    np.testing.assert_allclose(unheard, stats.norm.cdf(slant, 250.0, 9.0), rtol=0, atol=1e-5)
    assert heard[slant < 230].min() > 0.99 > 0.01 > unheard[slant < 220].max()


def test_silence_says_less_where_pings_within_range_are_missed() -> None:
    belief = Belief(particles=20_000, receiver=PresenceReceiver(reception=0.6), weight_floor=0.0)
    weight, slant, _ = weights_of(belief, detected=False)
    np.testing.assert_allclose(weight, 1.0 - 0.6 * stats.norm.sf(slant, 250.0, 9.0), rtol=0, atol=1e-5)


def test_heavy_tails_weigh_by_the_cauchy_distribution_with_the_same_scales() -> None:
    belief = Belief(particles=20_000, receiver=PresenceReceiver(reception=0.6, heavy_tails=True), weight_floor=0.0)
    heard, slant, _ = weights_of(belief, detected=True)
    np.testing.assert_allclose(heard, stats.cauchy.sf(slant, 250.0, 4.5), rtol=0, atol=1e-5)
    unheard, slant, _ = weights_of(belief, detected=False)
    np.testing.assert_allclose(unheard, 1.0 - 0.6 * stats.cauchy.sf(slant, 250.0, 9.0), rtol=0, atol=1e-5)


@pytest.mark.parametrize("detected", [True, False])
def test_each_particle_is_weighed_by_its_own_range_where_that_is_estimated(detected: bool) -> None:
    receiver = PresenceReceiver(max_range=275.0, max_range_spread=125.0, detection_sigma=40.0, silence_sigma=50.0, reception=0.8)
    weight, slant, reach = weights_of(Belief(particles=20_000, receiver=receiver, weight_floor=0.01), detected=detected)
    expected = stats.norm.sf(slant, reach, 40.0) if detected else 1.0 - 0.8 * stats.norm.sf(slant, reach, 50.0)
    np.testing.assert_allclose(weight, 0.01 + expected, rtol=0, atol=1e-5)


def anchored(scenario: Scenario, distance: float, **changes: object) -> Scenario:
    """A fish that rests at a distance; one particle, since only what is heard counts."""
    still = {"fish.max_speed": 1e-9, "start": replace(scenario.start, nearest=distance, farthest=distance), "belief.particles": 1}
    return with_overrides(scenario, {**still, "vehicle.max_speed": 1e-9, **changes})


class Course(NamedTuple):
    """What became of each ping of a vehicle at rest, each (steps, worlds)."""

    pinged: np.ndarray  # in truth
    detected: np.ndarray
    missed: np.ndarray  # for certain, as the listener takes it
    reading: np.ndarray  # the first


def hear(scenario: Scenario, worlds: int, steps: int) -> Course:
    simulation = Simulation(scenario, worlds)
    simulation.reset(seed=5)
    rows = []
    for _ in range(steps):
        simulation.step(np.zeros((worlds, 1, 2), np.float32))
        pair = (slice(None), 0, 0)
        truth, told = (getattr(simulation.worlds, name)[pair] for name in ("encounters", "measurements"))
        listener = simulation.listeners[pair]
        detected, missed = told["status"] == int(Status.HEARD), listener["status"] == int(Status.MISSED)
        rows.append((truth["pinged"].copy(), detected, missed, told["readings"][:, 0].copy()))
    return Course(*(np.array(column) for column in zip(*rows, strict=True)))


def test_range_is_scaled_noisy_and_slant() -> None:
    """3-4-5: at 300 m and 400 m down 500 m, 1 % more for the sound speed; uniform +-3 m has the variance 3."""
    at_depth = {"start.deepest": 400.0, "start.shallowest": 400.0, "receiver.range_factor": 1.01, "receiver.range_sigma": 2.0}
    course = hear(anchored(RANGE_ONLY, 300.0, **at_depth, **{"receiver.range_tolerance": 3.0}), 500, 40)
    readings = course.reading[course.detected]
    assert readings.size > 15_000
    assert abs(readings.mean() - 505.0) < ERRORS * math.sqrt(7.0 / readings.size)
    assert readings.var() == pytest.approx(4.0 + 3.0, rel=ERRORS * math.sqrt(2.0 / readings.size))


@pytest.mark.parametrize(("distance", "share"), [(600.0, 0.9), (899.0, 0.9 / (1 + math.exp(-1.0))), (1000.0, 0.0)])
def test_ranges_drop_out_and_end_at_the_reach(distance: float, share: float) -> None:
    changes = {"water.edge_width": 1.0, "start.shallowest": 0.0, "start.deepest": 0.0}
    detected = hear(anchored(RANGE_ONLY, distance, **changes), 500, 20).detected
    assert abs(detected.mean() - share) <= ERRORS * math.sqrt(share * (1 - share) / detected.size)


def test_presence_is_heard_as_the_text_says() -> None:
    """Nine tenths at the working range of 250 m, a fifth at 400 m, times the episode's reception (sf(-9/7), sf(6/7))."""
    receiver = AREA_ONLY.receiver
    assert isinstance(receiver, PresenceReceiver) and receiver.chance is not None
    parameters = np.array(receiver.padded_row())
    assert receiver.chance(250.0, 340.0, 1.0, parameters) == pytest.approx(0.9007, abs=1e-4)
    assert receiver.chance(400.0, 340.0, 0.6, parameters) == pytest.approx(0.6 * 0.1957, abs=1e-4)
    assert receiver.working_range == pytest.approx(250.0, abs=0.5)


def test_reception_and_unknown_range_are_drawn_anew_for_each_episode() -> None:
    simulation = Simulation(with_overrides(SCENARIOS["TagTrack/AreaOnlyUnknownRange-v0"], {"belief.particles": 1}), 2000)
    simulation.reset(seed=0)
    drawn = simulation.worlds.targets["drawn"][:, 0].copy()
    for place, low, high in ((RECEPTION, 0.6, 1.0), (MAX_RANGE, 150.0, 400.0)):
        assert stats.kstest(drawn[:, place], "uniform", args=(low, high - low)).pvalue > 1e-3
    simulation.reset()
    assert (simulation.worlds.targets["drawn"][:, 0] != drawn).all()


def test_measured_reception_is_the_campaigns_and_ends_at_400_m() -> None:
    receiver = MeasuredReception()
    assert receiver.chance is not None
    parameters = np.array(receiver.padded_row())
    chance = [receiver.chance(d, 0.0, 0.0, parameters) for d in (48.0, 95.0, 193.0, 399.0, 401.0, 5000.0)]
    np.testing.assert_allclose(chance, [0.31, 0.47, 0.53, 0.2, 0.0, 0.0], atol=0.03)  # cells of 8 m
    course = hear(anchored(AREA_ONLY, 193.0, receiver="measured"), 400, 60)
    assert course.detected.sum() / course.pinged.sum() == pytest.approx(0.52, abs=0.02)


def test_silence_tells_something_only_when_a_ping_was_certainly_due() -> None:
    """A fish beyond hearing: any 90 s hold a ping, so each third step of 30 s counts, and no other."""
    course = hear(anchored(AREA_ONLY, 3000.0), 3, 30)
    assert not course.detected.any()
    assert (course.missed == (np.arange(1, 31) % 3 == 0)[:, None]).all()
    assert (course.pinged.sum(axis=0) >= course.missed.sum(axis=0)).all()


def test_after_a_detection_the_next_silence_counts_once_the_longest_interval_has_passed() -> None:
    """Half of the pings are missed; the ping itself came up to 30 s before the end of its step."""
    perfect = {"receiver.reception": 0.5, "receiver.reception_spread": 0.0}
    course = hear(anchored(AREA_ONLY, 10.0, **perfect), 200, 200)
    for world in range(200):
        told = np.flatnonzero(course.detected[:, world] | course.missed[:, world])
        for before, after in zip(told, told[1:], strict=False):
            if course.missed[after, world]:
                assert (after - before) * 30.0 in (90.0, 120.0) if course.missed[before, world] else (60.0, 90.0)
    assert course.detected.sum() / course.pinged.sum() == pytest.approx(0.5, abs=0.02)


def test_belief_finds_the_range_of_the_receiver_together_with_the_position() -> None:
    """Mean miss over 64 episodes below 45 m; a belief that learned nothing would be 62 m off (125 / 2)."""
    simulation = Simulation(with_overrides(SCENARIOS["TagTrack/AreaOnlyUnknownRange-v0"], {"belief.particles": 2000}), 64)
    simulation.reset(seed=2)
    across = np.tile(np.array([0.2, 1.0], np.float32), (64, 1, 1))
    for _ in range(360):
        simulation.step(across)
    belief, max_range = simulation.worlds.beliefs[:, 0, 0], simulation.worlds.targets["drawn"][:, 0, MAX_RANGE]
    assert np.abs(belief["estimated"] - max_range).mean() < 45.0
    assert 5.0 < belief["estimated_spread"].mean() < 60.0
    assert (simulation.worlds.particles[:, 0, 0, 4] >= 150.0).all() and (simulation.worlds.particles[:, 0, 0, 4] <= 400.0).all()


def test_paper_filter_is_there_by_name() -> None:
    scenario = with_overrides(AREA_ONLY, {"belief": "aott"})
    assert scenario.belief == AOTT and AOTT.particles == 10_000 and AOTT.renewed_share == 0.015
    assert AOTT.receiver == PresenceReceiver(max_range=250.0, detection_sigma=4.5, silence_sigma=9.0, reception=1.0)


def test_fields_of_a_belief_of_a_known_range_hold_what_is_assumed() -> None:
    simulation = Simulation(with_overrides(AREA_ONLY, {"belief.particles": 50, "belief.receiver.max_range": 260.0}), 2)
    simulation.reset(seed=0)
    beliefs = simulation.worlds.beliefs
    assert (beliefs["estimated"] == 260.0).all() and (beliefs["estimated_spread"] == 0.0).all()
    assert simulation.worlds.particles.shape[3] == 4


@pytest.mark.parametrize("kind", [RangeReceiver, TimeOfFlightReceiver])
@pytest.mark.parametrize("factor", [1e-17, 0.0, -1.0, 11.0])
def test_a_factor_of_no_sound_speed_is_refused(kind: type, factor: float) -> None:
    """A reading divided by it would put particles where float32 ends."""
    with pytest.raises(ValueError, match="range_factor must be from 0.1 to 10, got"):
        kind(range_factor=factor)
