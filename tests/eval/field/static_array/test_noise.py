"""The noise of arrivals from the pings themselves."""

from __future__ import annotations

import numpy as np
import pytest

from tagtrack.eval.field.static_array.model import ArraySetting, Pings
from tagtrack.eval.field.static_array.noise import LEAST_PINGS, estimate_sigma

SQUARE = np.array([[0.0, 0.0], [200.0, 0.0], [0.0, 200.0], [200.0, 200.0]])
SETTING = ArraySetting(sigma=1e-3)


def make_pings(count: int, sigma: float, receivers: np.ndarray = SQUARE, late: float = 0.0) -> Pings:
    """Pings from all over the square; a share ``late`` of the arrivals comes 50 ms after its time."""
    generator = np.random.default_rng(1)
    place = generator.uniform(20, 180, (count, 2))
    exact = np.linalg.norm(place[:, None] - receivers, axis=2) / SETTING.sound_speed
    arrival = exact + sigma * generator.normal(size=exact.shape) + 0.05 * (generator.uniform(size=exact.shape) < late)
    time = 100.0 * np.arange(count)
    return Pings(time=time, arrival=arrival + time[:, None])


@pytest.mark.parametrize("sigma", [2e-4, 1e-3, 4e-3])
def test_sigma_is_found_wherever_it_began(sigma: float) -> None:
    found = estimate_sigma(make_pings(4000, sigma), SQUARE, SETTING)
    assert found == pytest.approx(sigma, rel=0.06)  # the median of 4,000 chi-squares is known to 3.7 %, its root to 1.9 %


def test_sigma_does_not_mind_a_few_late_arrivals() -> None:
    found = estimate_sigma(make_pings(2000, 1e-3, late=0.02), SQUARE, SETTING)
    assert found == pytest.approx(1e-3, rel=0.2)  # 8 % of the pings have one: the median moves by as much


def test_sigma_is_unknown_where_no_ping_has_an_arrival_to_spare() -> None:
    assert estimate_sigma(make_pings(500, 1e-3, SQUARE[:3]), SQUARE[:3], SETTING) is None
    assert estimate_sigma(make_pings(LEAST_PINGS - 1, 1e-3), SQUARE, SETTING) is None
    assert estimate_sigma(make_pings(LEAST_PINGS, 1e-3), SQUARE, SETTING) is not None


def hear_at_rest(place: tuple[float, float], count: int = 1500, sigma: float = 0.0) -> Pings:
    """Pings of a tag that stays at one place, sent at any time."""
    generator = np.random.default_rng(2)
    time = np.sort(generator.uniform(0, 1e6, count))
    travel = np.linalg.norm(np.array(place) - SQUARE, axis=1) / SETTING.sound_speed
    return Pings(time=time, arrival=time[:, None] + travel + sigma * generator.normal(size=(count, 4)))


@pytest.mark.parametrize("place", [(130.0, 120.0), (40.0, 110.0), (105.0, 190.0), (144.0, 29.0)])
def test_a_resting_tag_heard_in_steps_of_ten_milliseconds_has_the_noise_of_rounding(place: tuple[float, float]) -> None:
    """2.9 ms, the step over the root of 12, or more where the errors of its four arrivals add up: 10 ms at most."""
    pings = hear_at_rest(place)
    found = estimate_sigma(Pings(time=pings.time, arrival=np.round(pings.arrival, 2)), SQUARE, SETTING, step=0.01)
    assert found is not None and 2.88e-3 < found < 5e-3


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.5, 0.5), (-2.0, -2.0), (4.0, 4.0)])
@pytest.mark.parametrize("sigma", [1e-3, 4e-3])
def test_a_tag_beside_a_receiver_is_as_exact_as_any(sigma: float, place: tuple[float, float]) -> None:
    """What comes too early at the receiver fits no place and is left unexplained: taken for noise it would be up to twice."""
    assert estimate_sigma(hear_at_rest(place, sigma=sigma), SQUARE, SETTING) == pytest.approx(sigma, rel=0.2)
