"""Tag, water and receiver: Eqs. 5 and 8 by hand, when a ping is heard, and how often (Clark et al. 2013, 4.1.2, 6.2).

Bounds are four standard errors of the sample (two-sided chance 6e-5) unless a test says otherwise; seeds are fixed.
"""

import dataclasses
import math

import numba
import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.kernels.geometry import relative_bearing, wrap_angle
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import MEASUREMENT, NAVIGATION, Status
from tagtrack.envs.motions import BrownianWalk
from tagtrack.envs.scenario import Scenario, Start
from tagtrack.envs.sensors import StereoHydrophone
from tagtrack.envs.sensors.bearing import bearing_in_units, bearing_units
from tagtrack.envs.sensors.sensor import ENCOUNTER
from tagtrack.envs.sensors.stereo import STRENGTH, UNITS, expected_strength
from tagtrack.envs.sim.acoustics import Water, hearing_chance, listen
from tagtrack.envs.sim.tags import TARGET
from tagtrack.envs.sim.vehicle import VEHICLE
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.tag import Tag
from tagtrack.envs.world_rule import world_rule

CLEAR = Water(noisy_share=0.0, clear_hearing=0.95)
ERRORS = 4.0
SLOPE, SCALE = StereoHydrophone().strength_slope, StereoHydrophone().strength_scale
ALWAYS = Water(noisy_share=0.0, clear_hearing=1.0, reach=1e6)  # every ping is heard


@numba.njit
def listen_often(encounter, vehicle, navigation, target, fish_x, fish_y, measurement, parameters, seed, heard, readings):
    """One ping in each of as many steps as ``heard`` is long."""
    for i in range(heard.shape[0]):
        stream = (np.uint64(seed), np.uint64(0), np.uint64(0), np.uint64(i))
        listen(
            encounter, vehicle, navigation, target, fish_x, fish_y, False, measurement, 0, 0, stream, parameters[0], i + 1.0
        )  # fmt: skip
        heard[i] = measurement.status == Status.HEARD
        readings[:, i] = measurement.readings[:2]


def readings(bearing=0.0, distance=40.0, count=40_000, water=ALWAYS, receiver=None, seed=0, heading=0.7):
    """Whether heard, units and strength of many pings from a fish at a relative bearing [rad] and distance [m]."""
    vehicle = np.zeros(1, VEHICLE)
    vehicle["x"], vehicle["y"], vehicle["heading"] = 300.0, -200.0, heading
    fish_x = 300.0 + distance * math.cos(heading + bearing)
    fish_y = -200.0 + distance * math.sin(heading + bearing)
    scenario = Scenario(time_step=1.0, water=water, receiver=receiver or StereoHydrophone())
    rows = (np.zeros(1, dtype)[0] for dtype in (ENCOUNTER, NAVIGATION, TARGET, MEASUREMENT))
    encounter, navigation, target, measurement = rows
    heard, read = np.zeros(count, bool), np.zeros((2, count))
    target["pinged"] = True
    parameters = to_record(world_rule(scenario))
    listen_often(
        encounter, vehicle[0], navigation, target, fish_x, fish_y, measurement, parameters, seed, heard, read
    )
    return heard, read[UNITS], read[STRENGTH]


def anchored(water=CLEAR, period=2.0, distance=20.0, time_step=1.0):
    """A vehicle at rest and a fish that stays where it is."""
    return dataclasses.replace(
        Scenario(),
        time_step=time_step,
        speed_control=True,
        fish=BrownianWalk(max_speed=1e-6),
        start=Start(nearest=distance, farthest=distance),
        water=water,
        tag=Tag(period=period),
        belief=Belief(particles=1),
    )


def hear(scenario, worlds, steps, seed=0):
    """Whether each world's tag pinged, was heard, and whether its water was noisy, each (steps, worlds)."""
    simulation = Simulation(scenario, worlds)
    simulation.reset(seed=seed)
    rest = np.tile(np.array([1.0, 0.0, -1.0], np.float32), (worlds, 1, 1))
    seen = []
    for _ in range(steps):
        simulation.step(rest)
        encounters = simulation.worlds.encounters[:, 0, 0]
        seen.append(np.array([encounters["pinged"], simulation.detected[:, 0, 0], encounters["noisy"]]))
    return np.array(seen).transpose(1, 0, 2)


# What the receiver reads.


@pytest.mark.parametrize(
    ("off_bow", "units"),
    [
        (0, 7.6803),  # +90 degrees from the perpendicular: -0.729 + 0.162 + 8.523 - 0.2757
        (45, 3.935175),  # +45: -0.091125 + 0.0405 + 4.2615 - 0.2757
        (90, -0.2757),  # 0: the constant alone
        (135, -4.405575),  # -45: 0.091125 + 0.0405 - 4.2615 - 0.2757
        (180, -7.9077),  # -90: 0.729 + 0.162 - 8.523 - 0.2757
    ],
)
def test_bearing_units_by_hand_the_same_to_port_and_to_starboard(off_bow, units):
    """Eq. 5 at angles off the bow [degrees]."""
    assert bearing_in_units(math.radians(off_bow)) == pytest.approx(units, abs=1e-12)
    assert bearing_in_units(-math.radians(off_bow)) == pytest.approx(units, abs=1e-12)


def test_fish_and_particle_have_the_same_expected_reading():
    """The truth's Eq. 5 takes the angle, the particles' loop its sine: 1e-5 units where one unit is the noise."""
    for bearing in np.linspace(-math.pi, math.pi, 721):
        units = bearing_units(np.float32(math.cos(bearing)))
        assert units == pytest.approx(bearing_in_units(bearing), abs=4e-5 if abs(math.cos(bearing)) > 0.999 else 1.2e-5)


@pytest.mark.parametrize(
    ("distance", "strength"),
    [
        (1.0, 151.35612484362082),  # 10^2.18
        (10.0, 20.370420777057507),  # 10^(2.18 - 0.871)
        (100.0, 2.7415741719278814),  # 10^(2.18 - 1.742)
    ],
)
def test_expected_strength_by_hand(distance, strength):
    """Eq. 8."""
    assert expected_strength(distance, SLOPE, SCALE) == pytest.approx(strength, rel=1e-12)


def test_strength_at_the_hydrophone_itself_is_finite():
    assert math.isfinite(expected_strength(0.0, SLOPE, SCALE))


@pytest.mark.parametrize("off_bow", [0, 45, 90, 135, 180])
def test_readings_are_whole_units_about_the_expected_one(off_bow):
    """Noise of one unit, then rounding, which adds 1/12 to the variance; the ends at +-9 cut less than 2 % of the readings."""
    _, units, _ = readings(bearing=math.radians(off_bow))
    np.testing.assert_array_equal(units, np.round(units))
    assert np.abs(units).max() <= 9
    expected = bearing_in_units(math.radians(off_bow))
    levels = np.arange(-9, 10)
    edges = np.concatenate([[-np.inf], levels[:-1] + 0.5, [np.inf]])
    chance = np.diff(stats.norm.cdf(edges - expected))
    count = np.array([np.sum(units == level) for level in levels])
    assert count.sum() == units.size
    likely = chance * units.size > 5  # chi-square needs some readings in each class
    observed, predicted = np.append(count[likely], count[~likely].sum()), np.append(chance[likely], chance[~likely].sum())
    assert stats.chisquare(observed, predicted * units.size).pvalue > 1e-4


def test_noisiest_readings_stay_within_nine_units():
    _, units, _ = readings(receiver=StereoHydrophone(bearing_sigma=20.0))
    assert set(units) == set(range(-9, 10))


@pytest.mark.parametrize("off_bow", [10, 60, 90, 150])
def test_port_and_starboard_give_the_same_readings(off_bow):
    """The sign of the side is unknown: with the same noise each single reading is the same, with other noise the distribution."""
    port = readings(bearing=math.radians(off_bow))[1]
    np.testing.assert_array_equal(readings(bearing=-math.radians(off_bow))[1], port)
    starboard = readings(bearing=-math.radians(off_bow), seed=1)[1]
    assert stats.ks_2samp(port, starboard).pvalue > 1e-4


def test_readings_depend_on_the_bearing_relative_to_the_heading():
    one = readings(bearing=0.9, heading=0.0)[1]
    np.testing.assert_array_equal(readings(bearing=0.9, heading=3.0)[1], one)


@pytest.mark.parametrize("distance", [10.0, 50.0, 100.0])
def test_strength_is_normal_about_its_expected_value(distance):
    _, _, strength = readings(distance=distance)
    expected = 10**2.18 * distance**-0.871
    assert stats.kstest((strength - expected) / 15.0, "norm").pvalue > 1e-4


def test_noises_of_bearing_and_strength_are_independent():
    _, units, strength = readings(bearing=1.0)
    assert abs(np.corrcoef(units, strength)[0, 1]) < ERRORS / math.sqrt(units.size)


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 7])
def test_bearing_is_positive_to_port_and_wraps(turns):
    heading = 0.5 + 2 * math.pi * turns
    assert relative_bearing(1.0, 1.0, heading, 1 + math.cos(0.8), 1 + math.sin(0.8)) == pytest.approx(0.3)
    assert relative_bearing(1.0, 1.0, heading, 1 + math.cos(0.2), 1 + math.sin(0.2)) == pytest.approx(-0.3)


def test_wrapped_angles_lie_within_half_a_turn():
    angles = np.linspace(-50.0, 50.0, 2001)
    wrapped = np.array([wrap_angle(angle) for angle in angles])
    assert -math.pi <= wrapped.min() <= wrapped.max() < math.pi
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angles), atol=1e-12)


def test_bearing_of_a_fish_on_the_vehicle_is_ahead():
    assert relative_bearing(3.0, 4.0, 2.0, 3.0, 4.0) == 0.0


# When a tag pings.


@pytest.mark.parametrize(("period", "time_step"), [(2.0, 1.0), (5.0, 1.0), (2.0, 0.5), (5.0, 0.25)])
def test_tag_pings_every_period_from_a_random_first_ping_on(period, time_step):
    worlds, between = 1000, round(period / time_step)
    pinged, _, _ = hear(anchored(period=period, time_step=time_step), worlds, 6 * between)
    first = pinged.argmax(axis=0)
    for world in range(worlds):
        np.testing.assert_array_equal(np.flatnonzero(pinged[:, world]), first[world] + between * np.arange(6))
    # The step of the first ping is uniform over a period: chi-square.
    assert stats.chisquare(np.bincount(first, minlength=between)).pvalue > 1e-4


def test_first_ping_is_uniform_within_the_period():
    simulation = Simulation(anchored(period=5.0), 4000)
    simulation.reset(seed=0)
    assert stats.kstest(simulation.worlds.targets["first_ping"].ravel() / 5.0, "uniform").pvalue > 1e-4


def test_period_that_is_no_multiple_of_the_step_is_kept_in_the_mean():
    pinged, _, _ = hear(anchored(period=2.7), 200, 270)
    assert set(np.diff(np.flatnonzero(pinged[:, 0]))) == {2, 3}
    assert set(pinged.sum(axis=0)) == {100}


def test_nothing_is_heard_between_pings():
    pinged, detected, _ = hear(anchored(), 200, 60)
    assert not np.any(detected & ~pinged)


# Whether it is heard.


@pytest.mark.parametrize("noisy", [False, True])
def test_hearing_of_one_hydrophone_falls_to_half_at_the_reach(noisy):
    water = to_record(Water())[0]
    near = Water().noisy_hearing if noisy else Water().clear_hearing
    assert hearing_chance(0.0, noisy, water) == pytest.approx(near, rel=1e-5)  # 1/(1 + e^-12.5)
    assert hearing_chance(100.0, noisy, water) == pytest.approx(near / 2)
    assert hearing_chance(108.0, noisy, water) == pytest.approx(near / (1 + math.e))  # one edge width beyond
    assert hearing_chance(1e6, noisy, water) < 1e-20
    chances = [hearing_chance(distance, noisy, water) for distance in np.linspace(0.0, 300.0, 301)]
    assert np.all(np.diff(chances) < 0)


@pytest.mark.parametrize(
    ("distance", "both"),
    [
        (20.0, 0.95**2 / (1 + math.exp(-10)) ** 2),
        (92.0, 0.95**2 / (1 + math.exp(-1)) ** 2),
        (100.0, 0.475**2),
        (108.0, 0.95**2 / (1 + math.e) ** 2),
    ],
)
def test_both_hydrophones_must_hear_a_ping(distance, both):
    """In clear water the share of usable signals is the square of one hydrophone's chance."""
    heard, _, _ = readings(distance=distance, water=CLEAR)
    assert heard.mean() == pytest.approx(both, abs=ERRORS * math.sqrt(both * (1 - both) / heard.size))


def test_far_beyond_the_reach_nothing_is_heard_and_the_last_reading_stays_missing():
    heard, units, strength = readings(distance=1000.0, water=CLEAR)
    assert not heard.any()
    simulation = Simulation(anchored(distance=1000.0), 4)
    simulation.reset(seed=0)
    for _ in range(10):
        simulation.step(np.zeros((4, 1, 3)))
    assert np.isnan(simulation.worlds.measurements["readings"]).all()
    assert np.isnan(simulation.listeners["readings"]).all()


@pytest.mark.parametrize(("share", "always"), [(0.0, False), (1.0, True)])
def test_water_without_bursts_is_clear_and_water_of_bursts_alone_is_noisy(share, always):
    _, detected, noisy = hear(anchored(Water(noisy_share=share, clear_hearing=0.95)), 200, 300)
    assert np.all(noisy == always)
    chance = (0.15 if always else 0.95) ** 2
    pings = 200 * 150
    assert detected.sum() / pings == pytest.approx(chance, abs=ERRORS * math.sqrt(chance * (1 - chance) / pings) + 2e-4)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8, 0.99])
def test_bursts_last_their_mean_duration_and_take_their_share_of_time(share):
    worlds, steps = 2000, 200
    _, _, noisy = hear(anchored(Water(noisy_share=share, noisy_duration=20.0)), worlds, steps)
    # A stationary two-state chain decorrelates within 20 s * (1 - share): that many independent samples a world.
    independent = worlds * steps / (1 + 2 * 20.0 * (1 - share))
    for row in (0, -1):  # from the first step on, for the start is drawn from the long run
        error = ERRORS * math.sqrt(share * (1 - share) / worlds)
        assert noisy[row].mean() == pytest.approx(share, abs=error)
    assert noisy.mean() == pytest.approx(share, abs=ERRORS * math.sqrt(share * (1 - share) / independent))
    if share <= 20 / 21:  # beyond, the clear spells between bursts of 20 s would be shorter than a step
        ends = np.sum(noisy[:-1] & ~noisy[1:])
        assert noisy[:-1].sum() / ends == pytest.approx(20.0, rel=ERRORS / math.sqrt(ends))


def test_vehicles_and_tags_have_water_of_their_own():
    """Two vehicles and two tags: four channels that are no more alike than chance makes them."""
    scenario = dataclasses.replace(anchored(Water()), vehicles=2, targets=2)
    simulation = Simulation(scenario, 4000)
    simulation.reset(seed=0)
    channels = simulation.worlds.encounters["noisy"].reshape(4000, 4).astype(float)
    correlation = np.corrcoef(channels.T)
    assert np.abs(correlation - np.eye(4)).max() < ERRORS / math.sqrt(4000)


def test_usable_signals_range_over_some_3_to_25_a_minute_and_gaps_reach_30_seconds():
    """Near the fish, a 2 s tag, default water: what is low and what is usual in clear water are the paper's lowest and highest.

    The paper's rates are those of a few hours, its lowest so the lowest of 60 minutes and more; 3,000 minutes here give each
    percentile to one signal.
    """
    _, detected, _ = hear(anchored(Water()), worlds=300, steps=600)
    rates = detected.reshape(10, 60, 300).sum(axis=1)
    low, high = np.percentile(rates, [100 / 60, 75])
    assert 2 <= low <= 4
    assert 24 <= high <= 26
    heard = [np.flatnonzero(detected[:, world]) for world in range(300)]
    longest = [np.diff(np.concatenate([[0], steps, [600]])).max() for steps in heard]
    assert np.mean(np.array(longest) >= 30) > 0.5


def test_worse_water_gives_fewer_signals():
    rates = [hear(anchored(Water(noisy_share=share)), 100, 300)[1].mean() for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert np.all(np.diff(rates) < 0)


def test_silence_counts_the_time_since_the_last_signal():
    simulation = Simulation(anchored(Water()), 100)
    simulation.reset(seed=3)
    silence = np.zeros(100)
    for _ in range(120):
        simulation.step(np.zeros((100, 1, 3)))
        silence = np.where(simulation.detected[:, 0, 0], 0.0, silence + 1.0)
        np.testing.assert_array_equal(simulation.listeners["silence"][:, 0, 0], silence)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Tag(period=-2.0), "Tag.period must be positive, got -2.0"),
        (lambda: Tag(period=float("nan")), "Tag.period must be finite, got nan"),
        (lambda: Water(noisy_share=1.5), "Water.noisy_share must be within 0 to 1, got 1.5"),
        (lambda: Water(reach=0), "Water.reach must be positive, got 0.0"),
        (lambda: StereoHydrophone(bearing_sigma=0), "StereoHydrophone.bearing_sigma must be positive, got 0.0"),
        (lambda: StereoHydrophone(strength_sigma="wide"), "StereoHydrophone.strength_sigma must be a number, got 'wide'"),
    ],
)
def test_impossible_parameters_are_refused_by_name_and_value(make, says):
    with pytest.raises(ValueError) as caught:
        make()
    assert str(caught.value) == says
