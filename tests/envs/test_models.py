"""Models are open, and nothing about them is ignored in silence: functions of another signature, unread parameters, names."""

from dataclasses import dataclass
from typing import ClassVar

import gymnasium
import numpy as np
import pytest

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.kernels.calling import native
from tagtrack.envs.motions import StraightLegs
from tagtrack.envs.motions.motion import CHOOSE, START, Motion
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.rewards import Localization, Reward
from tagtrack.envs.rewards.term import JUDGE, Term
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sensors import MeasuredReception, RangeReceiver, Sensor
from tagtrack.envs.simulation import Simulation

RANGE_ONLY, AREA_ONLY = SCENARIOS["TagTrack/RangeOnly-v0"], SCENARIOS["TagTrack/AreaOnly-v0"]
TIME_OF_FLIGHT = SCENARIOS["TagTrack/TimeOfFlight-v0"]


@pytest.mark.parametrize(
    ("scenario", "name", "value", "reason"),
    [
        (RANGE_ONLY, "receiver.max_range", 500.0, "only a belief reads it"),
        (RANGE_ONLY, "receiver.silence_sigma", 5.0, "only a belief reads it"),
        (RANGE_ONLY, "receiver.reception", 0.5, "only a belief reads it"),
        (RANGE_ONLY, "belief.receiver.range_tolerance", 1.0, "only the truth reads it"),
        (RANGE_ONLY, "belief.receiver.reception", 0.5, "without a max_range silence says nothing"),
        (AREA_ONLY, "receiver.silence_sigma", 5.0, "only a belief reads it"),
        (AREA_ONLY, "belief.receiver.reception_spread", 0.1, "only the truth reads it"),
        (AREA_ONLY, "belief.receiver.max_range_walk", 1.0, "without a max_range_spread the range is taken as known"),
        (TIME_OF_FLIGHT, "belief.receiver.tick", 1e-3, "only the truth reads it"),
        (TIME_OF_FLIGHT, "receiver.largest_jump", 10.0, "only a belief reads it"),
        (Scenario(), "belief.receiver.strength_sigma", 5.0, "its weighting is by bearing alone"),
    ],
)
def test_parameter_that_nobody_reads_is_refused(scenario: Scenario, name: str, value: float, reason: str) -> None:
    with pytest.raises(ValueError, match=f"{name} would change nothing in a .*: {reason}"):
        with_overrides(scenario, {name: value})


@pytest.mark.parametrize("name", ["belief.heavy_tails", "belief.weighting", "belief.receiver.heavy_tails"])
def test_parameter_of_another_kind_is_unknown(name: str) -> None:
    with pytest.raises(ValueError, match=f"unknown parameter '{name}'"):
        with_overrides(RANGE_ONLY, {name: 1})


def test_weighting_that_reads_the_strength_lets_it_be_set() -> None:
    changed = with_overrides(Scenario(), {"belief.receiver.weighting": "combined", "belief.receiver.strength_sigma": 5.0})
    assert changed.belief.receiver.strength_sigma == 5.0  # type: ignore[attr-defined]


def test_function_of_another_signature_is_named() -> None:
    with pytest.raises(ValueError, match=r"judge must take 2 arguments, judge\(outcome, parameters\), got \(outcome\)"):

        @native(JUDGE)
        def judge(outcome):
            return 0.0

    @native(START)
    def start(heading, speed, bits, parameters):
        pass

    with pytest.raises(TypeError, match=r"Backwards.choose must be choose\(.*\), got .*start as start\("):

        class Backwards(Motion):
            choose = start

    with pytest.raises(TypeError, match="Plain.choose must be decorated as the model's choose"):

        class Plain(Motion):
            choose = len


def test_function_that_cannot_be_compiled_is_named() -> None:
    @native(JUDGE)
    def judge(outcome, parameters):
        return outcome.no_such_field

    with pytest.raises(ValueError, match=r"judge cannot be compiled as judge\(outcome, parameters\)"):
        _ = judge.address


def test_two_terms_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match="two terms go by the name 'localization'; give one of them another `name`"):
        Reward(own=(Localization(),))


def test_models_in_the_wrong_place_are_named() -> None:
    with pytest.raises(ValueError, match="Belief.motion cannot be StraightLegs: particles need a random motion"):
        Belief(motion=StraightLegs())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="a belief cannot score with a MeasuredReception, which only draws"):
        Belief(receiver=MeasuredReception())
    with pytest.raises(ValueError, match="Scenario.belief.receiver cannot score the readings of a RangeReceiver"):
        Scenario(receiver=RangeReceiver())
    with pytest.raises(ValueError, match="Scenario.fish must be a Motion or a Path, got 7"):
        Scenario(fish=7)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="receiver must be one of stereo, .*, or MODULE:CLASS of your own, got 'sonar'"):
        with_overrides(Scenario(), {"receiver": "sonar"})
    with pytest.raises(ValueError, match="cannot import 'no_such_module'"):
        with_overrides(Scenario(), {"receiver": "no_such_module:Sonar"})
    with pytest.raises(ValueError, match="receiver: .* must be a class derived from .*Sensor"):
        with_overrides(Scenario(), {"receiver": "tagtrack.envs.tag:Tag"})


@native(CHOOSE)
def drift_north(heading, speed, bits, normal_1, normal_2, parameters, time_step):
    for i in range(heading.shape[0]):
        heading[i] = np.float32(0.5 * np.pi)
        speed[i] = np.float32(parameters[0])


@native(START)
def rest(heading, speed, bits, parameters):
    for i in range(heading.shape[0]):
        heading[i] = np.float32(0.0)
        speed[i] = np.float32(0.0)


@dataclass(frozen=True, kw_only=True)
class DriftNorth(Motion):
    speed: float = 0.25
    start = rest
    choose = drift_north


@native(JUDGE)
def count_heard(outcome, parameters):
    return parameters[0] * outcome.heard


@dataclass(frozen=True, kw_only=True)
class Heard(Term):
    weight: float = 0.5
    name: ClassVar[str] = "heard"
    judge = count_heard


def test_motion_and_term_of_ones_own_do_what_they_say() -> None:
    scenario = with_overrides(Scenario(), {"fish": DriftNorth(), "reward.own": (Heard(),), "reward.own.heard.weight": 0.25})
    simulation = Simulation(with_overrides(scenario, {"belief.particles": 50}), 4)
    simulation.reset(seed=0)
    before = simulation.fish_position.copy()
    for step in range(1, 11):
        simulation.step(np.zeros((4, 1, 2)))
        np.testing.assert_array_equal(simulation.reward_terms["heard"], 0.25 * simulation.detected[:, :, 0])
        np.testing.assert_allclose(simulation.fish_position - before, [[[0.0, 0.5 * step]]] * 4, atol=1e-4)


def test_sensor_without_functions_for_a_belief_is_refused_at_once() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Deaf(Sensor):
        pass

    with pytest.raises(ValueError, match="Scenario.receiver must be a Sensor that reads, got .*Deaf"):
        Scenario(receiver=Deaf())


def test_steering_by_the_heading_is_a_parameter() -> None:
    env = gymnasium.make("TagTrack/LeopardShark-v0", particles=50, overrides={"steer_by": "heading"})
    env.reset(seed=1)
    worlds = env.unwrapped.simulation.worlds
    heading = float(worlds.navigation["heading"][0, 0])
    env.step(np.array([1.0, 0.0], np.float32))
    assert float(worlds.vehicles["course"][0, 0]) == pytest.approx(heading)


@pytest.mark.parametrize("time_step", [1.0, 10.0])
def test_brownian_walk_with_a_diffusion_spreads_alike_whatever_the_step(time_step: float) -> None:
    """Variance along each axis 2 D t: 300 s at 0.1 m^2/s are 60 m^2, of 4,000 fish within four standard errors (9 %)."""
    changes = {"fish": "brownian", "fish.diffusion": 0.1, "belief.particles": 1, "time_step": time_step}
    simulation = Simulation(with_overrides(Scenario(), changes), 4000)
    simulation.reset(seed=0)
    before = simulation.fish_position.copy()
    for _ in range(round(300 / time_step)):
        simulation.step(np.zeros((4000, 1, 2)))
    moved = (simulation.fish_position - before)[:, 0]
    np.testing.assert_allclose(moved.var(axis=0), 60.0, rtol=0.09)


def test_first_speeds_are_a_parameter_of_their_own() -> None:
    changes = {"belief.motion.max_speed": 20.0, "belief.motion.first_speed": 1.0, "belief.particles": 2000}
    simulation = Simulation(with_overrides(Scenario(), changes))
    simulation.reset(seed=0)
    speed = simulation.worlds.particles[0, 0, 0, 3]
    assert 0.95 < speed.max() <= 1.0
    with pytest.raises(ValueError, match="first_speed must be within 0 to max_speed"):
        with_overrides(Scenario(), {"belief.motion.first_speed": 7.0})


def test_compass_bias_lasts_an_episode_and_bends_dead_reckoning() -> None:
    """Between two fixes a bias of b turns the way reckoned by b: 60 m with 0.1 rad end 6 m off, across the course."""
    exact = {"compass_sigma": 0.0, "fix_sigma": 0.0, "drift_sigma": 0.0, "fix_interval": 1e6, "compass_bias": 0.1}
    scenario = with_overrides(Scenario(), {f"vehicle.{name}": value for name, value in exact.items()} | {"belief.particles": 1})
    simulation = Simulation(scenario, 200)
    simulation.reset(seed=0)
    bias = simulation.worlds.vehicles["compass_bias"][:, 0].copy()
    assert bias.std() == pytest.approx(0.1, rel=0.2)
    for _ in range(30):
        simulation.step(np.tile(np.array([1.0, 0.0], np.float32), (200, 1, 1)))
    worlds = simulation.worlds
    np.testing.assert_array_equal(worlds.vehicles["compass_bias"][:, 0], bias)
    off = np.hypot(worlds.navigation["x"] - worlds.vehicles["x"], worlds.navigation["y"] - worlds.vehicles["y"])[:, 0]
    sailed = np.hypot(worlds.vehicles["x"], worlds.vehicles["y"])[:, 0]
    np.testing.assert_allclose(off, 2.0 * np.abs(np.sin(0.5 * bias)) * sailed, rtol=1e-6, atol=1e-9)
