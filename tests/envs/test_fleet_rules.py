"""What ends a vehicle's part, keeps it within bounds, spoils a ping and is worth a reward in a fleet."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tagtrack.envs.layout import feature_names, split_observation
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sim.modem import NoModem
from tagtrack.envs.simulation import Simulation

CLEAR = {"water.reach": 400.0, "water.noisy_share": 0.0, "water.clear_hearing": 1.0, "belief.particles": 50}


def begin(vehicles: int = 1, tags: int = 1, worlds: int = 1, base: Scenario | None = None, **overrides: object) -> Simulation:
    scenario = replace(base or Scenario(), vehicles=vehicles, targets=tags)
    simulation = Simulation(with_overrides(scenario, {**CLEAR, **overrides}), worlds)
    simulation.reset(seed=3)
    return simulation


def hold(simulation: Simulation, steps: int, action: tuple[float, ...] = (1.0, 0.0)) -> None:
    for _ in range(steps):
        simulation.step(np.broadcast_to(np.float32(action), simulation._actions.shape))


# Batteries.


def test_battery_ends_a_vehicles_part_after_the_hours_that_its_power_says() -> None:
    """60 W at full speed, 1 Wh: a minute, and a little more for the start, when the propeller draws less."""
    simulation = begin(vehicles=2, **{"vehicle.battery": 1.0, "vehicle.battery_spread": 0.0})
    active = []
    for _ in range(40):
        hold(simulation, 1)
        active.append(simulation.worlds.navigation["active"][0].tolist())
    lasted = active.index([False, False]) + 1
    assert 30 <= lasted <= 33
    assert not any(any(each) for each in active[lasted - 1 :])


def test_vehicle_at_rest_lasts_three_times_as_long() -> None:
    simulation = begin(speed_control=True, **{"vehicle.battery": 1.0})
    hold(simulation, 89, (1.0, 0.0, -1.0))
    assert simulation.worlds.navigation["active"][0, 0] and simulation.worlds.navigation["battery"][0, 0] == pytest.approx(1 / 90)
    hold(simulation, 1, (1.0, 0.0, -1.0))
    assert not simulation.worlds.navigation["active"][0, 0]


def test_vehicle_that_has_left_neither_moves_nor_hears_nor_earns_and_the_others_go_on() -> None:
    simulation = begin(vehicles=3, worlds=8, **{"vehicle.battery": 2.0, "vehicle.battery_spread": 0.5, "modem": "none"})
    left, seen = None, False
    for _ in range(100):
        before = simulation.vehicle_position.copy()
        hold(simulation, 1)
        if left is not None:
            gone = left & ~simulation.worlds.navigation["active"]
            assert (simulation.vehicle_position == before)[gone].all()
            assert not simulation.detected[gone].any() and (simulation.reward[gone] == 0.0).all()
            assert (simulation.observation[gone] == 0.0).all()
            going_on = simulation.worlds.navigation["active"]
            assert (simulation.reward[going_on] < 0.0).all()
            seen |= bool(gone.any() and (going_on.any(axis=1) & gone.any(axis=1)).any())
        left = ~simulation.worlds.navigation["active"]
    assert seen


def test_teammates_of_a_fusion_centre_see_that_a_vehicle_has_left() -> None:
    simulation = begin(vehicles=3, worlds=4, **{"vehicle.battery": 2.0, "vehicle.battery_spread": 0.5})
    for _ in range(80):
        hold(simulation, 1)
        active = simulation.worlds.navigation["active"]
        parts = split_observation(simulation.observation, simulation.scenario)
        for v in range(3):
            others = np.delete(active, v, axis=1)
            here = active[:, v]
            np.testing.assert_array_equal(parts["mate_mask"][here, v], others[here])
    assert not active.all()


# Pings that overlap.


def heard_share(tags: int, burst: float, base: str = "LeopardShark-v0", **overrides: object) -> float:
    changes = {"tag.burst": burst, **overrides}
    simulation = begin(tags=tags, worlds=200, base=SCENARIOS[f"TagTrack/{base}"], **changes)
    heard = pinged = 0
    for _ in range(60):
        hold(simulation, 1)
        heard += int(simulation.worlds.encounters["heard"].sum())
        pinged += int(simulation.worlds.targets["pinged"].sum())
    return heard / pinged


def test_transmissions_that_overlap_destroy_each_other() -> None:
    """Two tags of a fixed period, phases at random: 2 * 0.3 / 2 of the pairs overlap for ever, 0.3 of 200; four s.e.: 0.13."""
    assert heard_share(1, 0.3) == pytest.approx(1.0, abs=0.01)
    assert heard_share(2, 0.0) == pytest.approx(1.0, abs=0.01)
    assert heard_share(2, 0.3) == pytest.approx(0.7, abs=0.13)
    assert heard_share(2, 1.0) == pytest.approx(0.0, abs=0.01)


def test_random_delays_keep_two_tags_from_colliding_for_ever() -> None:
    """Pings of 3 s every 60 to 90 s: of another tag one falls within 3 s before or after with a chance of 6 / 75."""
    water = {"water.reach": 9000.0, "receiver.reception": 1.0, "receiver.reception_spread": 0.0}
    water |= {"receiver.max_range": 4000.0, "belief.receiver.max_range": 4000.0}
    alone = heard_share(1, 3.0, "AreaOnly-v0", **water)
    assert heard_share(2, 3.0, "AreaOnly-v0", **water) == pytest.approx(alone * (1 - 6 / 75), abs=0.012)


def test_tag_out_of_hearing_destroys_nothing() -> None:
    simulation = begin(tags=2, worlds=50, **{"tag.burst": 0.9, "water.reach": 60.0, "water.edge_width": 0.5})
    simulation.worlds.fish[:, 1, 0] += 5000.0
    heard = pinged = 0
    for _ in range(10):
        hold(simulation, 1)
        heard += int(simulation.worlds.encounters["heard"][:, 0, 0].sum())
        pinged += int(simulation.worlds.targets["pinged"][:, 0].sum())
    assert heard > 0.8 * pinged


# Arena, separation, rewards.


def test_vehicle_turns_back_at_the_border_of_its_arena() -> None:
    simulation = begin(worlds=20, **{"vehicle.arena": 100.0, "steer_by": "heading"})
    far = []
    for _ in range(250):
        hold(simulation, 1)
        far.append(np.hypot(*np.moveaxis(simulation.vehicle_position[:, 0], -1, 0)))
    assert np.max(far) < 100.0 + 30.0  # a turn and the error of navigation
    assert np.min(np.max(far, axis=0)) > 95.0  # who sails straight on comes there
    border = simulation.observation[:, 0, feature_names(simulation.scenario).index("border")]
    np.testing.assert_allclose(border, np.array(far[-1]) / 100.0, atol=0.1)


def test_coming_too_near_counts_once_each_time_and_costs_by_its_share() -> None:
    simulation = begin(vehicles=2, **{"reward.separation": 2.0, "reward.least_separation": 15.0, "start.separation": 30.0})
    worlds, near = simulation.worlds, 0
    for apart in (30.0, 12.0, 9.0, 20.0, 14.0):
        worlds.vehicles["x"][0] = (0.0, apart)
        worlds.vehicles["y"][0] = 0.0
        worlds.vehicles["speed"][0] = 0.0
        hold(simulation, 1)
        outcome = simulation.outputs.outcomes[0]
        expected = -2.0 * max(0.0, 1.0 - outcome["separation"][0] / 15.0)
        np.testing.assert_allclose(simulation.reward_terms["separation"][0], expected)
        near = int(outcome["encroachments"][0])
    assert near == 2 and outcome["encroachments"][1] == 2


def test_reward_is_of_the_mean_or_the_worst_tag_and_own_or_shared() -> None:
    mean, worst, shared = (
        begin(vehicles=3, tags=2, **{"modem": "none", **changes})
        for changes in ({}, {"reward.over_tags": "worst"}, {"reward.shared": True})
    )
    for simulation in (mean, worst, shared):
        hold(simulation, 20)
    error = mean.error[0]  # (O, T)
    np.testing.assert_allclose(mean.reward_terms["localization"][0], -np.minimum(error.mean(axis=1), 100.0) / 100.0)
    np.testing.assert_allclose(worst.reward_terms["localization"][0], -np.minimum(error.max(axis=1), 100.0) / 100.0)
    np.testing.assert_allclose(shared.reward[0], mean.reward[0].mean())


def test_course_may_be_relative_to_a_tag_that_the_action_chooses() -> None:
    simulation = begin(tags=3, steer_by="chosen")
    assert simulation.action_names == ("ahead", "port", "tag_0", "tag_1", "tag_2")
    hold(simulation, 10, (1.0, 0.0, 0.0, 0.0, 1.0))
    for tag in range(3):
        choice = [0.0, 0.0, 0.0]
        choice[tag] = 1.0
        before = simulation.worlds.navigation[0, 0].copy()
        away = simulation.estimate[0, 0, tag] - (before["x"], before["y"])
        hold(simulation, 1, (1.0, 0.0, *choice))
        course = float(simulation.worlds.vehicles["course"][0, 0])
        assert math.cos(course - math.atan2(away[1], away[0])) == pytest.approx(1.0, abs=1e-9)


def test_one_more_vehicle_that_says_nothing_changes_nothing_for_the_others() -> None:
    """Tag rows and own row of vehicle 0 are the same to the last bit, whoever else is there."""
    place = {"start.separation": 0.0, "steer_by": "heading"}
    one, three = (
        begin(vehicles=v, tags=2, worlds=4, base=replace(Scenario(), modem=NoModem()), **place) for v in (1, 3)
    )
    size = len(split_observation(one.observation, one.scenario)["tags"][0, 0, 0])
    for _ in range(40):
        hold(one, 1, (0.6, 0.8))
        hold(three, 1, (0.6, 0.8))
        first, second = (split_observation(each.observation[:, 0], each.scenario) for each in (one, three))
        assert first["own"].tobytes() == second["own"].tobytes()
        assert first["tags"].tobytes() == second["tags"][..., :size].tobytes()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"vehicle.battery": -1.0}, "Vehicle.battery must be at least 0, got -1.0"),
        ({"vehicle.battery_spread": 1.0}, "Vehicle.battery_spread must be at least 0 and below 1, got 1.0"),
        ({"vehicle.arena": -5.0}, "Vehicle.arena must be at least 0, got -5.0"),
        ({"tag.burst": 2.0}, r"Tag.burst must be at least 0 and below the period \(2.0 s\), got 2.0"),
        ({"reward.over_tags": "best"}, "reward.over_tags must be one of mean, worst, got 'best'"),
        ({"reward.message": -0.1}, "Reward.message must be at least 0, got -0.1"),
    ],
)
def test_rules_that_cannot_be_are_named(changes: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        with_overrides(Scenario(), changes)
