"""What a belief knows passes through measurements: spoil the truth behind its back, and it believes, sees and steers the same.

Between the two halves of a step all that is true alone (``world.TRUTH``) is overwritten, and put back after the second half. One
number that belief or observation took from it would show in the last bit, there or in the course of the next action.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tagtrack.envs.exchange import exchange_worlds
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sim.modem import NoModem, TdmaModem
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.world import believe_worlds, sense_worlds
from tagtrack.envs.world_state import TRUTH

WORLDS, STEPS = 3, 12
FLEET = Scenario(vehicles=3, targets=2)
RANGING_FLEET = replace(SCENARIOS["TagTrack/RangeOnly-v0"], vehicles=3, targets=2)
TASKS = {
    **SCENARIOS,
    "fleet of one belief": FLEET,
    "fleet of own beliefs": replace(FLEET, modem=NoModem()),
    "ranging fleet of one belief": RANGING_FLEET,
    "ranging fleet that talks": replace(RANGING_FLEET, modem=TdmaModem(slot=5.0, loss=0.3)),
}


def begin(scenario: Scenario) -> Simulation:
    simulation = Simulation(replace(scenario, belief=replace(scenario.belief, particles=100)), WORLDS)
    simulation.reset(seed=4)
    return simulation


def actions_of(simulation: Simulation) -> np.ndarray:
    """(STEPS, B, V, A) random actions, the same for all simulations of a shape."""
    shape = (STEPS, WORLDS, simulation.scenario.vehicles, len(simulation.action_names))
    return np.random.default_rng(8).uniform(-1.0, 1.0, shape).astype(np.float32)


def fill_with(value: float) -> Callable[[np.ndarray], None]:
    """A function that overwrites an array of numbers or records: flags are turned, whole numbers moved."""

    def spoil(array: np.ndarray) -> None:
        if array.dtype.names is not None:
            for name in array.dtype.names:
                spoil(array[name])
        elif array.dtype == np.bool_:
            array[...] = ~array
        elif array.dtype.kind in "iu":
            array += 3
        else:
            array[...] = value

    return spoil


def spoil_truth(simulation: Simulation, spoil: Callable[[np.ndarray], None]) -> dict[str, np.ndarray]:
    """Overwrite the truth; returns what it was."""
    kept = {name: getattr(simulation.worlds, name).copy() for name in TRUTH}
    for name in TRUTH:
        spoil(getattr(simulation.worlds, name))
        assert kept[name].size == 0 or getattr(simulation.worlds, name).tobytes() != kept[name].tobytes()
    return kept


def restore(simulation: Simulation, kept: dict[str, np.ndarray]) -> None:
    for name, array in kept.items():
        np.copyto(getattr(simulation.worlds, name), array)


def sense(simulation: Simulation, actions: np.ndarray) -> None:
    """The first half of a step."""
    simulation._actions[...] = actions
    if simulation._exchange_worlds is not None:
        exchange_worlds(0, WORLDS, *simulation._exchange_arguments, simulation._workers.scratch[0])
    sense_worlds(0, WORLDS, *simulation._step_arguments, simulation._workers.scratch[0])


def believe(simulation: Simulation) -> None:
    """The second half but for the referee."""
    parameters, _, _, worlds, outputs = simulation._step_arguments
    believe_worlds(0, WORLDS, parameters, worlds, outputs, simulation._workers.scratch[0])


def assert_same(one: Simulation, other: Simulation) -> None:
    """All that belief and observation hold, and the world, bit for bit."""
    for name in one.worlds._fields:
        assert getattr(one.worlds, name).tobytes() == getattr(other.worlds, name).tobytes(), name
    assert one.observation.tobytes() == other.observation.tobytes()


@pytest.mark.parametrize("value", [np.nan, 1e6])
@pytest.mark.parametrize("name", TASKS)
def test_belief_and_observation_are_the_same_whatever_the_truth_is_behind_the_wall(name: str, value: float) -> None:
    untouched, spoilt = begin(TASKS[name]), begin(TASKS[name])
    for actions in actions_of(untouched):
        untouched.step(actions)
        sense(spoilt, actions)
        kept = spoil_truth(spoilt, fill_with(value))
        believe(spoilt)
        restore(spoilt, kept)
        assert_same(untouched, spoilt)
    assert untouched.detected.any() or untouched.listeners["heard_long"].max() != 0.5


@pytest.mark.parametrize("name", TASKS)
def test_course_of_an_action_is_the_same_whatever_the_truth_is(name: str) -> None:
    """A course is chosen by navigation and belief; only then does the true vehicle turn."""
    simulation = begin(TASKS[name])
    for actions in actions_of(simulation):
        state = simulation.save_state()
        spoil_truth(simulation, fill_with(np.nan))
        sense(simulation, actions)
        blind = simulation.worlds.vehicles["course"].copy()
        simulation.load_state(state)
        simulation.step(actions)
        np.testing.assert_array_equal(blind, simulation.worlds.vehicles["course"])
        assert np.isfinite(blind).all()


@pytest.mark.parametrize("name", ["navigation", "measurements"])
def test_what_does_pass_through_the_wall_shows(name: str) -> None:
    """The comparison can fail: spoil what the belief is given, and it is another one."""
    untouched, spoilt = begin(SCENARIOS["TagTrack/RangeOnly-v0"]), begin(SCENARIOS["TagTrack/RangeOnly-v0"])
    for actions in actions_of(untouched):
        untouched.step(actions)
        sense(spoilt, actions)
        getattr(spoilt.worlds, name)["x"] += 1.0
        believe(spoilt)
    with pytest.raises(AssertionError):
        assert_same(untouched, spoilt)
    assert (untouched.observation != spoilt.observation).any()


def test_truth_is_all_that_neither_navigation_nor_a_measurement_nor_the_belief_is() -> None:
    """A new array of a world must be put on one side."""
    own = {"navigation", "measurements", "beliefs", "particles", "carried", "listeners", "outlooks"}
    talk = {"mates", "radios", "outbox", "packets", "letters", "mail", "since"}
    past = {"past_particles", "past_carried", "past_beliefs", "past_listeners", "past_measurements", "past_poses"}
    assert set(begin(FLEET).worlds._fields) == {"clock", *TRUTH, *own, *talk, *past}
