"""Roll-outs: the same fish for every policy, the same numbers in any batch, and seeds that never meet."""

import itertools

import numpy as np
import pytest

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.simulation import Simulation
from tagtrack.eval.rollout import SeedBlock, block_seed, roll_out, run_seed, trace


def maker(specification):
    return lambda simulation: make_baseline(specification, simulation)


def test_record_is_what_a_loop_over_single_worlds_sees(task):
    record = roll_out(task, maker("pursuit"), episodes=3, seed=7)
    for episode in range(3):
        simulation = Simulation(task.scenario)
        observation = simulation.reset(7 + episode)
        policy, state = make_baseline("pursuit", simulation), None
        for step in range(task.scenario.episode_steps):
            action, state = policy.predict(observation[:, 0], state)
            simulation.step(action[:, None])
            assert record.error[episode, step] == simulation.error[0, 0, 0]
            assert record.range[episode, step] == simulation.range[0, 0, 0]
            assert record.reward[episode, step] == simulation.reward[0, 0]


@pytest.mark.parametrize("specification", ["three_step", "circle:30", "information", "random", "oracle_circle"])
def test_numbers_do_not_depend_on_batch_or_threads(task, specification):
    expected = roll_out(task, maker(specification), episodes=5, seed=3)
    for batch, threads in ((1, 1), (2, 2), (5, 3)):
        record = roll_out(task, maker(specification), episodes=5, seed=3, batch=batch, threads=threads)
        np.testing.assert_array_equal(record.error, expected.error)
        np.testing.assert_array_equal(record.range, expected.range)


def test_every_policy_meets_the_same_fish(task):
    one, other = (trace(task, maker(name), episodes=4, seed=0) for name in ("random", "circle"))
    np.testing.assert_array_equal(one.fish, other.fish)
    assert not np.array_equal(one.vehicle, other.vehicle)
    assert len({tuple(path) for path in one.fish[:, 0].tolist()}) == 4  # but each episode another


def test_trace_is_the_roll_out_with_paths(task):
    traced = trace(task, maker("pursuit"), episodes=3, seed=5)
    record = roll_out(task, maker("pursuit"), episodes=3, seed=5)
    np.testing.assert_array_equal(traced.record.error, record.error)
    np.testing.assert_allclose(np.hypot(*np.moveaxis(traced.estimate - traced.fish, -1, 0)), record.error, atol=1e-3)
    np.testing.assert_allclose(np.hypot(*np.moveaxis(traced.vehicle - traced.fish, -1, 0)), record.range, atol=1e-3)
    assert traced.covariance.shape == (3, task.scenario.episode_steps, 2, 2)


def test_steps_are_reported_as_they_are_done(task):
    reported = []
    roll_out(task, maker("pursuit"), episodes=5, seed=0, batch=3, on_step=reported.append)
    assert sum(reported) == 5 * task.scenario.episode_steps
    assert set(reported) == {3, 2}


def test_blocks_of_seeds_never_meet_however_many_episodes():
    largest = 2**31 - 1
    spans = sorted((block_seed(block, 0), block_seed(block, largest) + 2**31) for block in SeedBlock)
    assert all(end < begin for (_, end), (begin, _) in itertools.pairwise(spans))


def test_training_runs_of_neighbouring_seeds_share_no_episode():
    firsts = [run_seed(SeedBlock.VALIDATION, seed) for seed in range(5)]
    assert firsts == [block_seed(SeedBlock.VALIDATION, 4096 * seed) for seed in range(5)]
    assert run_seed(SeedBlock.TRAINING, 2**31 - 1) < block_seed(SeedBlock.TRAINING, 2**31 - 1)
    with pytest.raises(ValueError, match="got -1"):
        run_seed(SeedBlock.TRAINING, -1)


@pytest.mark.parametrize("seed", [-1, 2**31])
def test_seed_out_of_its_block_is_refused(seed):
    with pytest.raises(ValueError, match=f"got {seed}"):
        block_seed(SeedBlock.TUNING, seed)


def test_no_episode_is_no_roll_out(task):
    with pytest.raises(ValueError, match="episodes must be at least 1, got 0"):
        roll_out(task, maker("pursuit"), episodes=0, seed=0)
