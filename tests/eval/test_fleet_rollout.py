"""Roll-outs of fleets: what is written down of each step is what the referee says."""

import numpy as np
import pytest

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import build_task
from tagtrack.eval.fleet_metrics import summarize_fleet
from tagtrack.eval.rollout import roll_out, trace

STEPS = 30


def fleet(overrides=None, **options):
    return build_task("LeopardShark-v0", particles=60, overrides={"episode_steps": STEPS, **(overrides or {})}, **options)


def maker(specification):
    return lambda simulation: make_baseline(specification, simulation)


@pytest.mark.parametrize("modem", ["perfect", "none", "tdma"])
def test_record_is_what_the_referee_says_of_each_step(modem):
    task = fleet(vehicles=3, tags=2, modem=modem, overrides={"start.separation": 12.0})
    record = roll_out(task, maker("pursuit"), episodes=2, seed=4)
    too_near = 0.0
    for episode in range(2):
        simulation = Simulation(task.scenario)
        observation, state = simulation.reset(4 + episode), None
        policy = make_baseline("pursuit", simulation)
        for step in range(STEPS):
            actions, state = policy.predict(observation[0], state)
            simulation.step(actions[None])
            outcomes = simulation.outputs.outcomes[0]
            assert record.error[episode, step] == pytest.approx(outcomes["error"].mean())
            np.testing.assert_allclose(record.fleet.tag_error[episode, step], simulation.error[0].mean(axis=0))
            assert record.range[episode, step] == outcomes["range"].min()
            assert record.reward[episode, step] == pytest.approx(simulation.reward.mean())
            assert record.fleet.messages[episode, step] == outcomes["messages"].sum()
        assert record.fleet.encroachments[episode].sum() == outcomes["encroachments"].sum()
        too_near += outcomes["encroachments"].sum()
    assert too_near > 0
    assert (record.fleet.messages.sum() > 0) == (modem == "tdma")


def test_only_vehicles_that_take_part_count():
    """Batteries of less than a minute, of different sizes; in the end nobody takes part, and all beliefs count as they were."""
    task = fleet(vehicles=2, modem="none", overrides={"vehicle.battery": 0.5, "vehicle.battery_spread": 0.8})
    record = roll_out(task, maker("circle"), episodes=4, seed=0)
    simulation = Simulation(task.scenario, 4)
    simulation.reset(0)
    policy, state, alone = make_baseline("circle", simulation), None, 0
    for step in range(STEPS):
        actions, state = policy.predict(simulation.observation.reshape(8, -1), state)
        simulation.step(actions.reshape(4, 2, -1))
        part = ~simulation.worlds.vehicles["gone"]
        for world in range(4):
            errors = simulation.error[world, :, 0]
            expected = errors[part[world]].mean() if part[world].any() else errors.mean()
            assert record.error[world, step] == pytest.approx(expected)
            alone += part[world].sum() == 1
    assert alone > 0 and not part.any()


def test_numbers_of_fleets_do_not_depend_on_batch_or_threads():
    task = fleet(vehicles=2, tags=2, modem="tdma")
    for name in ("uncertain", "information", "oracle_circle"):
        expected = roll_out(task, maker(name), episodes=4, seed=3)
        for batch, threads in ((1, 1), (3, 2)):
            record = roll_out(task, maker(name), episodes=4, seed=3, batch=batch, threads=threads)
            np.testing.assert_array_equal(record.error, expected.error)
            np.testing.assert_array_equal(record.fleet.encroachments, expected.fleet.encroachments)


def test_single_vehicles_have_no_fleet_record_and_traces_of_fleets_further_axes():
    assert roll_out(fleet(), maker("circle"), episodes=2, seed=0).fleet is None
    traced = trace(fleet(vehicles=3, tags=2, modem="none"), maker("circle"), episodes=2, seed=0)
    shapes = [getattr(traced, name).shape[2:] for name in ("estimate", "fish", "vehicle", "mean", "covariance")]
    assert shapes == [(3, 2, 2), (2, 2), (3, 2), (3, 2, 2), (3, 2, 2, 2)]
    error = np.linalg.norm(traced.estimate - traced.fish[:, :, None], axis=-1)
    np.testing.assert_allclose(error.mean(axis=2), traced.record.fleet.tag_error, atol=1e-3)


def test_figures_of_fleets_by_hand():
    record = roll_out(fleet(vehicles=2, tags=2, modem="tdma"), maker("circle"), episodes=3, seed=0).fleet
    record.tag_error[...] = np.array([[1.0, 3.0], [5.0, 3.0], [2.0, 200.0]])[:, None]
    record.encroachments[...] = 0.0
    record.encroachments[0, :2] = 2.0
    record.messages[...] = 1.0
    figures = {name: figure.value for name, figure in summarize_fleet([record], lost_error=100.0).items()}
    assert figures["worst_tag_error_m"] == pytest.approx((3 + 5 + 200) / 3)
    assert figures["tag_lost_fraction"] == pytest.approx(1 / 6)
    assert figures["tag_1_lost_fraction"] == pytest.approx(1 / 3)
    assert figures["tag_0_error_m"] == pytest.approx(8 / 3)
    assert figures["encroachments_per_hour"] == pytest.approx(4 / 3 * 60)  # episodes of a minute
    assert figures["messages_per_hour"] == pytest.approx(1800)


def test_leaving_out_the_first_steps_leaves_out_theirs_of_the_fleet():
    record = roll_out(fleet(vehicles=2), maker("circle"), episodes=2, seed=0)
    later = record.from_step(20)
    np.testing.assert_array_equal(later.fleet.tag_error, record.fleet.tag_error[:, 20:])


def test_actions_of_half_a_fleet_are_refused():
    class Half:
        def predict(self, observation, state=None, episode_start=None, deterministic=False):
            return np.zeros((len(observation) // 2, 2), np.float32), None

    with pytest.raises(ValueError, match=r"a policy must give actions \(4, 2\), got \(2, 2\)"):
        roll_out(fleet(vehicles=2), lambda simulation: Half(), episodes=2, seed=0)
