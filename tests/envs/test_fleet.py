"""Three vehicles and two tagged fish through the batched core, with one belief for all and with one each."""

import numpy as np
import pytest

from tagtrack.envs.layout import OWN_FEATURES, features, mate_features, tag_features
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sim.modem import Modem, NoModem, PerfectModem
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.spaces import observation_space

WORLDS, VEHICLES, TAGS, PARTICLES = 4, 3, 2, 400
# Everybody hears every ping, so that the error depends on geometry alone.
CLEAR = {"water.reach": 400.0, "water.noisy_share": 0.0, "water.clear_hearing": 1.0}
# One vehicle runs at the fish, one passes it on either hand: bearings cross.
FORMATION = np.array([(1.0, 0.0), (0.6, 0.8), (0.6, -0.8)], np.float32)


def fleet(*, modem: Modem, threads: int = 1, **overrides: float) -> Simulation:
    scenario = Scenario(vehicles=VEHICLES, targets=TAGS, modem=modem)
    changes = {"belief.particles": PARTICLES, **CLEAR, **overrides}
    simulation = Simulation(with_overrides(scenario, changes), WORLDS, threads=threads)
    simulation.reset(seed=0)
    return simulation


def sail(simulation: Simulation, steps: int) -> np.ndarray:
    """Sail in formation; (steps, B, O, T) errors [m]."""
    actions = np.broadcast_to(FORMATION, (WORLDS, VEHICLES, 2))
    errors = []
    for _ in range(steps):
        simulation.step(actions)
        errors.append(simulation.error.copy())
    return np.stack(errors)


@pytest.mark.parametrize(("modem", "owners"), [(PerfectModem(), 1), (NoModem(), VEHICLES)])
def test_every_array_has_the_axes_worlds_vehicles_owners_tags(modem: Modem, owners: int) -> None:
    simulation = fleet(modem=modem)
    sail(simulation, 5)
    scenario = simulation.scenario
    size = TAGS * len(tag_features(scenario)) + (VEHICLES - 1) * len(mate_features(scenario)) + len(OWN_FEATURES)
    assert simulation.observation.shape == (WORLDS, VEHICLES, size) and len(features(simulation.scenario)) == size
    assert simulation.reward.shape == (WORLDS, VEHICLES)
    assert simulation.error.shape == (WORLDS, owners, TAGS)
    assert simulation.range.shape == simulation.detected.shape == (WORLDS, VEHICLES, TAGS)
    assert simulation.mean.shape == simulation.estimate.shape == (WORLDS, owners, TAGS, 2)
    assert simulation.covariance.shape == (WORLDS, owners, TAGS, 2, 2)
    assert simulation.fish_position.shape == (WORLDS, TAGS, 2)
    assert simulation.vehicle_position.shape == (WORLDS, VEHICLES, 2)


@pytest.mark.parametrize("modem", [PerfectModem(), NoModem()])
def test_observations_and_rewards_stay_finite_and_in_bounds(modem: Modem) -> None:
    simulation = fleet(modem=modem)
    space = observation_space(simulation.scenario)
    for _ in range(20):
        sail(simulation, 5)
        assert all(simulation.observation[b, v] in space for b in range(WORLDS) for v in range(VEHICLES))
        assert np.isfinite(simulation.reward).all() and np.isfinite(simulation.covariance).all()


def test_beliefs_of_their_own_differ_and_a_shared_one_is_seen_by_all() -> None:
    own, shared = fleet(modem=NoModem()), fleet(modem=PerfectModem())
    sail(own, 30)
    sail(shared, 30)
    for first, second in ((0, 1), (0, 2), (1, 2)):
        assert (own.mean[:, first] != own.mean[:, second]).any(axis=-1).all()
    distance = np.hypot(*np.moveaxis(shared.mean[:, 0, 0] - shared.vehicle_position[:, 1], -1, 0))
    seen = shared.observation[:, 1, 0] * shared.scenario.scale.length
    np.testing.assert_allclose(seen, distance, atol=10.0)  # dead reckoning errs by metres


def test_errors_fall_when_all_hear() -> None:
    """Before the first ping the mean lies about the vehicles, 20 to 100 m from the fish; a quarter of that is left at most.

    Crossed bearings do better (a ninth), until the vehicles, which all sail at tag 0, have left tag 1 behind.
    """
    simulation = fleet(modem=PerfectModem())
    before = simulation.error.copy()
    after = sail(simulation, 120)[60:]
    assert before.mean() > 40.0
    assert after.mean() < before.mean() / 4


def test_sharing_what_is_heard_beats_keeping_it() -> None:
    shared, own = sail(fleet(modem=PerfectModem()), 120), sail(fleet(modem=NoModem()), 120)
    assert shared[40:].mean() < own[40:].mean()


def test_vehicles_hear_the_tags_one_by_one() -> None:
    simulation = fleet(modem=NoModem(), **{"water.clear_hearing": 0.7})
    patterns = set()
    for _ in range(30):
        sail(simulation, 1)
        patterns |= {tuple(detected.ravel().tolist()) for detected in simulation.detected}
    assert len(patterns) > 20


def test_fleet_is_the_same_on_any_number_of_threads() -> None:
    one, three = fleet(modem=NoModem()), fleet(modem=NoModem(), threads=3)
    np.testing.assert_array_equal(sail(one, 40), sail(three, 40))
    np.testing.assert_array_equal(one.observation, three.observation)
    three.close()
