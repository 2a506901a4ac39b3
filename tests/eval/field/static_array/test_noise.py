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
