"""One world gives the same numbers bit for bit: alone, in a batch, on any number of threads, after saving and loading."""

import pickle
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.parallel import TagTrackParallelEnv
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import TagTrackEnv
from tagtrack.envs.vector import TagTrackVectorEnv
from tests.tasks import LONE

LIMIT = 30
STEPS = 2 * LIMIT + 10  # two whole episodes and the beginning of a third
SEED = 40
OVERRIDES = {"episode_steps": LIMIT, "water.noisy_share": 0.2}
STANDOFF = "TagTrack/LeopardSharkStandoff-v0"


def actions_of(world: int, size: int) -> np.ndarray:
    return np.random.default_rng(world).uniform(-1.0, 1.0, (STEPS, size)).astype(np.float32)


def run_alone(env_id: str, world: int, particles: int) -> list[np.ndarray]:
    """Observation, then reward, error and truth after each step, of the single environment with the world's seed."""
    env = TagTrackEnv(env_id, particles=particles, overrides=OVERRIDES)
    rows = [np.append(env.reset(seed=SEED + world)[0].astype(float), [0.0, 0.0, 0.0])]
    for action in actions_of(world, env.action_space.shape[0]):
        observation, reward, _, truncated, info = env.step(action)
        rows.append(np.append(observation.astype(float), [reward, info["localization_error"], info["range"]]))
        if truncated:
            rows.append(np.append(env.reset()[0].astype(float), [0.0, 0.0, 0.0]))
    return rows


def run_together(env_id: str, num_envs: int, threads: int, particles: int) -> list[list[np.ndarray]]:
    """The same for each world of a batch."""
    env = TagTrackVectorEnv(
        env_id, num_envs, threads=threads, autoreset_mode="SameStep", particles=particles, overrides=OVERRIDES
    )
    first = env.reset(seed=SEED)[0]
    rows = [[np.append(first[i].astype(float), [0.0, 0.0, 0.0])] for i in range(num_envs)]
    actions = np.stack([actions_of(i, env.single_action_space.shape[0]) for i in range(num_envs)], axis=1)
    for action in actions:
        observation, reward, _, truncated, info = env.step(action)
        for i in range(num_envs):
            seen, told = observation[i], info
            if truncated[i]:
                seen, told = info["final_obs"][i], info["final_info"]
            rows[i].append(np.append(seen.astype(float), [reward[i], told["localization_error"][i], told["range"][i]]))
            if truncated[i]:
                rows[i].append(np.append(observation[i].astype(float), [0.0, 0.0, 0.0]))
    env.close()
    return rows


@pytest.mark.parametrize(("num_envs", "threads"), [(1, 1), (2, 2), (7, 1), (7, 2), (7, 3), (20, 2)])
@pytest.mark.parametrize("env_id", LONE)
def test_row_of_a_batch_equals_the_single_environment_bit_for_bit(env_id: str, num_envs: int, threads: int) -> None:
    rows = run_together(env_id, num_envs, threads, particles=100)
    for world in {0, num_envs // 2, num_envs - 1}:
        np.testing.assert_array_equal(rows[world], run_alone(env_id, world, particles=100))


@pytest.mark.parametrize("particles", [1, 31, 1000])
def test_equality_holds_for_any_number_of_particles(particles: int) -> None:
    rows = run_together(STANDOFF, 3, 2, particles)
    np.testing.assert_array_equal(rows[2], run_alone(STANDOFF, 2, particles))


def test_returned_arrays_are_never_written_over() -> None:
    env = TagTrackVectorEnv(num_envs=4, autoreset_mode="SameStep", particles=50, overrides=OVERRIDES)
    kept: list[tuple[Any, Any]] = []

    def keep(value: Any) -> None:
        if isinstance(value, dict):
            for part in value.values():
                keep(part)
        else:
            kept.append((value, [None if v is None else np.copy(v) for v in value]))

    for value in env.reset(seed=0):
        keep(value)
    actions = np.stack([actions_of(i, 2) for i in range(4)], axis=1)
    for action in actions[: LIMIT + 5]:
        for value in env.step(action):
            keep(value)
    env.reset()
    for value, copy in kept:
        for now, then in zip(value, copy, strict=True):
            np.testing.assert_array_equal(now, then)


def test_actions_are_never_written_to() -> None:
    env = TagTrackVectorEnv(num_envs=2, particles=20)
    env.reset(seed=0)
    actions = np.full((2, 2), 3.0, np.float32)
    actions.flags.writeable = False
    env.step(actions)
    assert (actions == 3.0).all()


def simulate(simulation: Simulation, first: int, last: int) -> list[np.ndarray]:
    rows = []
    for action in np.stack([actions_of(i, 2) for i in range(simulation.num_worlds)], axis=1)[first:last]:
        simulation.step(action[:, np.newaxis])
        rows.append(np.concatenate([simulation.observation.ravel(), simulation.error.ravel(), simulation.reward.ravel()]))
    return rows


def test_loaded_state_goes_on_as_the_saved_one_did() -> None:
    scenario = with_overrides(Scenario(), {**OVERRIDES, "belief.particles": 80})
    simulation = Simulation(scenario, 3)
    simulation.reset(seed=SEED)
    simulate(simulation, 0, 12)
    state = simulation.save_state()
    expected = simulate(simulation, 12, 40)
    simulation.reset()
    simulation.load_state(state)
    np.testing.assert_array_equal(simulate(simulation, 12, 40), expected)
    other = Simulation(scenario, 3, threads=2)
    other.load_state(state)
    np.testing.assert_array_equal(simulate(other, 12, 40), expected)
    other.close()


def test_saved_state_does_not_change_with_the_simulation() -> None:
    simulation = Simulation(with_overrides(Scenario(), {"belief.particles": 20}))
    simulation.reset(seed=SEED)
    state = simulation.save_state()
    before = [array.copy() for array in state]
    simulate(simulation, 0, 5)
    for array, copy in zip(state, before, strict=True):
        assert array.tobytes() == copy.tobytes()


def test_fish_swims_the_same_whatever_the_vehicle_does() -> None:
    simulation = Simulation(with_overrides(Scenario(), {"belief.particles": 20}), 2)
    tracks = []
    for course in ((1.0, 0.0), (0.0, 1.0)):
        simulation.reset(seed=[SEED, SEED])
        places = []
        for _ in range(50):
            simulation.step(np.full((2, 1, 2), course, np.float32))
            places.append(simulation.fish_position.copy())
        tracks.append(places)
    np.testing.assert_array_equal(tracks[0], tracks[1])


FLEET = {"vehicles": 2, "tags": 2, "modem": "tdma", "particles": 50, "overrides": OVERRIDES}


def fleet_under_way() -> TagTrackParallelEnv:
    env = TagTrackParallelEnv(**FLEET)
    env.reset(seed=SEED)
    for _ in range(8):
        env.step(ahead(env))
    return env


def ahead(env: TagTrackParallelEnv) -> dict[str, np.ndarray]:
    return {agent: np.array([1.0, 0.5], np.float32) for agent in env.agents}


@pytest.mark.parametrize("take", [deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_copy_of_an_environment_goes_on_where_it_was_and_by_itself(take: Callable[[Any], TagTrackParallelEnv]) -> None:
    env = fleet_under_way()
    twin = take(env)
    for _ in range(LIMIT - 8):
        told, expected = twin.step(ahead(twin)), env.step(ahead(env))
        for agent in expected[0]:
            np.testing.assert_array_equal(told[0][agent], expected[0][agent])
        assert told[1:4] == expected[1:4]
        np.testing.assert_equal(told[4], expected[4])


def test_pickle_goes_on_in_another_process(tmp_path: Path, run_python: Callable[..., str]) -> None:
    """Addresses of compiled functions differ there."""
    env = fleet_under_way()
    (tmp_path / "env.pickle").write_bytes(pickle.dumps(env))
    code = """
import pickle, sys
from pathlib import Path
import numpy as np
env = pickle.loads(Path(sys.argv[1]).read_bytes())
for _ in range(10):
    told = env.step({agent: np.array([1.0, 0.5], np.float32) for agent in env.agents})
print([float(error).hex() for error in env.simulation.error.ravel()])
"""
    printed = run_python(code, str(tmp_path / "env.pickle"))
    for _ in range(10):
        env.step(ahead(env))
    assert printed.strip() == str([float(error).hex() for error in env.simulation.error.ravel()])
