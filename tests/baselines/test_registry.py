"""Specifications make the policies they name, and say what is wrong where they cannot."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from tagtrack.baselines.circle import Circle
from tagtrack.baselines.division import Uncertain
from tagtrack.baselines.registry import BASELINES, make_baseline
from tagtrack.baselines.simple import Random
from tagtrack.baselines.three_step import ThreeStep
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.simulation import Simulation
from tests.tasks import LONE

Make = Callable[..., Simulation]


def test_values_are_read_with_and_without_their_names(make_simulation: Make) -> None:
    simulation = make_simulation("LeopardSharkStandoff-v0")
    assert make_baseline("circle:40", simulation).radius == make_baseline("circle:radius=40", simulation).radius == 40.0
    three_step = make_baseline("three_step:tau=10,perimeter=30", simulation)
    assert isinstance(three_step, ThreeStep)
    assert (three_step.tau, three_step.perimeter) == (pytest.approx(math.radians(10)), 30.0)
    assert make_baseline("information:3", simulation).horizon == 3
    assert make_baseline("random:7", simulation).seed == 7


@pytest.mark.parametrize("name", BASELINES)
def test_every_baseline_has_defaults(make_simulation: Make, name: str) -> None:
    for env_id in ("LeopardShark-v0", "LeopardSharkStandoff-v0"):
        assert type(make_baseline(name, make_simulation(env_id))) is BASELINES[name]


@pytest.mark.parametrize(
    ("specification", "complaint"),
    [
        ("zigzag", "unknown baseline 'zigzag'; known: three_step, pursuit, circle"),
        ("circle:wide", "radius must be a number, got 'wide'"),
        ("circle:", "radius must be a number, got ''"),
        ("circle:-5", "Circle.radius must be positive, got -5.0"),
        ("circle:nan", "Circle.radius must be finite, got nan"),
        ("circle:inf", "Circle.radius must be finite, got inf"),
        ("three_step:0", "tau must be more than 0"),
        ("three_step:tau=10,speed=3", "three_step has no parameter 'speed'; it has tau, perimeter"),
        ("three_step:tau=10,tau=20", "tau is given twice"),
        ("three_step:perimeter=30", "perimeter must be 0 (the scenario has no speed control"),
        ("pursuit:30", "perimeter must be 0 (the scenario has no speed control"),
        ("information:2.5", "horizon must be a whole number, got '2.5'"),
        ("information:0", "Information.horizon must be a whole number of at least 1 and at most 10000, got 0"),
        ("stationary:3", "stationary has no parameter '3'; it has none"),
        ("random:-1", "Random.seed must be at least 0, got -1"),
    ],
)
def test_bad_specification_is_named(make_simulation: Make, specification: str, complaint: str) -> None:
    with pytest.raises(ValueError) as caught:
        make_baseline(specification, make_simulation())
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bad_parameter_is_named_by_the_constructor_too(make_simulation: Make) -> None:
    scenario = make_simulation().scenario
    with pytest.raises(ValueError, match="Circle.radius must be positive, got 0.0"):
        Circle(scenario=scenario, radius=0)
    with pytest.raises(ValueError, match="Random.hold must be positive"):
        Random(scenario=scenario, hold=-1.0)
    with pytest.raises(ValueError, match="Uncertain.hold must be positive, got 0.0"):
        Uncertain(scenario=scenario, hold=0)
    with pytest.raises(ValueError, match="Circle.spacing must be at least 0 and below 1, got 1.0"):
        Circle(scenario=scenario, spacing=1)


@pytest.mark.parametrize("name", BASELINES)
@pytest.mark.parametrize("env_id", LONE)
def test_every_baseline_sails_in_every_task(env_id: str, name: str) -> None:
    """Through the first pings, in two worlds, with what it does there unless told otherwise."""
    simulation = Simulation(with_overrides(SCENARIOS[env_id], {"belief.particles": 100}), 2)
    policy, state = make_baseline(name, simulation), None
    observation = simulation.reset(seed=0)
    for _ in range(12):
        action, state = policy.predict(observation[:, 0], state)
        assert action.shape == (2, len(simulation.action_names)) and np.isfinite(action).all()
        simulation.step(action[:, np.newaxis])


def test_circle_of_area_only_is_the_papers_at_four_fifths_of_the_working_range() -> None:
    """0.8 * 250 m."""
    simulation = Simulation(with_overrides(SCENARIOS["TagTrack/AreaOnly-v0"], {"belief.particles": 10}))
    assert make_baseline("circle", simulation).radius == pytest.approx(200.0, abs=0.5)
    assert make_baseline("circle:270", simulation).radius == 270.0


def test_baselines_measure_distance_as_the_task_scales_it() -> None:
    """A belief 600 m off: twelve lengths of the stereo task, three of the ranging one."""
    simulation = Simulation(with_overrides(SCENARIOS["TagTrack/RangeOnly-v0"], {"belief.particles": 10}))
    observation = simulation.reset(seed=0)[:, 0].copy()
    observation[0, 0] = 3.0
    assert make_baseline("circle", simulation)._read(observation).distance[0] == pytest.approx(600.0)
