"""Clark et al. 2013, J. Field Robotics 30(3): the numbers that the paper prints, and that our defaults are those numbers."""

import dataclasses
import math

import numpy as np
import pytest

from tagtrack.envs.belief.assumptions import FILTERS, Belief
from tagtrack.envs.motions import BrownianWalk, LevyFlight, MomentumRandomWalk
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sensors import StereoHydrophone, Weighting
from tagtrack.envs.sensors.bearing import LARGEST_UNIT, bearing_in_units
from tagtrack.envs.sensors.stereo import expect_strength, expected_strength, weigh_bearing, weigh_combined, weigh_strength
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.sim.vehicle import Vehicle
from tagtrack.envs.tag import Tag

f32 = np.float32


def test_table_one():
    motion, receiver = Belief().motion, Belief().receiver
    assert isinstance(motion, MomentumRandomWalk)
    assert motion.speed_sigma == 0.3  # sigma_v [m/s]
    assert motion.turn_sigma == math.pi / 2  # sigma_theta [rad]
    assert receiver.bearing_sigma == 1.0  # sigma_alpha [Lotek angle units]
    assert receiver.strength_sigma == 15.0  # sigma_ss [Lotek strength units]


def test_the_true_receiver_has_the_noise_that_the_belief_assumes():
    assert Scenario().receiver == Scenario().belief.receiver == StereoHydrophone()


def test_equation_5_has_the_printed_coefficients():
    """-1e-6, 2e-5, 0.0947, -0.2757: a cubic through four exact values has no other."""
    degrees = np.array([-90.0, -30.0, 30.0, 90.0])
    units = [bearing_in_units(math.radians(90.0 - value)) for value in degrees]
    np.testing.assert_allclose(np.polyfit(degrees, units, 3), [-1e-6, 2e-5, 0.0947, -0.2757], rtol=1e-9)


def test_equation_8_has_the_printed_constants():
    receiver = StereoHydrophone()
    constants = receiver.strength_slope, receiver.strength_scale
    strengths = [expected_strength(distance, *constants) for distance in (1.0, 10.0)]
    assert math.log10(strengths[0]) == pytest.approx(2.18)  # b
    assert math.log10(strengths[1]) - math.log10(strengths[0]) == pytest.approx(-0.871)  # a


def test_readings_are_units_from_minus_nine_to_nine():
    assert LARGEST_UNIT == 9


def test_range_of_the_receiver_is_100_metres():
    assert Water().reach == 100.0
    assert Belief().half_width == 100.0  # particles start in a square of 2L by 2L (4.1)


def test_control_loop_runs_at_one_hertz_and_the_tag_pings_every_two_seconds():
    assert Vehicle().control_interval == 1.0  # 4.2
    assert Scenario().tag == Tag(period=2.0)  # 5.2; the other tag of the paper has 5 s
    assert dataclasses.replace(Scenario(), tag=Tag(period=5.0)).tag.period == 5.0


def test_fish_starts_within_the_distances_of_the_papers_trials():
    assert 20.0 <= Scenario().start.nearest <= Scenario().start.farthest <= 100.0  # 5.1: 20, 50, 75 and 100 m


TABLE_THREE = {
    "standard": (MomentumRandomWalk, Weighting.BEARING),
    "acoustic_ss": (MomentumRandomWalk, Weighting.COMBINED),
    "brownian": (BrownianWalk, Weighting.BEARING),
    "levy": (LevyFlight, Weighting.BEARING),
    "combined_brownian": (BrownianWalk, Weighting.COMBINED),
    "combined_levy": (LevyFlight, Weighting.COMBINED),
}


def test_the_six_filters_of_table_three_differ_in_motion_and_readings_alone():
    assert list(FILTERS) == list(TABLE_THREE)
    for name, (motion, weighting) in TABLE_THREE.items():
        assert type(FILTERS[name].motion) is motion
        assert FILTERS[name] == Belief(motion=motion(), receiver=StereoHydrophone(weighting=weighting))


def test_default_gamma_is_the_one_of_table_threes_best_levy_filter():
    """Mean errors with bearings alone: 32 m at 1e-2, 23 m at 1e-1, 39 m at 1e0."""
    assert LevyFlight().gamma == 0.1


def test_the_leopard_shark_is_tracked_by_the_filter_of_the_real_time_experiments_with_its_diffusion_tuned():
    """Section 7: estimation improves with the diffusion parameters of the prediction step; all else is the standard filter's."""
    belief = SCENARIOS["TagTrack/LeopardShark-v0"].belief
    assert isinstance(belief.motion, MomentumRandomWalk)
    assert dataclasses.replace(belief, motion=MomentumRandomWalk()) == FILTERS["standard"]


# The weights, by hand. A vehicle at the origin heads east; a particle 40 m ahead is expected at 7.6803 units (Eq. 5 at 90
# degrees) and at 10^2.18 * 40^-0.871 = 6.0900 strength units (Eq. 8).

AHEAD_UNITS = -0.729 + 0.162 + 8.523 - 0.2757
STRENGTH_AT_40 = 151.35612484362082 * math.exp(-0.871 * math.log(40.0))
SLOPE, LOG_SCALE, SIGMA, STRENGTH_SIGMA, FLOOR = f32(-0.871), f32(2.18 * math.log(10)), f32(1.0), f32(15.0), f32(0.001)


def weights_of(particles, units=None, strength=None):
    """Weights of particles (N, 2) by h_alpha, h_ss or, with both readings, h_mod."""
    x, y = np.array(particles, f32).T.copy()
    weight, own, ahead = np.ones(x.size, f32), (f32(0.0), f32(0.0)), (f32(1.0), f32(0.0))
    if strength is None:
        weigh_bearing(weight, x, y, *own, *ahead, f32(units), SIGMA, FLOOR)
    elif units is None:
        weigh_strength(weight, x, y, *own, f32(strength), SLOPE, LOG_SCALE, STRENGTH_SIGMA, FLOOR)
    else:
        expected = np.zeros(x.size, f32)
        expect_strength(expected, x, y, *own, SLOPE, LOG_SCALE)
        weigh_combined(weight, expected, x, y, *own, *ahead, f32(units), SIGMA, f32(strength), STRENGTH_SIGMA, FLOOR)
    return weight


@pytest.mark.parametrize("off", [-2.0, -1.0, 0.0, 1.0, 2.0])
def test_equation_6(off):
    """0.001 and a normal density of one unit."""
    density = math.exp(-0.5 * off**2) / math.sqrt(2 * math.pi)
    assert weights_of([[40, 0]], units=AHEAD_UNITS + off)[0] == pytest.approx(0.001 + density, rel=1e-3)


@pytest.mark.parametrize("off", [-30.0, -15.0, 0.0, 15.0, 30.0])
def test_equation_9(off):
    """0.001 and a normal density of 15 strength units."""
    density = math.exp(-0.5 * (off / 15) ** 2) / (15 * math.sqrt(2 * math.pi))
    assert weights_of([[40, 0]], strength=STRENGTH_AT_40 + off)[0] == pytest.approx(0.001 + density, rel=1e-4)


@pytest.mark.parametrize(("units_off", "strength_off"), [(0.0, 0.0), (1.0, 15.0), (-1.0, 30.0)])
def test_equation_10_with_the_sigmas_where_the_paper_prints_expected_values(units_off, strength_off):
    """A density divides by its width; divided by the expected bearing it would have a pole abeam of the vehicle."""
    density = math.exp(-0.5 * (units_off**2 + (strength_off / 15) ** 2)) / (2 * math.pi * 15)
    weight = weights_of([[40, 0]], units=AHEAD_UNITS + units_off, strength=STRENGTH_AT_40 + strength_off)[0]
    assert weight == pytest.approx(0.001 + density, rel=1e-3)


@pytest.mark.parametrize("readings", [{"units": -9}, {"strength": 500}, {"units": -9, "strength": 500}])
def test_no_weight_is_below_0_001(readings):
    """A particle ahead when the reading says astern, or that the signal is of a tag at the hydrophones."""
    assert weights_of([[40, 0]], **readings)[0] == pytest.approx(0.001, rel=1e-5)
    assert Belief().weight_floor == 0.001


def test_weight_of_a_particle_is_that_of_its_mirror_image_on_the_other_side():
    """The sign of the relative bearing is unknown (4.1): port and starboard weigh the same, bit for bit."""
    x, y = np.linspace(-80, 80, 41), np.linspace(5, 90, 41)
    port = np.stack([x, y], axis=1)
    starboard = port * [1, -1]
    for readings in ({"units": 3}, {"strength": 8}, {"units": 3, "strength": 8}):
        np.testing.assert_array_equal(weights_of(port, **readings), weights_of(starboard, **readings))


def test_bearing_alone_says_nothing_of_the_distance():
    along_a_ray = np.arange(5.0, 100.0, 5.0)[:, None] * [math.cos(1.0), math.sin(1.0)]
    weights = weights_of(along_a_ray, units=3)
    np.testing.assert_allclose(weights, weights[0], rtol=1e-4)


def test_strength_alone_says_nothing_of_the_bearing():
    angles = np.linspace(0, 2 * math.pi, 36)
    weights = weights_of(30.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1), strength=8)
    np.testing.assert_allclose(weights, weights[0], rtol=1e-4)
