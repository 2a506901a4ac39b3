"""Augmented Monte Carlo localization (Lin et al. 2013, Alg. 2; Thrun et al. 2005): random particles, second resampling."""

import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.belief.recovery import Recovery, SecondResampling, follow_likelihood, scatter_share, wants_second_resampling
from tagtrack.envs.belief.row import BELIEF
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import measurement
from tagtrack.envs.motions import MomentumRandomWalk
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.sensors import TimeOfFlightReceiver
from tagtrack.envs.simulation import Simulation

TASK = SCENARIOS["TagTrack/TimeOfFlight-v0"]
RECOVERY = "belief.recovery.second_resampling"
STREAM = (np.uint64(7), np.uint64(0), np.uint64(0), np.uint64(4))
NONE_CARRIED = np.zeros(0, np.float32)  # every correction resamples
RATES = Recovery(slow_rate=0.05, fast_rate=0.4)


def shares_of(likelihoods: np.ndarray, recovery: Recovery) -> np.ndarray:
    """Table 8.3 of Thrun et al. in float64."""
    w_slow = w_fast = 0.0
    shares = []
    for w_avg in likelihoods:
        w_slow += recovery.slow_rate * (w_avg - w_slow)
        w_fast += recovery.fast_rate * (w_avg - w_fast)
        shares.append(max(0.0, 1.0 - w_fast / w_slow))
    return np.array(shares)


def test_share_of_random_particles_is_that_of_thrun() -> None:
    """Good readings, an outlier, a lost fish: weights of 500 particles, float32, whose sums are sure to 1e-5."""
    rng = np.random.default_rng(0)
    level = np.concatenate([np.full(40, 0.02), [1e-7], np.full(10, 0.02), np.full(30, 1e-7)])
    weights = (level[:, None] * rng.uniform(0.2, 1.8, (level.size, 500))).astype(np.float32)
    belief, rule = np.zeros(1, BELIEF), to_record(RATES)[0]
    shares = [follow_likelihood(belief[0], row, 1, rule) for row in weights]
    expected = shares_of(weights.astype(np.float64).mean(axis=1), RATES)
    np.testing.assert_allclose(shares, expected, rtol=0, atol=1e-5)
    assert max(shares[:10]) == 0.0 and shares[40] > 0.2 and shares[-1] > 0.99


def test_readings_of_several_vehicles_count_as_their_geometric_mean() -> None:
    belief = np.zeros(1, BELIEF)
    follow_likelihood(belief[0], np.full(10, 0.04, np.float32), 2, to_record(RATES)[0])
    assert belief["w_fast"][0] == pytest.approx(0.4 * 0.2, rel=1e-6)


def test_random_particles_fill_the_square_of_the_start_and_are_taken_from_all_alike() -> None:
    particles = np.zeros((4, 40_000), np.float32)
    scatter_share(particles, NONE_CARRIED, 0.1, 1000.0, -500.0, STREAM, 0, 100.0)
    moved = np.flatnonzero(particles[0])
    assert moved.size == 4000 and set(np.diff(moved)) == {10}
    for row, low, width in ((0, 900.0, 200.0), (1, -600.0, 200.0), (2, -np.pi, 2.0 * np.pi)):
        assert stats.kstest(particles[row, moved], "uniform", (low, width)).pvalue > 1e-3
    assert not particles[3].any()


@pytest.mark.parametrize(
    ("rule", "wanted"),
    [
        (SecondResampling.NEVER, [False, False, False]),
        (SecondResampling.WITH_RANDOM, [False, True, False]),
        (SecondResampling.AS_PRINTED, [True, True, False]),
    ],
)
def test_second_resampling_ends_where_half_of_the_particles_are_random(rule: SecondResampling, wanted: list[bool]) -> None:
    record = to_record(Recovery(slow_rate=0.1, fast_rate=0.2, second_resampling=rule))[0]
    assert [bool(wants_second_resampling(share, record)) for share in (0.0, 0.3, 0.5)] == wanted


@pytest.mark.parametrize("second", list(SecondResampling))
def test_correction_is_algorithm_2(second: SecondResampling) -> None:
    """Against float64 on a grid of resting particles: lines 1-8 leave (1-p) of the posterior and p spread over the square.

    Lines 9-16 weigh that mixture by Eq. 8 once more. Shares of particles within 12 m of the tag, of 200,000, agree within 0.01;
    their expected values lie between 0.5 and 1.
    """
    recovery = Recovery(slow_rate=0.05, fast_rate=0.2, second_resampling=second)
    belief_of = Belief(
        particles=200_000,
        motion=MomentumRandomWalk(speed_sigma=1e-6, turn_sigma=1e-6, max_speed=1e-6),
        receiver=TimeOfFlightReceiver(range_sigma=5.0),
        weight_floor=1e-7,
        recovery=recovery,
    )
    filter_ = ParticleFilter(belief_of)
    filter_.begin(0.0, 0.0, seed=7)
    particles, belief = filter_.particles[0], filter_.rows.beliefs[0]
    particles[:2] = np.random.default_rng(1).uniform(-100.0, 100.0, (2, belief_of.particles))
    before = particles[:2].astype(np.float64)
    w_avg = equation_8(*before, belief_of).mean()
    belief["w_slow"], belief["w_fast"] = w_avg, 0.7 * w_avg  # then p = 1 - (0.8 * 0.7 + 0.2) / 1
    filter_.predict(2.0)
    filter_.correct(measurement(time=2.0, x=0.0, y=0.0, readings=[8.0, 60.0]))
    p = 1.0 - (0.8 * 0.7 + 0.2)
    weight, near = equation_8(*before, belief_of), np.hypot(before[0] - 60.0, before[1]) < 12.0
    share = (1 - p) * (weight * near).sum() / weight.sum() + p * near.mean()
    if second != SecondResampling.NEVER:
        mixture = (1 - p) * weight / weight.sum() + p / weight.size
        share = (mixture * weight * near).sum() / (mixture * weight).sum()
    found = np.hypot(particles[0] - 60.0, particles[1]) < 12.0
    assert 0.3 < share < 1.0
    assert found.mean() == pytest.approx(share, abs=0.01)


def equation_8(x: np.ndarray, y: np.ndarray, belief: Belief) -> np.ndarray:
    """Weights for 8 units and 60 m heard at the origin on the heading 0, in float64; units of Clark et al. 2013, Eq. 5."""
    degrees = 90.0 - np.degrees(np.abs(np.arctan2(y, x)))
    units = ((-1e-6 * degrees + 2e-5) * degrees + 0.0947) * degrees - 0.2757
    angle = stats.norm.pdf(units, 8.0, belief.receiver.bearing_sigma)
    return belief.weight_floor + angle * stats.norm.pdf(np.hypot(x, y), 60.0, belief.receiver.range_sigma)


def led_astray(worlds: int, **overrides: object) -> np.ndarray:
    """(60, W) errors over the two minutes after all particles were moved to some 130 m from the fish; the vehicle circles."""
    simulation = Simulation(with_overrides(TASK, overrides), worlds)
    simulation.reset(seed=77)
    circling = np.tile(np.array([0.3, 1.0], np.float32), (worlds, 1, 1))
    for _ in range(60):
        simulation.step(circling)
    rng = np.random.default_rng(0)
    angle, particles = rng.uniform(0.0, 2.0 * np.pi, worlds), simulation.worlds.particles[:, 0, 0]
    for axis, offset in enumerate((130.0 * np.cos(angle), 130.0 * np.sin(angle))):
        centre = simulation.fish_position[:, 0, axis] + offset
        particles[:, axis] = centre[:, None] + rng.uniform(-15.0, 15.0, particles[:, axis].shape)
        for name in ("mean", "estimate"):
            simulation.worlds.beliefs[f"{name}_{'xy'[axis]}"][:, 0, 0] = particles[:, axis].mean(axis=-1)
    away = particles[:, :2] - simulation.fish_position[:, 0, :, None]
    assert np.hypot(away[:, 0], away[:, 1]).min() > 100.0
    errors = []
    for _ in range(60):
        simulation.step(circling)
        errors.append(simulation.error[:, 0, 0].copy())
    return np.array(errors)


def test_belief_led_astray_is_back_within_two_minutes() -> None:
    """Below 15 m in at least 95 % of 200 trials; without recovery it would not come back at all."""
    assert (led_astray(200) < 15.0).any(axis=0).mean() >= 0.95
    lost = led_astray(200, **{"belief.recovery.fast_rate": 0.0})
    assert (lost < 15.0).any(axis=0).mean() < 0.05


def test_without_the_second_resampling_the_way_back_is_longer() -> None:
    """What lines 9-16 are for: over the two minutes the mean error is a tenth less with them, or more."""
    assert led_astray(200).mean() < 0.9 * led_astray(200, **{RECOVERY: "never"}).mean()


def test_recovery_is_off_unless_asked_for() -> None:
    recovering = {name for name, scenario in SCENARIOS.items() if scenario.belief.recovery.fast_rate > 0}
    assert recovering == {"TagTrack/TimeOfFlight-v0"}


@pytest.mark.parametrize(("name", "value"), [("fast_rate", 1.5), ("slow_rate", 0.9), ("slow_rate", -0.1)])
def test_bad_rates_are_named(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"Recovery.{name} must be within 0 to"):
        Recovery(**{"slow_rate": 0.1, "fast_rate": 0.5, name: value})
