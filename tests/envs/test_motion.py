"""The random walks of Clark et al. 2013 (Algs. 2-4, Eq. 4), the boat, and the replay of a recorded track, by their statistics.

Most tests move one long row of particles. Bounds are four standard errors of the sample (two-sided chance 6e-5) unless a test
says otherwise; seeds are fixed.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.kernels.random import PREDICT, fill_bits
from tagtrack.envs.motions import BrownianWalk, LevyFlight, MomentumRandomWalk, Replay, StraightAndIdle
from tagtrack.envs.motions.motion import start_swimming, swim
from tagtrack.envs.motions.replay import START_ROW, TURN
from tagtrack.envs.motions.tracks import Track
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation

COUNT = 40_000
ERRORS = 4.0  # standard errors allowed
MOTIONS = {
    "momentum": MomentumRandomWalk(),
    "brownian": BrownianWalk(),
    "levy": LevyFlight(),
    "boat": StraightAndIdle(),
}


class Shoal:
    """A row of particles that swims by one motion."""

    def __init__(self, motion, time_step=1.0, count=COUNT, seed=0):
        self.motion, self.parameters = motion, np.array(motion.padded_row())
        self.time_step = float(time_step)
        self.seed, self.step = np.uint64(seed), 0
        self.particles = np.zeros((4, count), np.float32)
        self.bits = np.zeros(-(-count // 32) * 32, np.int32)
        self.normals = np.zeros(count, np.float32), np.zeros(count, np.float32)

    def stream(self):
        return self.seed, np.uint64(0), np.uint64(0), np.uint64(self.step)

    def start(self):
        fill_bits(self.stream(), PREDICT, self.bits)
        start_swimming(self.particles, self.bits, self.motion.start.address, self.parameters)
        return self

    def swim(self, steps=1):
        """Returns the mean displacement that the last step reports."""
        for _ in range(steps):
            self.step += 1
            moved = swim(
                self.particles, self.stream(), PREDICT, self.bits, *self.normals, self.motion.choose.address,
                self.parameters, self.time_step,
            )  # fmt: skip
        return moved

    x = property(lambda self: self.particles[0].astype(np.float64))
    y = property(lambda self: self.particles[1].astype(np.float64))
    heading = property(lambda self: self.particles[2].astype(np.float64))
    speed = property(lambda self: self.particles[3].astype(np.float64))
    distance = property(lambda self: np.hypot(self.x, self.y))


def within_errors(sample, mean, deviation):
    return abs(np.mean(sample) - mean) < ERRORS * deviation / math.sqrt(np.size(sample))


def assert_uniform(values, low, high):
    assert low <= values.min() <= values.max() <= high
    assert stats.kstest((values - low) / (high - low), "uniform").pvalue > 1e-4


# Every motion.


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("time_step", [0.25, 1.0, 2.0])
def test_a_step_leads_along_the_new_heading_at_the_new_speed(name, time_step):
    shoal = Shoal(MOTIONS[name], time_step, count=2000).start()
    shoal.swim(3)
    x, y = shoal.x, shoal.y
    moved_x, moved_y = shoal.swim()
    # Eight metres in float32 have steps of 1e-6 m, the polynomials' sine an error of 2e-7.
    np.testing.assert_allclose(shoal.x - x, shoal.speed * np.cos(shoal.heading) * time_step, atol=1e-5)
    np.testing.assert_allclose(shoal.y - y, shoal.speed * np.sin(shoal.heading) * time_step, atol=1e-5)
    assert moved_x == pytest.approx(np.mean(shoal.x - x), abs=1e-5)
    assert moved_y == pytest.approx(np.mean(shoal.y - y), abs=1e-5)


@pytest.mark.parametrize("name", MOTIONS)
def test_first_headings_point_everywhere(name):
    assert_uniform(Shoal(MOTIONS[name]).start().heading, -math.pi, math.pi)


@pytest.mark.parametrize("name", ["momentum", "brownian", "levy"])
def test_first_speeds_are_uniform_up_to_the_largest(name):
    assert_uniform(Shoal(MOTIONS[name]).start().speed, 0.0, MOTIONS[name].max_speed)


@pytest.mark.parametrize("name", MOTIONS)
def test_no_direction_is_preferred(name):
    """After 20 steps of every motion the mean displacement is that of chance, along both axes."""
    shoal = Shoal(MOTIONS[name]).start()
    shoal.swim(20)
    for displacement in (shoal.x, shoal.y):
        assert within_errors(displacement, 0.0, displacement.std())
    assert shoal.x.std() == pytest.approx(shoal.y.std(), rel=0.1)  # the Levy flight's heavy tail: 2 % at one standard error


@pytest.mark.parametrize("name", MOTIONS)
def test_no_speed_is_beyond_the_largest(name):
    shoal = Shoal(MOTIONS[name], count=4000).start()
    largest = np.float32(MOTIONS[name].speed if name == "boat" else MOTIONS[name].max_speed)
    for _ in range(50):
        shoal.swim()
        assert shoal.speed.min() >= 0.0
        assert shoal.speed.max() <= largest


@pytest.mark.parametrize("name", MOTIONS)
def test_fish_and_particles_move_by_the_same_rule(name):
    """Four thousand fish, each a row of one in its own world, against a row of particles: distance covered after 30 s."""
    scenario = dataclasses.replace(Scenario(), time_step=1.0, fish=MOTIONS[name], belief=one_particle())
    simulation = Simulation(scenario, 4000)
    simulation.reset(seed=1)
    start = simulation.fish_position[:, 0].copy()
    for _ in range(30):
        simulation.step(np.zeros((4000, 1, 2)))
    distance = np.hypot(*(simulation.fish_position[:, 0] - start).T)
    shoal = Shoal(MOTIONS[name]).start()
    shoal.swim(30)
    # To the centimetre: a third of the boats has gone straight on for 21 m, and rounding there is no difference in motion.
    assert stats.ks_2samp(distance.round(2), shoal.distance.round(2)).pvalue > 1e-4
    assert stats.ks_2samp(simulation.worlds.fish[:, 0, 3, 0], shoal.speed).pvalue > 1e-4


def one_particle():
    return dataclasses.replace(Scenario().belief, particles=1)


# Alg. 2.


def test_momentum_changes_speed_and_heading_by_table_one():
    """From a speed in the middle of a wide range nothing is clipped: normal changes of 0.3 m/s and pi/2 rad in one second."""
    shoal = Shoal(MomentumRandomWalk(max_speed=10.0))
    shoal.particles[3] = 5.0
    shoal.swim()
    change = shoal.speed - 5.0
    assert stats.kstest(change / 0.3, "norm").pvalue > 1e-4
    # Sample variance of normals: relative standard error sqrt(2/n) = 0.7 %.
    assert np.var(change) == pytest.approx(0.09, rel=ERRORS * math.sqrt(2 / COUNT))
    # The heading is only known on the circle: E cos = exp(-sigma^2/2), E cos^2 = (1 + exp(-2 sigma^2))/2.
    mean = math.exp(-((math.pi / 2) ** 2) / 2)
    spread = math.sqrt((1 + math.exp(-2 * (math.pi / 2) ** 2)) / 2 - mean**2)
    assert within_errors(np.cos(shoal.heading), mean, spread)
    assert within_errors(np.sin(shoal.heading), 0.0, 1.0)


def test_momentum_turns_by_a_normal_angle():
    shoal = Shoal(MomentumRandomWalk(turn_sigma=0.2, speed_sigma=0.0))
    shoal.particles[2], shoal.particles[3] = 1.0, 0.5
    shoal.swim()
    assert stats.kstest((shoal.heading - 1.0) / 0.2, "norm").pvalue > 1e-4
    np.testing.assert_array_equal(shoal.speed, 0.5)


def test_changes_of_speed_and_heading_are_independent():
    shoal = Shoal(MomentumRandomWalk(turn_sigma=0.2, speed_sigma=0.2, max_speed=10.0))
    shoal.particles[3] = 5.0
    shoal.swim()
    assert abs(np.corrcoef(shoal.heading, shoal.speed)[0, 1]) < ERRORS / math.sqrt(COUNT)


@pytest.mark.parametrize("time_step", [0.1, 0.5, 2.0])
def test_momentum_of_one_second_is_the_same_however_finely_time_is_cut(time_step):
    """Variance grows by sigma^2 a second: steps of sigma * sqrt(time_step)."""
    shoal = Shoal(MomentumRandomWalk(turn_sigma=0.1, speed_sigma=0.1, max_speed=10.0), time_step)
    shoal.particles[3] = 5.0
    seconds = 2.0
    shoal.swim(round(seconds / time_step))
    for values in (shoal.speed, shoal.heading):
        assert np.var(values) == pytest.approx(0.01 * seconds, rel=ERRORS * math.sqrt(2 / COUNT))


def test_heading_stays_within_half_a_turn():
    shoal = Shoal(MomentumRandomWalk(turn_sigma=3.0), count=4000)
    for _ in range(50):
        shoal.swim()
        assert np.abs(shoal.heading).max() <= math.pi + 1e-6


# Alg. 3.


@pytest.mark.parametrize("time_step", [0.5, 1.0, 2.0])
def test_brownian_step_is_uniform_in_length_and_direction(time_step):
    shoal = Shoal(BrownianWalk(max_speed=0.8), time_step)
    shoal.swim()
    assert_uniform(shoal.distance, 0.0, 0.8 * time_step * (1 + 1e-6))
    assert_uniform(np.arctan2(shoal.y, shoal.x), -math.pi, math.pi)


def test_brownian_steps_have_no_memory():
    """After n steps the variance along an axis is n v_max^2 / 6 (half of E l^2 = v_max^2 / 3)."""
    shoal = Shoal(BrownianWalk())
    shoal.swim(12)
    assert np.var(shoal.x) == pytest.approx(12 / 6, rel=1.2 * ERRORS * math.sqrt(2 / COUNT))
    before = shoal.heading
    shoal.swim()
    assert abs(np.mean(np.exp(1j * (shoal.heading - before)))) < ERRORS / math.sqrt(COUNT)


# Alg. 4, Eq. 4.


@pytest.mark.parametrize("time_step", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("gamma", [0.001, 0.01, 0.1, 1.0])
def test_levy_step_is_half_cauchy_with_scale_gamma_times_the_time_step(gamma, time_step):
    """The distribution of Eq. 4 on l > 0 is 2/pi atan(l / gamma); its median is gamma. Below the cut every quantile holds."""
    count = 200_000
    shoal = Shoal(LevyFlight(gamma=gamma, max_speed=1000.0 * gamma), time_step, count)
    shoal.swim()
    steps = shoal.distance / time_step
    # The median of n draws: standard error 1/(2 f sqrt(n)) with the density f = 1/(pi gamma) there.
    assert np.median(steps) == pytest.approx(gamma, rel=ERRORS * math.pi / (2 * math.sqrt(count)))
    assert stats.kstest(2 / math.pi * np.arctan(steps / gamma), "uniform", mode="asymp").pvalue > 1e-4
    assert_uniform(np.arctan2(shoal.y, shoal.x), -math.pi, math.pi)


def test_levy_tail_is_cut_and_what_lay_beyond_lies_at_the_cut():
    """With the default gamma of 0.1 m and 5 m/s the share beyond is 1 - 2/pi atan(50) = 1.27 %."""
    shoal = Shoal(LevyFlight())
    shoal.swim()
    share = 1 - 2 / math.pi * math.atan(5.0 / 0.1)
    assert np.mean(shoal.speed == 5.0) == pytest.approx(share, abs=ERRORS * math.sqrt(share * (1 - share) / COUNT))
    assert shoal.distance.max() == pytest.approx(5.0, rel=1e-5)


# The boat.


@pytest.mark.parametrize("time_step", [0.5, 1.0, 2.0])
def test_boat_runs_and_idles_for_its_mean_durations(time_step):
    """Mean durations over the changes seen in 400 s of 20,000 boats, and the share of time idle from the first step on."""
    shoal = Shoal(StraightAndIdle(leg_duration=40.0, idle_duration=10.0), time_step, count=20_000).start()
    moving = [shoal.speed > 0]
    for _ in range(round(400 / time_step)):
        shoal.swim()
        moving.append(shoal.speed > 0)
    moving = np.array(moving)
    stops, starts = np.sum(moving[:-1] & ~moving[1:]), np.sum(~moving[:-1] & moving[1:])
    # Time spent over number of ends estimates the mean of a memoryless duration; relative standard error 1/sqrt(ends).
    assert moving[:-1].sum() * time_step / stops == pytest.approx(40.0, rel=ERRORS / math.sqrt(stops))
    assert (~moving[:-1]).sum() * time_step / starts == pytest.approx(10.0, rel=ERRORS / math.sqrt(starts))
    for row in (0, len(moving) // 2, -1):  # a fifth of the boats idles at any time: the start is drawn from the long run
        assert np.mean(moving[row]) == pytest.approx(0.8, abs=ERRORS * 0.4 / math.sqrt(20_000))


def test_boat_keeps_speed_and_course_on_a_leg_and_takes_a_new_course_after_it():
    shoal = Shoal(StraightAndIdle(speed=0.7, leg_duration=20.0, idle_duration=5.0), count=5000).start()
    turned = []
    for _ in range(60):
        heading, speed = shoal.heading, shoal.speed
        shoal.swim()
        assert set(np.unique(shoal.speed)) <= {0.0, float(np.float32(0.7))}
        goes_on, sets_off = (speed > 0) & (shoal.speed > 0), (speed == 0) & (shoal.speed > 0)
        np.testing.assert_array_equal(shoal.heading[goes_on], heading[goes_on])
        turned.append(shoal.heading[sets_off])
    assert_uniform(np.concatenate(turned), -math.pi, math.pi)


# Replay of a recorded track (the truth only).

STEPS = 50


def winding_track(rows=400):
    """A track with a value of its own at every second: no two stretches are the same."""
    time = np.arange(rows, dtype=np.float64)
    position = np.stack([0.4 * time + 5 * np.sin(0.1 * time), 8 * np.cos(0.037 * time) + 0.01 * time], axis=1)
    return Track(time=1_568_052_138.0 + time, position=position + [526_073.0, 2_771_146.0])


def replay(track, worlds=64, time_scale=1.0, time_step=1.0, seed=0):
    """Paths (worlds, STEPS + 1, 2) [m] of replayed fish, and the simulation that has run them."""
    scenario = dataclasses.replace(
        Scenario(),
        fish=Replay(time_scale=time_scale),
        belief=one_particle(),
        episode_steps=STEPS,
        time_step=time_step,
    )
    simulation = Simulation(scenario, worlds, tracks=[track])
    simulation.reset(seed=seed)
    path = [simulation.fish_position[:, 0].copy()]
    for _ in range(STEPS):
        simulation.step(np.zeros((worlds, 1, 2)))
        path.append(simulation.fish_position[:, 0].copy())
    return np.stack(path, axis=1).astype(np.float64), simulation


def as_complex(points):
    return points[..., 0] + 1j * points[..., 1]


def test_replayed_fish_swims_the_track_up_to_rotation_and_translation():
    """The turn is read off the farthest point of a stretch; then every other point has to fit within float32's millimetre."""
    track = winding_track()
    recorded = as_complex(track.position)
    paths, simulation = replay(track)
    turns = []
    for world, path in enumerate(as_complex(paths)):
        start = int(simulation.worlds.targets[world, 0]["memory"][START_ROW])
        stretch = recorded[start : start + STEPS + 1] - recorded[start]
        swum = path - path[0]
        far = np.abs(stretch).argmax()
        turn = swum[far] / stretch[far]
        assert abs(turn) == pytest.approx(1.0, abs=1e-4)
        np.testing.assert_allclose(swum, turn * stretch, atol=1e-3)
        turns.append(np.angle(turn))
    assert_uniform(np.array(turns), -math.pi, math.pi)


def test_replay_starts_anywhere_on_the_track_that_leaves_a_whole_episode():
    track = winding_track(rows=60)
    _, simulation = replay(track, worlds=400)
    starts = simulation.worlds.targets["memory"][:, 0, START_ROW]
    assert set(starts) == set(range(60 - STEPS))  # 400 worlds miss one of ten places with chance 1e-17


def test_next_episode_of_a_replay_takes_another_stretch_and_another_turn():
    _, simulation = replay(winding_track(), worlds=16)
    before = simulation.worlds.targets["memory"][:, 0].copy()
    simulation.reset()
    after = simulation.worlds.targets["memory"][:, 0]
    assert np.mean(before[:, START_ROW] == after[:, START_ROW]) < 0.2
    assert not np.any(before[:, TURN] == after[:, TURN])


def test_replay_begins_where_any_fish_would():
    paths, _ = replay(winding_track(), worlds=200)
    distance = np.abs(as_complex(paths[:, 0]))
    start = Scenario().start
    assert start.nearest <= distance.min() < distance.max() <= start.farthest


@pytest.mark.parametrize("time_scale", [0.5, 0.25, 2.0])
def test_time_scale_scales_the_speed(time_scale):
    """A straight track at 1 m/s: its replay keeps the shape and swims at time_scale metres a second."""
    time = np.arange(300.0)
    track = Track(time=time, position=np.stack([time, np.zeros(300)], axis=1))
    paths, simulation = replay(track, worlds=8, time_scale=time_scale)
    np.testing.assert_allclose(np.abs(np.diff(as_complex(paths), axis=1)), time_scale, atol=1e-4)
    np.testing.assert_allclose(simulation.worlds.fish[:, 0, 3, 0], time_scale, atol=1e-4)


def test_replayed_fish_knows_its_heading_and_speed():
    paths, simulation = replay(winding_track(), worlds=32, time_step=0.5)
    last = as_complex(paths[:, -1]) - as_complex(paths[:, -2])
    fish = simulation.worlds.fish[:, 0, :, 0]
    np.testing.assert_allclose(fish[:, 3], np.abs(last) / 0.5, atol=1e-3)
    np.testing.assert_allclose(np.exp(1j * (fish[:, 2] - np.angle(last))), 1.0, atol=1e-3)


def test_replay_interpolates_between_the_rows_of_the_file():
    """Rows every ten seconds, steps of one: nine points of ten are on the straight line between two rows."""
    corner = Track(time=np.array([0.0, 10.0, 20.0, 60.0]), position=np.array([[0, 0], [10, 0], [10, 10], [10, 50.0]]))
    paths, _ = replay(corner, worlds=8)
    np.testing.assert_allclose(np.abs(np.diff(as_complex(paths), axis=1)), 1.0, atol=1e-4)


def test_replay_of_a_track_shorter_than_an_episode_is_refused():
    with pytest.raises(ValueError, match=r"lasts 49 s .* episode 50 s"):
        replay(winding_track(rows=50))
    paths, _ = replay(winding_track(rows=51), worlds=2)  # one row more is enough
    assert paths.shape == (2, STEPS + 1, 2)
