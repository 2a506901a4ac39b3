"""Specifications make the policies they name, and say what is wrong where they cannot."""

import math
from collections.abc import Callable

import pytest

from tagtrack.baselines.circle import Circle
from tagtrack.baselines.information import Information
from tagtrack.baselines.registry import BASELINES, make_baseline
from tagtrack.baselines.simple import Random
from tagtrack.baselines.three_step import ThreeStep
from tagtrack.envs.simulation import Simulation

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
        ("information:0", "Information.horizon must be a whole number of at least 1, got 0"),
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
    with pytest.raises(ValueError, match="Information steers one vehicle, got a simulation of 2"):
        Information(simulation=make_simulation(vehicles=2))
