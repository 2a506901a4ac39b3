"""Noise is keyed by vehicle and tag: one more of them changes nothing for the others.

Vehicles begin at one place and steer by their own heading, so that nothing but the draws could tell the fleets apart.
"""

from dataclasses import replace

import numpy as np
import pytest

from tagtrack.envs.scenario import SCENARIOS, Formation, Frame, Scenario
from tagtrack.envs.sim.modem import NoModem
from tagtrack.envs.simulation import Simulation

WORLDS, STEPS = 3, 40
IDS = ["TagTrack/LeopardShark-v0", "TagTrack/TimeOfFlight-v0", "TagTrack/RangeOnly-v0", "TagTrack/AreaOnlyUnknownRange-v0"]


def together(env_id: str, vehicles: int, targets: int, **changes: object) -> Scenario:
    """A fleet of own beliefs, all vehicles at the origin at first."""
    scenario = SCENARIOS[env_id]
    return replace(
        scenario,
        vehicles=vehicles,
        targets=targets,
        modem=NoModem(),
        steer_by=Frame.HEADING,
        start=replace(scenario.start, formation=Formation.RING, separation=0.0),
        vehicle=replace(scenario.vehicle, random_current=0.2, compass_bias=0.01, heading_sigma=0.02, speed_sigma=0.02),
        belief=replace(scenario.belief, particles=60),
        **changes,
    )


def sail(scenario: Scenario, threads: int = 1) -> dict[str, list[bytes]]:
    """What becomes of vehicle 0, tag 0 and of what that vehicle hears of that tag and believes of it, step by step."""
    simulation = Simulation(scenario, WORLDS, threads=threads)
    simulation.reset(seed=13)
    courses = np.random.default_rng(0).uniform(-1.0, 1.0, (STEPS, WORLDS, 8, 2)).astype(np.float32)
    seen: dict[str, list[bytes]] = {}
    for course in courses:
        worlds = simulation.worlds
        arrays = {
            "vehicle": worlds.vehicles[:, 0],
            "navigation": worlds.navigation[:, 0],
            "tag": worlds.targets[:, 0],
            "fish": worlds.fish[:, 0],
            "encounter": worlds.encounters[:, 0, 0],
            "measurement": worlds.measurements[:, 0, 0],
            "listener": simulation.listeners[:, 0, 0],
            "particles": worlds.particles[:, 0, 0],
            "belief": worlds.beliefs[:, 0, 0],
        }
        for name, array in arrays.items():
            seen.setdefault(name, []).append(array.tobytes())
        simulation.step(course[:, : scenario.vehicles])
    simulation.close()
    return seen


@pytest.mark.parametrize(("vehicles", "targets"), [(2, 1), (5, 1), (1, 2), (1, 7), (3, 2)])
@pytest.mark.parametrize("env_id", IDS)
def test_one_more_vehicle_or_tag_changes_nothing_for_the_others(env_id: str, vehicles: int, targets: int) -> None:
    """Neither pings, fish, water and readings nor a belief of one's own, bit for bit."""
    alone, among = sail(together(env_id, 1, 1)), sail(together(env_id, vehicles, targets))
    for name in alone:
        assert alone[name] == among[name], name


@pytest.mark.parametrize("env_id", IDS)
def test_pairs_draw_for_themselves(env_id: str) -> None:
    """Vehicles that lie and steer alike hear one fish with noise of their own: no two readings and no two clouds are the same."""
    simulation = Simulation(together(env_id, 3, 2), 20)
    simulation.reset(seed=1)
    for _ in range(10):
        simulation.step(np.zeros((20, 3, 2), np.float32))
    beliefs = simulation.worlds.beliefs
    pairs = [(v, t) for v in range(3) for t in range(2)]
    for k, one in enumerate(pairs):
        for other in pairs[:k]:
            assert (beliefs["mean_x"][:, one[0], one[1]] != beliefs["mean_x"][:, other[0], other[1]]).all()
            assert (simulation.worlds.navigation["x"][:, one[0]] != simulation.worlds.navigation["x"][:, other[0]]).all() or (
                one[0] == other[0]
            )


def test_tags_ping_and_swim_apart() -> None:
    simulation = Simulation(together(IDS[0], 1, 3), 50)
    simulation.reset(seed=2)
    first = simulation.worlds.targets["first_ping"]
    assert all(len(set(row)) == 3 for row in first.tolist())
    assert np.abs(np.corrcoef(first.T) - np.eye(3)).max() < 4.0 / np.sqrt(50)
