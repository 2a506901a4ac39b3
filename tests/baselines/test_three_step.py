"""The three-step controller does what Clark et al. 2013 say in 4.2, its search and perimeter what they suggest."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.simulation import Simulation

Make = Callable[..., Simulation]
Sight = Callable[..., np.ndarray]


@pytest.fixture
def policy(make_simulation: Make) -> Any:
    return make_baseline("three_step:tau=10", make_simulation())


def test_headings_follow_equations_11_and_12(policy: Any, sight: Sight, course_of: Sight) -> None:
    """Belief at 90 degrees throughout: 135, 45, 90 degrees and 135 again are wanted, each reached at the next look."""
    state = None
    for heading, wanted in ((0, 135), (135, 45), (45, 90), (90, 135)):
        action, state = policy.predict(sight(heading=heading, bearing=90 - heading), state)
        assert course_of(action)[0] + 90 == pytest.approx(wanted, abs=1e-4)


def test_bearing_is_taken_at_step_0_and_kept_through_the_cycle(policy: Any, sight: Sight, course_of: Sight) -> None:
    _, state = policy.predict(sight(heading=0, bearing=90))
    # The belief moves on to 120 degrees; wanted is still 90 + 45, 90 - 45 and 90, then 120 + 45.
    for heading, wanted in ((0, 135), (135, 45), (45, 90), (90, 165)):
        action, state = policy.predict(sight(heading=heading, bearing=120 - heading), state)
        assert course_of(action)[0] + 120 == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize(("heading", "wanted"), [(45 - 10.5, 45), (45 + 10.5, 45), (45 - 9.5, -45), (45 + 9.5, -45)])
def test_step_advances_only_within_tau(policy: Any, sight: Sight, course_of: Sight, heading: float, wanted: float) -> None:
    _, state = policy.predict(sight())
    action, _ = policy.predict(sight(heading=heading, bearing=-heading), state)
    assert course_of(action)[0] == pytest.approx(wanted, abs=1e-4)


def test_heading_error_wraps(make_simulation: Make, sight: Sight, course_of: Sight) -> None:
    """Belief at 170 degrees: step 0 wants 215, and -150 is within 10 degrees of it."""
    policy = make_baseline("three_step:tau=10", make_simulation())
    _, state = policy.predict(sight(heading=0, bearing=170))
    action, _ = policy.predict(sight(heading=-150, bearing=-40), state)
    assert course_of(action)[0] == pytest.approx(-45, abs=1e-4)


def test_silence_starts_a_search_circle_that_grows(policy: Any, sight: Sight, course_of: Sight) -> None:
    """Nearer than the circle the course leads away from the belief, beyond it towards it; at 20 m the circle passes by."""
    quiet, lost, long_lost = (
        float(course_of(policy.predict(sight(distance=20.0, silence=silence))[0])[0]) for silence in (29.0, 31.0, 300.0)
    )
    assert quiet == pytest.approx(45, abs=1e-4)
    assert 0 < lost < 45
    assert long_lost > lost + 45


def test_detection_ends_the_search_with_step_0_towards_the_belief_of_now(policy: Any, sight: Sight, course_of: Sight) -> None:
    _, state = policy.predict(sight(bearing=0))
    _, state = policy.predict(sight(bearing=60, silence=40.0), state)
    action, state = policy.predict(sight(bearing=60), state)
    assert course_of(action)[0] == pytest.approx(45, abs=1e-4)
    assert state.step[0] == 0


def test_motionless_inside_the_perimeter(make_simulation: Make, sight: Sight, course_of: Sight) -> None:
    policy = make_baseline("three_step:perimeter=30", make_simulation("LeopardSharkStandoff-v0"))
    action, _ = policy.predict(sight(distance=[29.0, 31.0], bearing=[50.0, 50.0]))
    np.testing.assert_array_equal(action[:, 2], [-1.0, 1.0])
    assert course_of(action)[0] == pytest.approx(-50, abs=1e-4)  # the heading it has


def test_perimeter_is_the_scenarios_unless_given(make_simulation: Make, sight: Sight) -> None:
    simulation = make_simulation("LeopardSharkStandoff-v0")
    assert simulation.scenario.reward.perimeter == 20.0
    observation = sight(distance=[19.0, 21.0, 24.0])
    assert make_baseline("three_step", simulation).predict(observation)[0][:, 2].tolist() == [-1.0, 1.0, 1.0]
    assert make_baseline("three_step:perimeter=23", simulation).predict(observation)[0][:, 2].tolist() == [-1.0, -1.0, 1.0]


def test_search_goes_on_inside_the_perimeter_and_keeps_out_of_it(make_simulation: Make, sight: Sight, course_of: Sight) -> None:
    policy = make_baseline("three_step:perimeter=30", make_simulation("LeopardSharkStandoff-v0"))
    action, _ = policy.predict(sight(distance=15.0, silence=31.0))
    assert action[0, 2] == 1.0
    assert course_of(action)[0] > 90  # away from the belief
