"""The compiled filter against three that know nothing of it: a readable numpy filter, a Kalman filter, Bayes' rule on a grid.

The compiled filter is a ``ParticleFilter``, fed with poses and readings of the test's making. Where Monte
Carlo meets an exact answer, the standard error is measured over replications with other seeds, and four of it are allowed.
"""

import dataclasses
import math
from typing import ClassVar

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from tagtrack.envs.belief.assumptions import FILTERS, Belief, Estimate
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.kernels.calling import Native, native
from tagtrack.envs.measurement import measurement
from tagtrack.envs.motions import BrownianWalk, MomentumRandomWalk
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sensors import Sensor, StereoHydrophone, Weighting
from tagtrack.envs.sensors.sensor import WEIGH
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.simulation import Simulation
from tagtrack.eval.speed import reference_filter
from tests.readable_motions import BrownianRandomWalk, CutLevyFlight

ERRORS = 4.0


class CompiledFilter:
    """One belief of the core, with the calls of ``ReferenceFilter``."""

    def __init__(self, belief, seed=0, time_step=1.0):
        self.core = ParticleFilter(belief)
        self.time_step, self.seed = time_step, seed
        self.initialize(0.0, 0.0)

    @property
    def particles(self):
        return self.core.particles[0]

    @property
    def weight(self):
        """As they were at the last correction."""
        return self.core.scratch.weight

    def initialize(self, x, y):
        self.core.begin(x, y, seed=self.seed)

    def predict(self):
        self.core.predict(self.time_step)

    def correct(self, x, y, heading, bearing_units=math.nan, strength=math.nan):
        readings = [bearing_units, strength]
        self.core.correct(measurement(time=self.core.time, x=x, y=y, heading=heading, readings=readings))

    def summary(self):
        """Mean x, y, and covariance xx, yy, xy, as the core condenses its particles."""
        return np.array([float(self.core.summary[name][0]) for name in ("mean_x", "mean_y", "xx", "yy", "xy")])


def weigh(sensor, particles, x, y, heading, readings, floor=0.001, weight=None):
    """Weights of a row of particles by a sensor, times those that it is given."""
    weight = np.ones(particles.shape[1], np.float32) if weight is None else weight
    told = measurement(time=0.0, x=x, y=y, heading=heading, readings=readings)
    sensor.weigh(weight, particles, told[0], np.float32(floor), np.zeros_like(weight), np.array(sensor.padded_row()))
    return weight


def deviation(samples, exact=0.0, others=None):
    """How many standard errors the mean of replications (R, ...) lies from an exact value or from that of others (S, ...)."""
    variance = samples.var(axis=0, ddof=1) / len(samples)
    if others is not None:
        exact = others.mean(axis=0)
        variance = variance + others.var(axis=0, ddof=1) / len(others)
    return np.abs(samples.mean(axis=0) - exact) / np.sqrt(variance)


# (a) The readable filter in float64.


def readable(belief, seed, time_step):
    """The readable filter with the parameters of a belief."""
    motion = belief.motion
    if isinstance(motion, MomentumRandomWalk):
        moves = reference_filter.MomentumRandomWalk(
            sigma_speed=motion.speed_sigma, sigma_heading=motion.turn_sigma, max_speed=motion.max_speed
        )
    elif isinstance(motion, BrownianWalk):
        moves = BrownianRandomWalk(max_speed=motion.max_speed)
    else:
        moves = CutLevyFlight(gamma=motion.gamma, max_speed=motion.max_speed)
    parameters = reference_filter.ReferenceFilterParameters(
        particles=belief.particles, time_step=time_step, motion=moves, receiver_range=belief.half_width
    )
    return reference_filter.ReferenceFilter(parameters, np.random.default_rng(seed))


@pytest.mark.parametrize("weighting", list(Weighting))
def test_weights_are_those_of_the_readable_receiver(weighting):
    """Particle by particle, Eqs. 6, 9 and 10, within 3e-4 of the largest weight and most within a tenth of that.

    Dead ahead and astern the arcsine is steep: there a sine in float32 leaves 0.02 degrees, 0.002 units of 1.
    """
    sensor = StereoHydrophone(weighting=weighting)
    filter_ = CompiledFilter(Belief(particles=20_000))
    filter_.initialize(10.0, -20.0)
    particles = filter_.particles
    x, y = particles[:2].astype(np.float64)
    dx, dy = x - 10.0, y + 20.0
    ahead = dx * math.cos(2.0) + dy * math.sin(2.0)
    abeam = dy * math.cos(2.0) - dx * math.sin(2.0)
    receiver = reference_filter.StereoReceiver()
    units, strength = receiver.expected_bearing(ahead, abeam), receiver.expected_strength(np.hypot(dx, dy))
    far = np.hypot(dx, dy) > reference_filter.NEAREST  # nearer the readable one holds the strength constant
    for reading in [(-8.0, 3.0), (0.0, 60.0), (5.0, -10.0)]:
        if weighting == Weighting.BEARING:
            expected = receiver.bearing_weight(reading[0], units)
        elif weighting == Weighting.STRENGTH:
            expected = receiver.strength_weight(reading[1], strength)
        else:
            expected = receiver.combined_weight(reading, (units, strength))
        weight = weigh(sensor, particles, 10.0, -20.0, 2.0, reading)
        error = np.abs(weight[far] - expected[far]) / expected.max()
        assert error.max() < 3e-4
        assert np.quantile(error, 0.95) < 3e-5
        twice = weigh(sensor, particles, 10.0, -20.0, 2.0, reading, weight=weight)  # a second vehicle in the same place
        np.testing.assert_allclose(twice[far], expected[far] ** 2, rtol=0, atol=1e-3 * expected.max() ** 2)


def voyage():
    """Two minutes of poses (x, y, heading) about a fish near (45, 25), with a ping every four seconds of the first thirty.

    The course turns twice, so that the mirror image to starboard has to die out. The long silence lets the motion show: without
    it the spread of the bearings hides how the particles swim.
    """
    generator = np.random.default_rng(12)
    x, y, poses, pings = 0.0, 0.0, [], []
    for second in range(120):
        heading = 0.2 if second < 12 else 1.3 if second < 26 else -0.4
        x, y = x + math.cos(heading), y + math.sin(heading)
        poses.append((x, y, heading))
        ping = None
        if second % 4 == 3 and second < 30:
            ahead = math.atan2(25 - y, 45 - x) - heading
            degrees = math.degrees(math.asin(math.cos(ahead)))
            units = -1e-6 * degrees**3 + 2e-5 * degrees**2 + 0.0947 * degrees - 0.2757
            strength = 10**2.18 * math.hypot(45 - x, 25 - y) ** -0.871
            ping = round(units + 0.5 * generator.standard_normal()), strength + 5 * generator.standard_normal()
        pings.append(ping)
    return poses, pings


CHECKED = (3, 19, 27, 119)  # seconds: after the first ping, in the middle, after the last ping, at the end of the silence


def sail(filter_, belief, poses, pings):
    """Mean and covariance (len(CHECKED), 5) on the voyage."""
    uses_strength = belief.receiver.weighting == Weighting.COMBINED
    filter_.initialize(0.0, 0.0)
    seen = []
    for second, (pose, ping) in enumerate(zip(poses, pings, strict=True)):
        filter_.predict()
        if ping is not None:
            filter_.correct(*pose, *(ping if uses_strength else ping[:1]))
        if second in CHECKED:
            seen.append(summary_of(filter_))
    return np.array(seen)


def summary_of(filter_):
    if isinstance(filter_, CompiledFilter):
        return filter_.summary()
    covariance = filter_.covariance()
    return np.array([*filter_.mean(), covariance[0, 0], covariance[1, 1], covariance[0, 1]])


@pytest.mark.parametrize("name", FILTERS)
def test_posterior_is_that_of_the_readable_filter(name):
    """All six filters of Table III on one sequence of readings: 300 compiled rows against 80 readable ones, N = 500.

    With so few particles both have a bias, the same for both. The standard error of the difference is 0.3 to 0.5 m in each mean,
    where the posterior's deviation is 11 to 53 m, and 1 to 3 % of each variance; 20 numbers are compared.
    """
    belief = dataclasses.replace(FILTERS[name], particles=500)
    course = voyage()
    compiled = np.array([sail(CompiledFilter(belief, seed), belief, *course) for seed in range(300)])
    slow = np.array([sail(readable(belief, seed, 1.0), belief, *course) for seed in range(80)])
    assert deviation(compiled, others=slow).max() < ERRORS


# (b) The Kalman filter, where all is linear and Gaussian.
#
# A fish that never turns and whose speed is a Gaussian random walk is linear: (x, speed) <- F (x, speed) + noise. A receiver
# whose strength is 10^0 times the distance to the power of one reads, from a place on the same line, x itself. So the momentum
# walk (Alg. 2, turn_sigma 0) and h_ss (Eq. 9, floor 0) are, with these parameters and not a line of code of their own, a
# Kalman filter's model.

SPEED_SIGMA, RANGE_SIGMA, TIME_STEP = 0.1, 2.0, 0.5
STRAIGHT = Belief(
    particles=4000,
    motion=MomentumRandomWalk(speed_sigma=SPEED_SIGMA, turn_sigma=0.0, max_speed=10.0),  # mean speed 2: never cut at 0 or 10
    receiver=StereoHydrophone(
        strength_slope=1.0, strength_scale=0.0, strength_sigma=RANGE_SIGMA, weighting=Weighting.STRENGTH
    ),
    weight_floor=0.0,
)
PRIOR_MEAN, PRIOR_SPREAD = np.array([50.0, 2.0]), np.array([6.0, 0.3])


def ranges():
    """Forty steps of half a second, a range in every third (NaN: none): a fish at some 2 m/s, heard with a noise of 2 m."""
    generator = np.random.default_rng(5)
    x, speed, heard = 55.0, 1.8, []
    for step in range(40):
        speed += SPEED_SIGMA * math.sqrt(TIME_STEP) * generator.standard_normal()
        x += speed * TIME_STEP
        heard.append(x + RANGE_SIGMA * generator.standard_normal() if step % 3 == 0 else math.nan)
    return heard


def kalman_means():
    """Mean and variance of x and mean of the speed after each step (40, 3)."""
    kalman = KalmanFilter(dim_x=2, dim_z=1)
    kalman.x = PRIOR_MEAN.copy()  # one-dimensional, as z below: a column would be reshaped in silence
    kalman.P = np.diag(PRIOR_SPREAD**2)
    kalman.F = np.array([[1.0, TIME_STEP], [0.0, 1.0]])
    gain = np.array([TIME_STEP, 1.0])  # the new speed carries the fish in the same step (Alg. 2, lines 2 and 4)
    kalman.Q = np.outer(gain, gain) * SPEED_SIGMA**2 * TIME_STEP
    kalman.H = np.array([[1.0, 0.0]])
    kalman.R = np.array([[RANGE_SIGMA**2]])
    rows = []
    for heard in ranges():
        kalman.predict()
        if not math.isnan(heard):
            kalman.update(np.array([heard]))
        rows.append([kalman.x[0], kalman.P[0, 0], kalman.x[1]])
    return np.array(rows)


def test_posterior_is_that_of_a_kalman_filter_on_a_straight_course():
    """60 replications of 4,000 particles; 120 numbers are compared.

    The standard error is 0.008 m in the mean, 0.7 % of the variance and 0.002 m/s in the speed: a bias of the order of 1/N is
    far below it.
    """
    replications = []
    for seed in range(60):
        filter_ = CompiledFilter(STRAIGHT, seed, TIME_STEP)
        generator = np.random.default_rng(seed)
        drawn = PRIOR_MEAN[:, None] + PRIOR_SPREAD[:, None] * generator.standard_normal((2, STRAIGHT.particles))
        filter_.particles[:] = 0.0  # on one line, on one heading
        filter_.particles[0], filter_.particles[3] = drawn
        rows = []
        for heard in ranges():
            filter_.predict()
            if not math.isnan(heard):
                filter_.correct(0.0, 0.0, 0.0, strength=heard)
            mean_x, _, xx, _, _ = filter_.summary()
            rows.append([mean_x, xx, filter_.particles[3].mean(dtype=np.float64)])
        replications.append(rows)
    assert deviation(np.array(replications), exact=kalman_means()).max() < ERRORS


@native(WEIGH)
def weigh_place(weight, particles, measurement, floor, work, parameters):
    """A normal density about a measured place, but for its constant."""
    for i in range(weight.shape[0]):
        miss_x = particles[0, i] - measurement.readings[0]
        miss_y = particles[1, i] - measurement.readings[1]
        square = parameters[0] * miss_x**2 + parameters[1] * miss_y**2 + 2.0 * parameters[2] * miss_x * miss_y
        weight[i] *= floor + math.exp(-0.5 * square)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlaceSensor(Sensor):
    """Reads both coordinates of the fish; the parameters are the inverse of the noise's covariance."""

    precision_x: float
    precision_y: float
    coupling: float
    readings: ClassVar[tuple[str, ...]] = ("x", "y")
    weigh: ClassVar[Native | None] = weigh_place


def test_posterior_is_that_of_a_kalman_filter_in_the_plane():
    """Brownian motion in the plane, both coordinates measured every ten steps, with a sensor of the test's own.

    The sum of ten steps of Alg. 3 has variance 10 v_max^2 / 6 along each axis and is all but normal (excess kurtosis -0.03).
    The standard error is 0.01 m in the means and 0.5 % of the variances.
    """
    noise = np.array([[6.25, 2.0], [2.0, 4.0]])  # not diagonal: the axes are coupled
    precision = np.linalg.inv(noise)
    fixes = PlaceSensor(precision_x=precision[0, 0], precision_y=precision[1, 1], coupling=precision[0, 1])
    belief = Belief(particles=4000, motion=BrownianWalk(max_speed=1.5), receiver=fixes, weight_floor=0.0)
    generator = np.random.default_rng(3)
    measured = np.cumsum(generator.normal(0.0, 2.0, (8, 2)), axis=0) + generator.normal(0.0, 2.5, (8, 2))

    kalman = KalmanFilter(dim_x=2, dim_z=2)
    kalman.x, kalman.P = np.zeros(2), 25.0 * np.eye(2)
    kalman.F, kalman.H = np.eye(2), np.eye(2)
    kalman.Q, kalman.R = 10 * 1.5**2 / 6 * np.eye(2), noise
    exact = []
    for position in measured:
        kalman.predict()
        kalman.update(position)
        exact.append([*kalman.x, kalman.P[0, 0], kalman.P[1, 1], kalman.P[0, 1]])

    replications = []
    for seed in range(60):
        filter_ = CompiledFilter(belief, seed)
        filter_.particles[:2] = np.random.default_rng(seed).normal(0.0, 5.0, (2, belief.particles))
        rows = []
        for position in measured:
            for _ in range(10):
                filter_.predict()
            filter_.correct(0.0, 0.0, 0.0, *position)
            rows.append(filter_.summary())
        replications.append(rows)
    assert deviation(np.array(replications), exact=np.array(exact)).max() < ERRORS


# (c) Bayes' rule on a grid.

CELL = 0.1  # m
LINE_Y = 30.0
WIDTH = 100.0


def passing(seed):
    """A vehicle that passes a resting tag at 1 m/s on a parallel line 30 m away: (x, units) at each ping, every two seconds."""
    generator = np.random.default_rng(seed)
    heard = []
    for x in np.arange(-50.0, 51.0, 2.0):
        degrees = math.degrees(math.atan2(12.0 - x, LINE_Y))  # from the perpendicular, positive ahead; the tag rests at x = 12
        units = -1e-6 * degrees**3 + 2e-5 * degrees**2 + 0.0947 * degrees - 0.2757
        heard.append((x, float(round(units + generator.standard_normal()))))
    return heard


def grid_posteriors(heard, max_speed, floor):
    """Cells' chances (pings, K) on the line, from a uniform prior; moves by Alg. 3 (two steps to a ping), weighs by Eq. 6."""
    centres = np.arange(-WIDTH - 20 + CELL / 2, WIDTH + 20, CELL)
    chance = (np.abs(centres) < WIDTH).astype(float)
    chance /= chance.sum()
    # Step of Alg. 3 along the line: speed uniform, direction uniform, by quadrature into cells.
    speed, angle = np.meshgrid((np.arange(500) + 0.5) / 500 * max_speed, (np.arange(720) + 0.5) / 360 * math.pi)
    reach = math.ceil(max_speed / CELL)
    edges = (np.arange(2 * reach + 2) - reach - 0.5) * CELL
    kernel = np.histogram((speed * np.cos(angle)).ravel(), edges)[0].astype(float)
    kernel /= kernel.sum()
    rows = []
    for x, units in heard:
        for _ in range(2):
            chance = np.convolve(chance, kernel, mode="same")
        degrees = np.degrees(np.arctan2(centres - x, LINE_Y))
        expected = -1e-6 * degrees**3 + 2e-5 * degrees**2 + 0.0947 * degrees - 0.2757
        chance = chance * (floor + np.exp(-0.5 * (expected - units) ** 2) / math.sqrt(2 * math.pi))
        chance /= chance.sum()
        rows.append(chance)
    return centres, np.array(rows)


@pytest.mark.parametrize("seed", [0, 1])
def test_posterior_is_that_of_bayes_rule_on_a_line(seed):
    """Bearings alone, particles kept on the line, their walk along it broad enough to show: 0.5 m/s.

    Against the grid: mean within 4 standard errors (0.1 m at first, when the deviation is 32 m; 0.01 m at last) and a tenth of a
    cell; deviation within 2 %; total variation in bins of 4 m below 0.03, of which 0.02 is what 20,000 particles in 50 bins make.
    """
    belief = Belief(particles=20_000, motion=BrownianWalk(max_speed=0.5), half_width=WIDTH)
    heard = passing(seed)
    centres, exact = grid_posteriors(heard, 0.5, belief.weight_floor)
    bins = np.arange(-120.0, 121.0, 4.0)
    means, deviations, distances = [], [], []
    for replication in range(8):
        filter_ = CompiledFilter(belief, seed=100 * seed + replication)
        filter_.initialize(0.0, LINE_Y)
        filter_.particles[1] = LINE_Y
        rows = []
        for x, units in heard:
            for _ in range(2):
                filter_.predict()
                filter_.particles[1] = LINE_Y  # one dimension: the step across the line is taken back
            filter_.correct(x, 0.0, 0.0, bearing_units=units)
            rows.append(filter_.particles[0].astype(np.float64))
        rows = np.array(rows)
        means.append(rows.mean(axis=1))
        deviations.append(rows.std(axis=1))
        shares = np.array([np.histogram(row, bins)[0] for row in rows]) / belief.particles
        true_shares = np.array([np.histogram(centres, bins, weights=row)[0] for row in exact])
        distances.append(0.5 * np.abs(shares - true_shares).sum(axis=1))
    exact_mean = exact @ centres
    exact_deviation = np.sqrt(exact @ centres**2 - exact_mean**2)
    means = np.array(means)
    error = np.abs(means.mean(axis=0) - exact_mean)
    assert np.all(error < ERRORS * means.std(axis=0, ddof=1) / math.sqrt(len(means)) + CELL / 10)
    np.testing.assert_allclose(np.mean(deviations, axis=0), exact_deviation, rtol=0.02)
    assert np.mean(distances, axis=0).max() < 0.03


# What the filter reports.


def test_best_particle_is_the_one_that_weighed_most_at_the_last_ping():
    """A resting row: after the correction the estimate stands where the heaviest particle stood.

    So vague a reading that the best has one child or two: its neighbours in the row are other particles.
    """
    vague = StereoHydrophone(bearing_sigma=4.0)
    belief = Belief(particles=800, motion=BrownianWalk(max_speed=1e-6), estimate=Estimate.BEST, receiver=vague)
    filter_ = CompiledFilter(belief, seed=4)
    filter_.predict()
    before = filter_.particles.copy()
    filter_.correct(0.0, 0.0, 0.4, bearing_units=5.0)
    weight = filter_.weight
    place = filter_.core.estimate[0]
    own = np.flatnonzero((before[0] == place[0]) & (before[1] == place[1]))
    assert own.size >= 1
    assert weight[own].max() == weight.max()
    filter_.predict()
    assert filter_.core.estimate[0, 0] == pytest.approx(place[0], abs=1e-4)  # it is followed through the silence


def test_mean_estimate_is_the_mean_of_the_particles():
    filter_ = CompiledFilter(Belief(particles=1001), seed=2)
    filter_.initialize(5000.0, -3000.0)  # far from the origin float32 has a quarter of a millimetre left
    mean_x, mean_y, xx, yy, xy = filter_.summary()
    x, y = filter_.particles[:2].astype(np.float64)
    assert (mean_x, mean_y) == (pytest.approx(x.mean(), abs=1e-3), pytest.approx(y.mean(), abs=1e-3))
    np.testing.assert_allclose([[xx, xy], [xy, yy]], np.cov(x, y, bias=True), rtol=1e-5, atol=0.02)


def test_first_particles_fill_a_square_of_twice_the_reach_about_the_vehicle():
    filter_ = CompiledFilter(Belief(particles=20_000), seed=3)
    filter_.initialize(400.0, -70.0)
    x, y = filter_.particles[0] - 400.0, filter_.particles[1] + 70.0
    for offset in (x, y):
        assert -100.0 <= offset.min() < -99.0
        assert 99.0 < offset.max() <= 100.0
    table = np.histogram2d(x, y, bins=8, range=[[-100, 100]] * 2)[0]  # 312.5 expected in each of 64 squares
    assert ((table - 312.5) ** 2 / 312.5).sum() < 63 + ERRORS * math.sqrt(2 * 63)  # chi-square, 63 degrees of freedom


def test_belief_spreads_while_nothing_is_heard():
    """Prediction goes on through missed pings: Alg. 3 adds v_max^2 / 6 to each variance in a second."""
    deaf = Water(reach=1.0, edge_width=0.01)
    belief = Belief(particles=2000, motion=BrownianWalk(max_speed=6.0))
    simulation = Simulation(dataclasses.replace(Scenario(), time_step=1.0, water=deaf, belief=belief), 50)
    simulation.reset(seed=0)
    before = simulation.covariance.copy()
    for _ in range(60):
        simulation.step(np.zeros((50, 1, 2)))
    assert not simulation.detected.any()
    grown = (simulation.covariance - before)[:, 0, 0, [0, 1], [0, 1]].mean()
    # 36/6 * 60 = 360 on top of 3,333: the sample variance of 100 rows of 2,000 is known to 3,693 * sqrt(2/200,000) = 12.
    assert grown == pytest.approx(360.0, abs=ERRORS * 12)
