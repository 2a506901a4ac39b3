"""Resampling only where few particles count any more: until then they carry weights, by which whoever reads them must go."""

from dataclasses import replace

import numpy as np
import pytest

from tagtrack.envs.belief import row as row_of_particles
from tagtrack.envs.belief.assumptions import Belief, Estimate, filter_rule
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.belief.recovery import Recovery, scatter_share
from tagtrack.envs.belief.renewal import renew
from tagtrack.envs.belief.row import BELIEF, make_scratch
from tagtrack.envs.belief.summary import summarize
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.motion_loops import advance_by_weight
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import NAVIGATION, measurement
from tagtrack.envs.motions import MomentumRandomWalk
from tagtrack.envs.observation import OUTLOOK, look_to_port
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sensors import PresenceReceiver, RangeReceiver
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.tag import Tag

STREAMS = [(np.uint64(7), np.uint64(0), np.uint64(0), np.uint64(step)) for step in range(4)]
AT_REST = MomentumRandomWalk(speed_sigma=1e-6, turn_sigma=1e-6, max_speed=1e-6)
VAGUE = Belief(particles=2000, motion=AT_REST, receiver=RangeReceiver(range_sigma=60.0), resample_below=0.05, half_width=50.0)


@compiled
def draw_by_weight(particles, carried, belief, offset, rule, scratch):
    """The part of the step, for Python to call."""
    return row_of_particles.draw_by_weight(particles, carried, belief, offset, rule, scratch)


def carrying(name: str, share: float = 0.5, **changes: object) -> Scenario:
    return with_overrides(SCENARIOS[f"TagTrack/{name}-v0"], {"belief.particles": 200, "belief.resample_below": share, **changes})


def rule_of(belief: Belief) -> np.record:
    return to_record(filter_rule(belief, Tag()))[0]


def cloud(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Particles of five rows within 100 m of (500, -300), and uneven weights with a mean of 1."""
    rng = np.random.default_rng(seed)
    middle = np.array([500.0, -300.0, 0.0, 0.4, 275.0])[:, None]
    particles = (middle + np.array([100.0, 100.0, 3.0, 0.3, 60.0])[:, None] * rng.uniform(-1, 1, (5, count))).astype(np.float32)
    weights = rng.uniform(size=count) ** 3
    return particles, (weights / weights.mean()).astype(np.float32)


# Who reads the particles goes by their weights.


@pytest.mark.parametrize("count", [1, 7, 1000, 5001])
def test_summary_is_that_of_the_weighted_particles(count: int) -> None:
    """Against float64; sums of so many float32 about a place 70 m away are sure to a millimetre."""
    belief = Belief(particles=count, receiver=PresenceReceiver(max_range_spread=125.0), resample_below=0.5)
    particles, carried = cloud(count)
    found = np.zeros(1, BELIEF)
    port = summarize(particles, carried, found[0], 450.0, -350.0, 0.3, rule_of(belief))
    x, y, _, _, reach = particles.astype(np.float64)
    weight = carried / carried.sum(dtype=np.float64)
    mean_x, mean_y, mean_reach = weight @ x, weight @ y, weight @ reach
    assert found["mean_x"][0] == pytest.approx(mean_x, abs=1e-3) and found["estimate_x"] == found["mean_x"]
    assert found["mean_y"][0] == pytest.approx(mean_y, abs=1e-3)
    for name, moment in (("xx", (x - mean_x) ** 2), ("yy", (y - mean_y) ** 2), ("xy", (x - mean_x) * (y - mean_y))):
        assert found[name][0] == pytest.approx(weight @ moment, abs=0.1), name  # of up to 10,000 m^2
    assert found["estimated"][0] == pytest.approx(mean_reach, abs=1e-3)
    assert found["estimated_spread"][0] == pytest.approx(np.sqrt(weight @ (reach - mean_reach) ** 2), abs=1e-3)
    left = np.cos(0.3) * (y + 350.0) - np.sin(0.3) * (x - 450.0) > 0
    assert port == pytest.approx(weight @ left, abs=1e-5)
    outlook, navigation = np.zeros(1, OUTLOOK), np.zeros(1, NAVIGATION)
    navigation["x"], navigation["y"], navigation["heading"] = 450.0, -350.0, 0.3
    look_to_port(outlook[0], particles, carried, navigation[0])
    assert outlook["port"][0] == pytest.approx(weight @ left, abs=1e-5)


def test_mean_displacement_is_weighted() -> None:
    """Float32 places at 500 m are sure to 3e-5 m."""
    particles, carried = cloud(1000)
    before = particles.astype(np.float64)
    moved = advance_by_weight(*particles[:4], carried, np.float32(2.0))
    expected = carried @ (particles.astype(np.float64) - before)[:2].T / carried.sum(dtype=np.float64)
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-4)


def test_weights_carried_are_the_product_of_all_likelihoods() -> None:
    """Particles at rest that no resampling moves, five vague ranges: Bayes' rule, in float64."""
    belief = ParticleFilter(VAGUE)
    belief.begin(0.0, 0.0, seed=3)
    belief.predict(2.0)
    belief.correct(measurement(time=2.0, x=0.0, y=0.0, readings=[40.0]))  # a first range scatters particles on a ring
    places = belief.particles[0, :2].astype(np.float64)
    expected = belief.weights[0].astype(np.float64)
    for k in range(1, 6):
        belief.predict(2.0)
        belief.correct(measurement(time=2.0 * (k + 1), x=20.0 * k, y=0.0, readings=[90.0]))
        distance = np.hypot(places[0] - 20.0 * k, places[1])
        expected *= VAGUE.weight_floor + np.exp(-0.5 * ((distance - 90.0) / 60.0) ** 2) / (60.0 * np.sqrt(2.0 * np.pi))
    np.testing.assert_allclose(belief.particles[0, :2], places, rtol=0, atol=1e-3)
    np.testing.assert_allclose(belief.weights[0], expected / expected.mean(), rtol=2e-3)
    assert 1.2 < np.square(belief.weights[0]).mean() < 20.0  # no longer even, and not yet resampled


def test_likelihood_of_a_reading_is_its_mean_over_the_weighted_particles() -> None:
    """What recovery follows: w_fast at a rate of 1 is the likelihood of the last reading alone."""
    belief = ParticleFilter(replace(VAGUE, recovery=Recovery(slow_rate=1.0, fast_rate=1.0)))
    belief.begin(0.0, 0.0, seed=3)
    for k in range(4):
        belief.predict(2.0)
        places, weights = belief.particles[0, :2].astype(np.float64), belief.weights[0].astype(np.float64)
        belief.correct(measurement(time=2.0 * (k + 1), x=20.0 * k, y=0.0, readings=[40.0 + 20.0 * k]))
        if k > 0:
            miss = np.hypot(places[0] - 20.0 * k, places[1]) - 40.0 - 20.0 * k
            likelihood = VAGUE.weight_floor + np.exp(-0.5 * (miss / 60.0) ** 2) / (60.0 * np.sqrt(2.0 * np.pi))
            assert belief.summary["w_fast"][0] == pytest.approx((weights * likelihood).mean(), rel=1e-4)
            assert np.square(weights).mean() > (1.01 if k > 1 else 0.99)


# When they are drawn anew.


@pytest.mark.parametrize("heavy", [1, 30, 99, 101, 150, 200])
def test_particles_are_drawn_anew_where_fewer_than_the_share_count(heavy: int) -> None:
    """Of 200, ``heavy`` weigh alike and the others nothing: so many is the effective sample size. Asked for are 100."""
    belief = Belief(particles=200, resample_below=0.5, estimate=Estimate.BEST)
    particles, carried = cloud(200)
    places, scratch, record = particles.copy(), make_scratch(200), np.zeros(1, BELIEF)
    carried[:] = 1.0
    scratch.weight[:] = np.where(np.arange(200) < heavy, 1e-5, 0.0)
    scratch.weight[heavy // 2] *= 1.01
    drawn = draw_by_weight(particles, carried, record[0], 0.5, rule_of(belief), scratch)
    assert drawn == (heavy < 100)
    if drawn:
        assert (carried == 1.0).all() and np.isin(particles[0], places[0, :heavy]).all()
    else:
        np.testing.assert_array_equal(particles, places)
        np.testing.assert_allclose(carried, scratch.weight / scratch.weight.mean(dtype=np.float64), rtol=1e-5)
        assert record["best"][0] == heavy // 2
    assert particles[0, record["best"][0]] == places[0, heavy // 2]


@pytest.mark.parametrize("broken", [np.nan, np.inf, 0.0])
def test_broken_weights_leave_particles_and_what_they_carry_alone(broken: float) -> None:
    particles, carried = cloud(200)
    before, weights, scratch = particles.copy(), carried.copy(), make_scratch(200)
    scratch.weight[:] = broken
    draw_by_weight(particles, carried, np.zeros(1, BELIEF)[0], 0.5, rule_of(Belief(particles=200, resample_below=0.5)), scratch)
    assert particles.tobytes() == before.tobytes() and carried.tobytes() == weights.tobytes()


def sail(scenario: Scenario, worlds: int, steps: int) -> tuple[np.ndarray, float]:
    """(W,) mean errors under one turning course, and the share of the steps after which no particle carried a weight."""
    simulation = Simulation(scenario, worlds)
    simulation.reset(seed=11)
    turning = np.tile(np.array([0.5, 0.8], np.float32), (worlds, 1, 1))
    errors, even = [], []
    for _ in range(steps):
        simulation.step(turning)
        errors.append(simulation.error[:, 0, 0].copy())
        even.append((simulation.worlds.carried == 1.0).all(axis=(1, 2, 3)).mean())
    return np.mean(errors, axis=0), float(np.mean(even))


@pytest.mark.parametrize("name", ["LeopardShark", "RangeOnly", "TimeOfFlight", "AreaOnly"])
def test_half_of_the_resampling_tracks_as_well(name: str) -> None:
    """Mean errors of 200 worlds of 300 steps agree within 3.5 standard errors of their difference, world by world."""
    (always, _), (seldom, even) = (sail(carrying(name, share, **{"belief.particles": 500}), 200, 300) for share in (1.0, 0.5))
    difference = seldom - always
    assert abs(difference.mean()) < 3.5 * difference.std() / np.sqrt(difference.size)
    assert even < 0.75  # without the parameter it would be 1


def test_a_share_of_nearly_one_draws_the_same_particles_as_always() -> None:
    """Whatever a reading tells, fewer than all then count: particles have the same bits, means all but the last ones."""
    course = [measurement(time=2.0 * (k + 1), x=3.0 * k, y=0.0, readings=[80.0 - k]) for k in range(20)]
    always = Belief(particles=300, receiver=RangeReceiver())
    beliefs = [ParticleFilter(each) for each in (always, replace(always, resample_below=1.0 - 1e-7))]
    for belief in beliefs:
        belief.begin(0.0, 0.0, seed=5)
        for told in course:
            belief.predict(2.0)
            belief.correct(told)
    assert beliefs[0].particles.tobytes() == beliefs[1].particles.tobytes()
    np.testing.assert_allclose(beliefs[0].mean, beliefs[1].mean, rtol=0, atol=1e-3)
    assert beliefs[0].rows.carried.size == 0 and (beliefs[0].weights == 1.0).all() and (beliefs[1].weights == 1.0).all()


# Particles from elsewhere.


@pytest.mark.parametrize("how", ["renewed", "random"])
def test_a_particle_put_elsewhere_takes_the_mean_weight_and_not_the_same_one_goes_each_time(how: str) -> None:
    belief = Belief(particles=1000, receiver=RangeReceiver(), renewed_share=0.1, resample_below=0.5)
    moved = []
    for stream in STREAMS:
        particles, carried = cloud(1000)
        before, weights = particles.copy(), carried.copy()
        if how == "renewed":
            renew(particles, carried, np.zeros(1, BELIEF)[0], stream, 0, rule_of(belief))
        else:
            scatter_share(particles, carried, 0.1, 0.0, 0.0, stream, 0, 100.0)
        gone = (particles != before).any(axis=0)
        assert gone.sum() == 100 and carried.mean(dtype=np.float64) == pytest.approx(1.0, abs=1e-6)
        assert np.ptp(carried[gone]) < 1e-6
        np.testing.assert_allclose(carried[~gone] / carried[gone][0], weights[~gone], rtol=1e-6)
        moved.append(int(np.flatnonzero(gone)[0]))
        assert set(np.diff(np.flatnonzero(gone))) == {10}
    assert len(set(moved)) > 1


# The state goes along.


@pytest.mark.parametrize("name", ["LeopardShark", "TimeOfFlight", "RangeOnly", "AreaOnlyUnknownRange"])
def test_filter_that_hears_late_has_the_worlds_belief_bit_for_bit(name: str) -> None:
    """A filter of two threads, told everything three steps late, against the world's own belief; weights and all."""
    scenario = carrying(name)
    simulation = Simulation(scenario, 4)
    simulation.reset(seed=21)
    late = ParticleFilter(scenario.belief, scenario.tag, rows=4, remember=4, threads=2)
    late.begin(simulation.worlds.navigation["x"][:, 0], simulation.worlds.navigation["y"][:, 0], seed=21)
    waiting, uneven = [], 0
    for _ in range(60):
        simulation.step(np.tile(np.array([0.6, 0.8], np.float32), (4, 1, 1)))
        waiting.append(simulation.worlds.measurements[:, :, 0].copy())
        late.predict(scenario.time_step)
        if len(waiting) == 4:
            for told in waiting:
                late.correct(told)
            waiting = []
            assert late.particles.tobytes() == simulation.worlds.particles[:, 0, 0].tobytes()
            assert late.weights.tobytes() == simulation.worlds.carried[:, 0, 0].tobytes()
            assert late.summary.tobytes() == simulation.worlds.beliefs[:, 0, 0].tobytes()
            uneven += (late.weights != 1.0).any()
    assert uneven > 5
    late.close()


def test_loaded_state_goes_on_with_the_weights_it_was_saved_with() -> None:
    simulation = Simulation(carrying("AreaOnly"), 3)
    simulation.reset(seed=2)
    action = np.tile(np.array([0.3, 0.9], np.float32), (3, 1, 1))

    def go_on() -> list[bytes]:
        states = []
        for _ in range(15):
            simulation.step(action)
            states.append(simulation.observation.tobytes() + simulation.worlds.carried.tobytes())
        return states

    go_on()
    state = simulation.save_state()
    assert (simulation.worlds.carried != 1.0).any()
    expected = go_on()
    simulation.reset()
    assert (simulation.worlds.carried == 1.0).all()
    simulation.load_state(state)
    assert go_on() == expected


@pytest.mark.parametrize("share", [0.0, -0.5, 1.01, float("nan")])
def test_a_bad_share_is_named(share: float) -> None:
    with pytest.raises(ValueError, match=r"Belief\.resample_below must be"):
        Belief(resample_below=share)
