"""Fleets that talk: what packets hold, when they come, and that a belief told late is the belief told in time."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.layout import feature_names
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sim.modem import InstantModem, NoModem, PerfectModem, TdmaModem
from tagtrack.envs.simulation import Simulation

RANGING = SCENARIOS["TagTrack/RangeOnly-v0"]


def fleet(base: Scenario = RANGING, modem: object = None, vehicles: int = 3, tags: int = 2, **overrides: object) -> Scenario:
    scenario = replace(base, vehicles=vehicles, targets=tags, modem=modem or TdmaModem(loss=0.0, loss_at_range=0.0))
    return with_overrides(scenario, {"belief.particles": 80, **overrides})


def sail(simulation: Simulation, steps: int, seed: int = 0) -> np.ndarray:
    """Random courses; (steps, B, O, T) errors [m]."""
    rng, errors = np.random.default_rng(seed), []
    for _ in range(steps):
        simulation.step(rng.uniform(-1, 1, simulation._actions.shape).astype(np.float32))
        errors.append(simulation.error.copy())
    return np.stack(errors)


def letters_that_came(simulation: Simulation, owner: int) -> list[np.ndarray]:
    """Measurements that the owner has got from others in this step."""
    worlds, found = simulation.worlds, []
    for v, place in enumerate(worlds.mail[0, owner] - 1):
        if place >= 0:
            found += list(worlds.letters[0, v, place, : worlds.packets["count"][0, v, place]].copy())
    return found


@pytest.mark.parametrize("loss", [0.0, 0.5])
@pytest.mark.parametrize("env_id", ["RangeOnly-v0", "LeopardShark-v0", "TimeOfFlight-v0", "AreaOnly-v0"])
def test_belief_told_late_is_the_belief_told_in_time_bit_for_bit(env_id: str, loss: float) -> None:
    """A filter that is given everything at the time it was measured, once all of it is known, ends at the same particles."""
    base = SCENARIOS[f"TagTrack/{env_id}"]
    scenario = fleet(base, TdmaModem(slot=1.7 * base.time_step, loss=loss, loss_at_range=loss, packet_bytes=64, memory=1e3))
    simulation = Simulation(scenario)
    simulation.reset(seed=11)
    start = simulation.worlds.navigation[0, 0].copy()
    told: dict[int, list[np.ndarray]] = {}
    rng = np.random.default_rng(3)
    for step in range(1, 41):
        simulation.step(rng.uniform(-1, 1, (1, 3, 2)).astype(np.float32))
        told.setdefault(step, []).extend(simulation.worlds.measurements[0, 0].copy())
        for letter in letters_that_came(simulation, 0):
            made = round(letter["time"] / scenario.time_step)
            assert made < step
            told[made].append(letter)
    assert sum(record["vehicle"] != 0 for records in told.values() for record in records) > 4
    belief = ParticleFilter(scenario.belief, scenario.tag, rows=2, vehicles=3, tags=[0, 1])
    belief.begin(start["x"], start["y"], seed=[11, 11], place=[0, 1])
    for records in told.values():
        belief.predict(scenario.time_step)
        belief.correct(np.array(records))
    assert belief.particles.tobytes() == simulation.worlds.particles[0, 0].tobytes()


def test_packets_leave_in_turn_and_hold_the_newest_measurements() -> None:
    simulation = Simulation(fleet(modem=TdmaModem(slot=10.0, loss=0.0, loss_at_range=0.0), tags=4))
    simulation.reset(seed=0)
    senders = []
    for _ in range(9):
        sail(simulation, 1)
        senders += np.flatnonzero(simulation.worlds.radios["sent_now"][0]).tolist()
        for v in senders[-1:]:
            place = (simulation.worlds.radios["next"][0, v] - 1) % simulation.worlds.packets.shape[2]
            packet, letters = simulation.worlds.packets[0, v, place], simulation.worlds.letters[0, v, place]
            assert packet["count"] <= 2 == letters.size  # (32 - 8) // (7 + 2)
            times = letters["time"][: packet["count"]]
            assert (np.diff(times) <= 0).all() and (times <= packet["time"]).all()
            assert (letters["vehicle"][: packet["count"]] == v).all()
    assert senders == [0, 1, 2, 0, 1, 2, 0, 1, 2]


def test_packets_travel_at_the_speed_of_sound_and_age_as_they_do() -> None:
    """Vehicles 1200 m apart and a step of 0.5 s: a packet comes in the second step after it left; its age is told."""
    modem = TdmaModem(slot=1.0, loss=0.0, loss_at_range=0.0)
    apart = {"start.separation": 1200.0, "time_step": 0.5}
    scenario = fleet(SCENARIOS["TagTrack/LeopardShark-v0"], modem, vehicles=2, tags=1, **apart)
    simulation = Simulation(scenario)
    simulation.reset(seed=0)
    came = []
    for _ in range(6):
        sail(simulation, 1)
        came.append(simulation.worlds.mail[0].copy() > 0)
    assert [np.argwhere(each).tolist() for each in came] == [[], [[1, 0]], [], [[0, 1]], [], [[1, 0]]]
    age = simulation.observation[0, 1, feature_names(scenario).index("mate_0.log_age")]
    assert np.expm1(2.0 * age) == pytest.approx(1.0, abs=1e-5)  # left with the pose of 2 s, and now it is 3 s


def test_no_packet_comes_from_beyond_the_largest_range_and_losses_grow_with_distance() -> None:
    def share(separation: float, **modem: float) -> float:
        apart = {"start.separation": separation, "vehicle.max_speed": 0.01}
        scenario = fleet(modem=TdmaModem(**modem), vehicles=2, tags=1, **apart)
        simulation = Simulation(scenario, 40)
        simulation.reset(seed=0)
        sail(simulation, 50)
        return float(simulation.worlds.radios["received"].sum() / simulation.worlds.radios["sent"].sum())

    assert share(1600.0) == 0.0
    # 0.1 + 0.4 (750 / 1500)^2 = 0.2 are lost; 2000 packets: a standard error of 0.009
    assert share(750.0) == pytest.approx(0.8, abs=0.04)
    assert share(750.0, loss=1.0, loss_at_range=1.0) == 0.0
    assert share(750.0, loss=0.0, loss_at_range=0.0) > 0.97  # but for the last one, on its way


def test_more_is_known_the_more_is_told() -> None:
    """Range-only tracking, three vehicles: silence, packets with half of them lost, packets, a fusion centre."""
    errors = []
    for modem in (NoModem(), TdmaModem(loss=0.5, loss_at_range=0.5), TdmaModem(loss=0.0, loss_at_range=0.0), PerfectModem()):
        simulation = Simulation(fleet(modem=modem, tags=1, **{"belief.particles": 300}), 60)
        simulation.reset(seed=5)
        errors.append(sail(simulation, 90)[30:].mean())
    assert errors[0] > errors[1] > errors[2] > 0.98 * errors[3]
    assert errors[3] < 0.7 * errors[0]


def test_total_silence_equals_having_no_modem() -> None:
    """Nothing breaks where every packet is lost: the beliefs are those of vehicles that never talk, bit for bit."""
    lost, none = (
        Simulation(fleet(modem=modem), 3)
        for modem in (TdmaModem(loss=1.0, loss_at_range=1.0), NoModem())
    )  # fmt: skip
    for simulation in (lost, none):
        simulation.reset(seed=2)
        sail(simulation, 60)
    assert lost.worlds.particles.tobytes() == none.worlds.particles.tobytes()
    assert lost.worlds.radios["received"].sum() == 0 and lost.worlds.radios["sent"].min() > 10


def test_row_of_a_batch_equals_a_batch_of_one_on_any_number_of_threads() -> None:
    scenario = fleet(modem=TdmaModem(slot=7.0, loss=0.2))
    batch, alone = Simulation(scenario, 5, threads=3), Simulation(scenario)
    batch.reset(seed=20)
    alone.reset(seed=23)
    rng = np.random.default_rng(0)
    for _ in range(40):
        actions = rng.uniform(-1, 1, (5, 3, 2)).astype(np.float32)
        batch.step(actions)
        alone.step(actions[3:4])
        assert batch.observation[3].tobytes() == alone.observation[0].tobytes()
    assert batch.worlds.particles[3].tobytes() == alone.worlds.particles[0].tobytes()
    batch.close()


def test_state_that_was_saved_goes_on_the_same_with_packets_on_their_way() -> None:
    simulation = Simulation(fleet(), 2)
    simulation.reset(seed=1)
    sail(simulation, 17)
    state = simulation.save_state()
    first = sail(simulation, 20, seed=4)
    simulation.load_state(state)
    np.testing.assert_array_equal(first, sail(simulation, 20, seed=4))


def test_vehicle_that_may_keep_silent_sends_only_when_it_wants_and_pays_for_it() -> None:
    scenario = with_overrides(fleet(tags=1), {"message_control": True, "reward.message": 0.05})
    simulation = Simulation(scenario, 2)
    simulation.reset(seed=0)
    assert simulation.action_names == ("ahead", "port", "message")
    quiet = np.zeros((2, 3, 3), np.float32)
    talk = quiet.copy()
    talk[:, 1, 2] = 1.0
    paid = np.zeros((2, 3))
    for actions in [quiet] * 9 + [talk] * 9:
        simulation.step(actions)
        paid += simulation.reward_terms["messages"]
        assert np.array_equal(simulation.reward_terms["messages"], -0.05 * simulation.worlds.radios["sent_now"])
    assert simulation.worlds.radios["sent"].tolist() == [[0, 3, 0]] * 2
    np.testing.assert_allclose(paid, [[0.0, -0.15, 0.0]] * 2)


def test_measurements_that_come_too_late_are_counted_not_used() -> None:
    simulation = Simulation(fleet(modem=TdmaModem(slot=60.0, loss=0.0, loss_at_range=0.0, memory=1.0, packet_bytes=320)), 1)
    simulation.reset(seed=0)
    sail(simulation, 60)
    assert simulation.worlds.radios["too_late"].sum() > 0


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"modem.slots": 2}, "TdmaModem.slots must be at least 3, the number of vehicles"),
        ({"modem.packet_bytes": 16}, r"packet_bytes must be at least 17: the pose \(8\) and one measurement of 1 readings"),
        ({"modem.loss": 1.5}, "TdmaModem.loss must be within 0 to 1, got 1.5"),
        ({"modem.slot": 1e-9}, "TdmaModem.slot must be at least 0.001 s, a 10000th of the time step"),
        ({"modem.slot": 0.0}, "TdmaModem.slot must be positive and at most 3600, got 0.0"),
        ({"modem.slots": 10**9}, "TdmaModem.slots must be a whole number from 0 to 1000, got 1000000000"),
        ({"modem.packet_bytes": 10**6}, "TdmaModem.packet_bytes must be a whole number from 1 to 10000"),
        ({"modem.largest_range": 5e5}, "TdmaModem.largest_range must be positive and at most 100000"),
        ({"modem": "smoke"}, "modem must be one of perfect, none, instant, tdma, or MODULE:CLASS"),
        ({"modem": "none", "message_control": True}, "Scenario.message_control is about messages, and a NoModem sends none"),
        ({"modem": "perfect", "reward.message": 0.1}, "Scenario.reward.message is about messages, and a PerfectModem sends none"),
    ],
)
def test_modems_that_cannot_be_are_named(changes: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        with_overrides(fleet(), changes)


def test_every_parameter_of_the_modem_is_read() -> None:
    """Change any of them, and something changes: none is ignored."""
    def trace(**changes: float) -> bytes:
        simulation = Simulation(fleet(modem=TdmaModem(**{"slot": 5.0, "packet_bytes": 50, **changes})), 2)
        simulation.reset(seed=3)
        sail(simulation, 60)
        return simulation.observation.tobytes() + simulation.worlds.particles.tobytes() + simulation.worlds.radios.tobytes()

    other = {
        "slot": 6.0, "slots": 5, "packet_bytes": 25, "pose_bytes": 40, "measurement_bytes": 20, "largest_range": 60.0,
        "loss": 0.6, "loss_at_range": 0.0, "sound_speed": 20.0, "pose_sigma": 5.0, "memory": 1.0,
    }  # fmt: skip
    assert set(other) == {field.name for field in dataclasses.fields(TdmaModem)}
    usual = trace()
    assert [name for name, value in other.items() if trace(**{name: value}) == usual] == []


def test_instant_modem_without_losses_gives_every_vehicle_what_a_fusion_centre_has() -> None:
    """The same measurements at the same time: three clouds with draws of their own, as good as the shared one."""
    errors = []
    instants = [InstantModem(loss=0.0), InstantModem(loss=0.0, pose_sigma=30.0), InstantModem(loss=1.0)]
    for modem in (PerfectModem(), *instants, NoModem()):
        simulation = Simulation(fleet(modem=modem, tags=1, **{"belief.particles": 300}), 60)
        simulation.reset(seed=5)
        errors.append(sail(simulation, 90)[30:].mean())
    perfect, instant, wrong, silent, none = errors
    assert instant == pytest.approx(perfect, rel=0.05)
    assert wrong > 1.2 * instant
    assert silent == none


def test_instant_modem_makes_no_difference_to_what_a_filter_is_told() -> None:
    """Vehicle 0's cloud is that of a filter which is told all measurements at once."""
    scenario = fleet(modem=InstantModem(loss=0.0))
    simulation = Simulation(scenario)
    simulation.reset(seed=4)
    start = simulation.worlds.navigation[0, 0].copy()
    belief = ParticleFilter(scenario.belief, scenario.tag, rows=2, vehicles=3, tags=[0, 1])
    belief.begin(start["x"], start["y"], seed=[4, 4], place=[0, 1])
    for _ in range(30):
        sail(simulation, 1)
        belief.predict(scenario.time_step)
        belief.correct(simulation.worlds.measurements[0].ravel())
    assert belief.particles.tobytes() == simulation.worlds.particles[0, 0].tobytes()
