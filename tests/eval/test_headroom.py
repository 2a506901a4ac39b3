"""What is left above a policy: imagined futures begin where the world stands, hide the truth, and better moves show as gain."""

from typing import Any

import numpy as np
import pytest

from tagtrack.baselines.futures import Futures, better_move, steps_of, take_rows
from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task, build_task
from tagtrack.eval.contestants import find_makers
from tagtrack.eval.headroom import best_gain, look_ahead
from tagtrack.eval.rollout import roll_out
from tests.eval.test_commands import read_json, run_eval


def after(task: Task, steps: int, worlds: int = 2) -> tuple[Simulation, Any, Any]:
    """A simulation some steps into its episodes, the circle that steered it, and its memory."""
    simulation = Simulation(task.scenario, worlds, tracks=task.tracks)
    policy, memory = make_baseline("circle", simulation), None
    simulation.reset(3)
    for _ in range(steps):
        action, memory = policy.predict(simulation.observation.reshape(-1, simulation.observation.shape[-1]), memory)
        simulation.step(action.reshape(worlds, task.scenario.vehicles, -1))
    return simulation, policy, memory


TASKS = [
    build_task("LeopardShark-v0", particles=300),
    build_task("TimeOfFlight-v0", particles=300),
    build_task("AreaOnlyUnknownRange-v0", particles=300),
    build_task("RangeOnly-v0", particles=300, vehicles=2, tags=3, modem="tdma"),
    build_task("LeopardShark-v0", particles=300, vehicles=2, tags=2, overrides={"belief.resample_below": 0.5}),
]


@pytest.mark.parametrize("task", TASKS, ids=lambda task: f"{task.env_id}-{task.scenario.vehicles}x{task.scenario.targets}")
def test_futures_begin_as_the_vehicles_know_and_differ_in_the_truth_alone(task: Task) -> None:
    simulation, _, memory = after(task, 40)
    before = simulation.save_state()
    imagined = Futures(simulation, futures=8)
    policy = make_baseline("circle", imagined.simulation)
    cost = imagined.play(policy, memory, 1, task.scenario.vehicles - 1, held=2, steps=0)
    assert cost.shape == (5 + task.scenario.targets, 8)
    for own, saved in zip((*simulation.worlds, *simulation.outputs), before[:-1], strict=True):
        assert own.tobytes() == saved.tobytes()  # the source itself stays as it was
    worlds = imagined.simulation.worlds
    for name in ("navigation", "mates", "radios"):
        assert all((row == getattr(simulation.worlds, name)[1]).all() for row in getattr(worlds, name))
    fish = worlds.fish[:, :, :2, 0].reshape(*imagined.shape, -1)
    np.testing.assert_array_equal(fish, np.broadcast_to(fish[0], fish.shape))  # every move meets the same fish ...
    owner = task.scenario.vehicles - 1 if task.scenario.owners > 1 else 0
    particles = simulation.worlds.particles[1, owner, 0, :2].T
    assert all((particles == place[:2]).all(axis=1).any() for place in fish[0])  # ... which are particles
    assert len(np.unique(worlds.clock["seed"])) == 8


def test_the_truth_does_not_matter() -> None:
    """Whatever the truth is, a state has the same futures, as long as the vehicle knows the same."""
    costs = []
    for spoil in (False, True):
        simulation, _, memory = after(build_task("LeopardShark-v0", particles=200), 30)
        if spoil:
            worlds = simulation.worlds
            worlds.fish[...] = -1e3
            worlds.encounters["noisy"] = ~worlds.encounters["noisy"]
            worlds.vehicles["x"] += 500.0
            worlds.targets["first_ping"], worlds.targets["next_ping"] = 1.7, 61.7
        imagined = Futures(simulation, futures=16, seed=5)
        costs.append(imagined.play(make_baseline("circle", imagined.simulation), memory, 0, 0, held=5, steps=10))
    np.testing.assert_array_equal(*costs)


def test_a_gain_of_nothing_but_luck_is_none() -> None:
    rng = np.random.default_rng(0)
    lucky = [best_gain(rng.normal(size=(6, 64))) for _ in range(2000)]
    assert abs(np.mean(lucky)) < 3 * np.std(lucky) / 2000**0.5  # the best of six means would save 1.27 / 8 of a sigma
    cost = rng.normal(size=(6, 64))
    cost[3] -= 2.0
    assert best_gain(cost) == pytest.approx(2.0, abs=0.5)


def test_where_all_moves_are_worse_nothing_is_lost_by_looking() -> None:
    """Five moves that each cost a third of a sigma more: taking whichever seems best would lose a tenth of one."""
    rng = np.random.default_rng(1)
    worse = np.array([0.0, *[0.3] * 5])[:, None]
    gains = [best_gain(worse + rng.normal(size=(6, 128))) for _ in range(2000)]
    assert -0.02 < np.mean(gains) < 0.01


def test_own_move_is_kept_unless_another_is_surely_better() -> None:
    cost = np.tile(np.arange(8.0), (3, 1))
    cost[1] -= 1e-3 * np.array([5, -5] * 4)  # better here, worse there
    assert better_move(cost) == 0
    cost[2] -= 0.01
    assert better_move(cost) == 2


def test_more_is_left_above_lying_still_than_above_a_circle() -> None:
    task = build_task("LeopardShark-v0", particles=200, overrides={"episode_steps": 60})
    left = {}
    for name in ("stationary", "circle:7"):
        maker = find_makers({name: name}, task, task.env_id)[name]
        found = look_ahead(task, maker, episodes=12, decisions=2, futures=32, seed=1)
        left[name] = found.share().value
    assert left["stationary"] > left["circle:7"] > 0


def test_futures_are_as_long_as_the_pings_make_them() -> None:
    """Ten seconds held and fifty ahead where a tag pings every two; minutes where it pings every minute or so."""
    told = {name: build_task(name).scenario for name in ("LeopardShark-v0", "AreaOnly-v0", "RangeOnly-v0")}
    seconds = {name: [steps_of(each, pings) * each.time_step for pings in (5, 25)] for name, each in told.items()}
    assert seconds == {"LeopardShark-v0": [10.0, 50.0], "AreaOnly-v0": [360.0, 1860.0], "RangeOnly-v0": [50.0, 250.0]}


def test_the_rollout_planner_gains_over_a_circle_that_is_far_too_wide() -> None:
    task = build_task("LeopardShark-v0", particles=200, overrides={"episode_steps": 120})
    makers = find_makers({"circle": "circle:60", "rollout": "rollout:radius=60,futures=32"}, task, task.env_id)
    errors = {name: roll_out(task, maker, episodes=12, seed=2).error.mean(axis=1) for name, maker in makers.items()}
    gain = np.log(errors["circle"] / errors["rollout"])  # 0.25 to 0.44 with other seeds
    assert gain.mean() > 2 * gain.std(ddof=1) / len(gain) ** 0.5


def test_the_rollout_planner_repeats_itself() -> None:
    task = build_task("LeopardShark-v0", particles=60, overrides={"episode_steps": 8})
    maker = find_makers({"a": "rollout:radius=9,futures=8"}, task, task.env_id)["a"]
    record = roll_out(task, maker, episodes=2, seed=2)
    np.testing.assert_array_equal(record.error, roll_out(task, maker, episodes=2, seed=2).error)


def test_vehicles_that_have_left_do_not_count() -> None:
    overrides = {"episode_steps": 40, "vehicle.battery": 0.9, "vehicle.battery_spread": 0.9}
    task = build_task("LeopardShark-v0", particles=100, vehicles=2, modem="none", overrides=overrides)
    maker = find_makers({"circle": "circle"}, task, task.env_id)["circle"]
    left = look_ahead(task, maker, episodes=6, decisions=2, futures=8, seed=0)
    own = roll_out(task, maker, episodes=6, seed=0).error.mean(axis=1)
    np.testing.assert_allclose(left.error, own, rtol=1e-6)


def test_rows_of_a_memory_are_taken_whatever_its_shape() -> None:
    rows = np.array([1, 1])
    taken = take_rows((np.arange(3), (np.eye(3),)), rows, 3)
    np.testing.assert_array_equal(taken[0], [1, 1])
    np.testing.assert_array_equal(taken[1][0], np.eye(3)[[1, 1]])
    with pytest.raises(ValueError, match="arrays of 3 rows"):
        take_rows((np.zeros(2),), rows, 3)


def test_the_command_prints_and_writes_what_is_left(tmp_path) -> None:
    options = ("--particles", "50", "--set", "episode_steps=20", "--episodes", "4", "--decisions", "2", "--futures", "8")
    done = run_eval("headroom", *options, "--policies", "circle:7", "pursuit", "--out", "left.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "left" in done.stdout
    result = read_json(tmp_path / "left.json")
    assert list(result["policies"]) == ["circle:7", "pursuit"]
    assert all(list(row) == ["mean_error_m", "gain_m", "left"] for row in result["policies"].values())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--futures", "7"), "--futures must be an even number from 2 to 4096, got 7"),
        (("--futures", "1e12"), "--futures must be an even number"),
        (("--decisions", "0"), "--decisions must be at least 1"),
        (("--policies", "static_array:200"), "steers no vehicle"),
    ],
)
def test_bad_options_are_named(tmp_path, options, message) -> None:
    done = run_eval("headroom", "--particles", "50", "--episodes", "2", *options, cwd=tmp_path)
    assert done.returncode == 2 and message in done.stderr
