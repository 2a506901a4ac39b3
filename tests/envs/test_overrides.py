"""Overrides of a scenario by dotted names: what belongs together changes together, in whatever order it is named."""

from itertools import permutations

import pytest

from tagtrack.envs.belief.assumptions import FILTERS
from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sensors import RangeReceiver

# Values that rules bind together, each set of which would be refused if one went alone (the nearest start is 20 m, the
# farthest 60 m, random particles are off, and a belief must score the readings of its receiver).
TOGETHER = (
    {"start.nearest": 200.0, "start.farthest": 300.0},
    {"start.farthest": 10.0, "start.nearest": 5.0},
    {"belief.recovery.slow_rate": 0.5, "belief.recovery.fast_rate": 0.6, "belief.recovery.second_resampling": "never"},
    {"receiver": "range", "belief.receiver": "range", "belief.receiver.range_sigma": 7.0, "start.deepest": 30.0},
    {"belief": "brownian", "belief.particles": 500, "belief.motion.max_speed": 0.3, "episode_steps": 7},
)


@pytest.mark.parametrize("overrides", TOGETHER, ids=lambda overrides: next(iter(overrides)))
def test_order_of_overrides_does_not_matter(overrides: dict[str, object]) -> None:
    found = [with_overrides(Scenario(), dict(order)) for order in permutations(overrides.items())]
    assert all(scenario == found[0] for scenario in found) and found[0] != Scenario()


def test_values_go_where_their_names_say_and_nowhere_else() -> None:
    changes = {"start.nearest": 200.0, "belief.particles": 500, "start.farthest": 300, "belief": "brownian"}
    scenario = with_overrides(Scenario(), changes)
    assert (scenario.start.nearest, scenario.start.farthest, scenario.start.deepest) == (200.0, 300.0, 0.0)
    assert (scenario.belief.motion, scenario.belief.particles) == (FILTERS["brownian"].motion, 500)
    assert (scenario.vehicle, scenario.water, scenario.tag) == (Scenario().vehicle, Scenario().water, Scenario().tag)
    both = with_overrides(Scenario(), {"belief.receiver": "range", "receiver": "range"})
    assert both.receiver == both.belief.receiver == RangeReceiver()


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        ({"start.nearest": 200.0}, "Start.farthest must be at least nearest"),
        ({"receiver": "range"}, "cannot score the readings of a RangeReceiver"),
        ({"start.nearest": 5.0, "start.north": 1.0}, "unknown parameter 'start.north'"),
        ({"start.nearest.by": 5.0}, "unknown parameter 'start.nearest.by'"),
        ({"start": 5.0}, "start must be given part by part"),
    ],
)
def test_what_breaks_a_rule_or_has_no_such_name_is_refused(overrides: dict[str, object], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        with_overrides(Scenario(), overrides)


def test_no_override_is_no_change() -> None:
    for scenario in SCENARIOS.values():
        assert with_overrides(scenario, {}) == scenario
