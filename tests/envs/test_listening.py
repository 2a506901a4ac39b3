"""What a listener remembers, from measurements alone: silence, shares heard, when a ping is due, how far its interval has run."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.filter import ParticleFilter
from tagtrack.envs.belief.listening import UNKNOWN_PHASE, ping_phase
from tagtrack.envs.layout import feature_names
from tagtrack.envs.measurement import Status, measurement
from tagtrack.envs.motions import BrownianWalk
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS, Scenario, Start
from tagtrack.envs.sensors import PresenceReceiver, RangeReceiver, StereoHydrophone
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.tag import Tag
from tests.tasks import LONE

VEMCO = Tag(period=60.0, random_delay=30.0)


def listen_to(tag: Tag, receiver: PresenceReceiver | RangeReceiver | StereoHydrophone, vehicles: int = 1) -> ParticleFilter:
    belief = ParticleFilter(Belief(particles=10, receiver=receiver), tag, vehicles=vehicles)
    belief.begin(0.0, 0.0)
    return belief


def tell(belief: ParticleFilter, seconds: float, status: Status | None, *, vehicle: int = 0, **fields: float) -> np.ndarray:
    """What the vehicle remembers when so many seconds have passed and it has measured; None: there was no measurement."""
    belief.predict(seconds)
    if status is not None:
        belief.correct(measurement(time=belief.time, x=0.0, y=0.0, vehicle=vehicle, status=status, **fields))
    return belief.listeners[0, vehicle]


# A tag with random intervals of 60 to 90 s, by hand.


def test_silence_counts_the_seconds_since_the_last_detection() -> None:
    belief = listen_to(VEMCO, PresenceReceiver())
    told = [Status.NOTHING, None, Status.HEARD, None, Status.NOTHING, Status.HEARD]
    seen = [float(tell(belief, 30.0, status)["silence"]) for status in told]
    assert seen == [30.0, 60.0, 0.0, 30.0, 60.0, 0.0]


def test_a_ping_is_surely_missed_when_the_longest_interval_has_passed_since_anything_certain() -> None:
    """90 s after the beginning; after the last such silence; after the last ping, whose time the receiver logs."""
    belief = listen_to(VEMCO, PresenceReceiver())
    assert belief.listeners[0, 0]["surely_by"] == 90.0
    course = [  # what the receiver says after each 30 s, when the ping it heard came, what is to make of it, the next sure time
        (Status.NOTHING, math.nan, Status.NOTHING, 90.0),
        (Status.NOTHING, math.nan, Status.NOTHING, 90.0),
        (Status.NOTHING, math.nan, Status.MISSED, 180.0),
        (Status.HEARD, 100.0, Status.HEARD, 190.0),
        (Status.NOTHING, math.nan, Status.NOTHING, 190.0),
        (Status.NOTHING, math.nan, Status.NOTHING, 190.0),
        (Status.NOTHING, math.nan, Status.MISSED, 280.0),
        (Status.NOTHING, math.nan, Status.NOTHING, 280.0),
        (Status.NOTHING, math.nan, Status.NOTHING, 280.0),
        (Status.NOTHING, math.nan, Status.MISSED, 370.0),
    ]
    for status, arrival, meaning, surely_by in course:
        listener = tell(belief, 30.0, status, arrival=arrival)
        assert (int(listener["status"]), float(listener["surely_by"])) == (meaning, surely_by)


def test_a_long_silence_is_one_missed_ping_and_not_several() -> None:
    """One measurement after ten minutes weighs as one: where the vehicle was when the others came, it does not say."""
    belief = listen_to(VEMCO, PresenceReceiver())
    listener = tell(belief, 600.0, Status.NOTHING)
    assert int(listener["status"]) == Status.MISSED and listener["surely_by"] == 630.0
    assert listener["heard_lately"] == pytest.approx(0.4)


def test_shares_follow_what_is_heard_and_surely_missed_and_nothing_else() -> None:
    """A fifth and 3 % of the way at each ping, from one half: 0.4, then 0.4 + 0.2 * 0.6; 0.485, then 0.485 + 0.03 * 0.515."""
    belief = listen_to(VEMCO, PresenceReceiver())
    for status in (Status.NOTHING, None, Status.NOTHING):  # certain after 90 s
        listener = tell(belief, 30.0, status)
    assert (listener["heard_lately"], listener["heard_long"]) == (pytest.approx(0.4), pytest.approx(0.485))
    listener = tell(belief, 30.0, Status.HEARD)
    assert (listener["heard_lately"], listener["heard_long"]) == (pytest.approx(0.52), pytest.approx(0.50045))
    listener = tell(belief, 30.0, Status.NOTHING)
    assert (listener["heard_lately"], listener["heard_long"]) == (pytest.approx(0.52), pytest.approx(0.50045))


def test_where_no_measurement_comes_no_ping_is_missed() -> None:
    belief = listen_to(VEMCO, PresenceReceiver())
    for _ in range(10):
        listener = tell(belief, 30.0, None)
    assert (listener["silence"], listener["surely_by"], listener["heard_lately"]) == (300.0, 90.0, 0.5)


def test_a_tag_that_was_asked_and_did_not_answer_is_missed_at_once() -> None:
    belief = listen_to(Tag(period=10.0), RangeReceiver())
    listener = tell(belief, 4.0, Status.MISSED)
    assert int(listener["status"]) == Status.MISSED and listener["heard_lately"] == pytest.approx(0.4)


def test_readings_are_kept_with_those_before_them() -> None:
    belief = listen_to(Tag(period=10.0), RangeReceiver())
    assert np.isnan(belief.listeners[0, 0]["readings"]).all()
    kept = []
    for reading in (100.0, None, 120.0):
        listener = tell(belief, 10.0, Status.MISSED if reading is None else Status.HEARD, readings=[reading or math.nan])
        kept.append((float(listener["previous"][0]), float(listener["readings"][0])))
    np.testing.assert_array_equal(kept, [(math.nan, 100.0), (math.nan, 100.0), (100.0, 120.0)])


def test_each_vehicle_remembers_for_itself() -> None:
    belief = listen_to(VEMCO, PresenceReceiver(), vehicles=2)
    tell(belief, 30.0, Status.HEARD, vehicle=1, arrival=20.0)
    tell(belief, 30.0, Status.NOTHING, vehicle=0)
    assert belief.listeners[0]["silence"].tolist() == [60.0, 30.0]
    assert belief.listeners[0]["surely_by"].tolist() == [90.0, 110.0]


# How far the interval has run.


def test_phase_of_random_intervals_runs_until_the_ping_has_come_for_certain() -> None:
    belief = listen_to(VEMCO, PresenceReceiver())
    listener = tell(belief, 120.0, Status.HEARD, arrival=100.0)
    phases = [ping_phase(listener, time, 60.0, 30.0) for time in (100.0, 120.0, 145.0, 190.0, 250.0)]
    assert phases == pytest.approx([0.0, 20 / 90, 0.5, 1.0, 1.0])


def test_phase_of_a_fixed_period_is_unknown_until_a_ping_was_heard_and_runs_on_through_silence() -> None:
    belief = listen_to(Tag(period=2.0), StereoHydrophone())
    listener = tell(belief, 2.0, Status.NOTHING)
    assert ping_phase(listener, 2.0, 2.0, 0.0) == UNKNOWN_PHASE == -1.0
    listener = tell(belief, 2.0, Status.HEARD, arrival=3.3, readings=[1.0, 20.0])
    listener = tell(belief, 8.0, Status.NOTHING)
    assert [ping_phase(listener, time, 2.0, 0.0) for time in (4.0, 5.0, 12.0)] == pytest.approx([0.35, 0.85, 0.35])


def test_a_ping_without_a_time_of_arrival_came_when_it_was_told() -> None:
    belief = listen_to(VEMCO, PresenceReceiver())
    assert tell(belief, 30.0, Status.HEARD)["surely_by"] == 30.0 + 90.0


@pytest.mark.parametrize("env_id", [name for name in LONE if SCENARIOS[name].tag.random_delay == 0.0])
def test_observation_shows_no_phase_before_the_first_detection(env_id: str) -> None:
    """Where half of the pings are lost, some worlds wait; from the first detection on the phase is that of the true tag."""
    scenario = with_overrides(SCENARIOS[env_id], {"belief.particles": 20, "water.clear_hearing": 0.4, "water.noisy_share": 0.0})
    simulation = Simulation(scenario, 40)
    simulation.reset(seed=0)
    place, period = feature_names(scenario).index("ping_phase"), scenario.tag.period
    heard, waits = np.zeros(40, bool), 0
    for step in range(1, 21):
        simulation.step(np.zeros((40, 1, len(simulation.action_names)), np.float32))
        heard |= simulation.detected[:, 0, 0]
        phase = simulation.observation[:, 0, place]
        assert (phase[~heard] == -1.0).all()
        true = (step * scenario.time_step - simulation.worlds.targets["first_ping"][:, 0]) / period
        apart = np.abs(phase - true)[heard]
        np.testing.assert_allclose(np.minimum(apart % 1.0, 1.0 - apart % 1.0), 0.0, atol=1e-5)
        waits += int((~heard).sum())
    assert waits > 40 and heard.any()


# Against the truth.


@pytest.mark.parametrize(("period", "time_step"), [(2.0, 2.0), (2.7, 1.0), (5.0, 2.0), (2.0, 0.5), (0.7, 1.0), (3.3, 2.9)])
def test_once_heard_a_tag_of_a_fixed_period_is_missed_exactly_when_its_pings_are(period: float, time_step: float) -> None:
    """Before the first detection silence is sure after each period, whenever the pings come: as many, but at other times."""
    scenario = Scenario(
        time_step=time_step,
        speed_control=True,
        fish=BrownianWalk(max_speed=1e-6),
        start=Start(nearest=95.0, farthest=95.0),
        water=Water(noisy_share=0.5),
        tag=Tag(period=period),
        belief=Belief(particles=1),
    )
    simulation = Simulation(scenario, 100)
    simulation.reset(seed=2)
    rest = np.tile(np.array([1.0, 0.0, -1.0], np.float32), (100, 1, 1))
    ever, missed_pings = np.zeros(100, bool), 0
    for _ in range(150):
        simulation.step(rest)
        truth, listener = simulation.worlds.encounters[:, 0, 0], simulation.listeners[:, 0, 0]
        missed = listener["status"] == int(Status.MISSED)
        np.testing.assert_array_equal(missed[ever], (truth["pinged"] & ~truth["heard"])[ever])
        ever |= truth["heard"]
        missed_pings += int(missed[ever].sum())
    assert ever.mean() > 0.5 and missed_pings > 500


@pytest.mark.parametrize("env_id", ["TagTrack/AreaOnly-v0", "TagTrack/LeopardShark-v0"])
def test_silence_and_shares_of_a_roll_out_follow_from_its_measurements(env_id: str) -> None:
    """Fed with nothing but the measurements of a world, a filter of another belief remembers the same."""
    scenario = with_overrides(SCENARIOS[env_id], {"belief.particles": 10})
    simulation = Simulation(scenario)
    simulation.reset(seed=11)
    belief = ParticleFilter(replace(scenario.belief, particles=7, half_width=20.0), scenario.tag)
    belief.begin(0.0, 0.0, seed=99)
    for _ in range(60):
        simulation.step(np.full((1, 1, 2), 0.5, np.float32))
        belief.predict(scenario.time_step)
        belief.correct(simulation.worlds.measurements[0, 0])
        assert belief.listeners[0].tobytes() == simulation.listeners[0, :, 0].tobytes()
