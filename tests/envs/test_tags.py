"""When tags ping: at random intervals that are the tag's own, at a fixed period, and in steps longer than the interval."""

import numpy as np
import pytest
from scipy import stats

from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.sim.tags import TARGET, ping_within, start_pinging
from tagtrack.envs.tag import Tag

VEMCO = Tag(period=60.0, random_delay=30.0)


def pings(tag: Tag, time_step: float, duration: float, seed: int = 1, index: int = 0) -> list[float]:
    """Times of the last ping of each step that had one [s]."""
    rule, target, heard = to_record(tag)[0], np.zeros(1, TARGET), []
    start_pinging(target[0], stream(seed, 0), index, rule)
    for step in range(round(duration / time_step)):
        if ping_within(target[0], stream(seed, step + 1), index, rule, step * time_step, time_step):
            heard.append(float(target["last_ping"][0]))
            assert step * time_step < heard[-1] <= (step + 1) * time_step
    return heard


def stream(seed: int, step: int) -> tuple[np.uint64, ...]:
    return np.uint64(seed), np.uint64(0), np.uint64(0), np.uint64(step)


def test_random_intervals_are_uniform_from_60_to_90_s() -> None:
    heard = pings(VEMCO, 30.0, 400_000.0)
    assert 0.0 <= heard[0] <= 90.0
    assert stats.kstest(np.diff(heard), "uniform", args=(60.0, 30.0)).pvalue > 1e-3


@pytest.mark.parametrize("time_step", [1.0, 7.5, 60.0])
def test_pings_come_at_the_same_times_whatever_the_time_step(time_step: float) -> None:
    assert pings(VEMCO, time_step, 6000.0) == pings(VEMCO, 30.0, 6000.0)


def test_tags_and_seeds_ping_apart() -> None:
    assert pings(VEMCO, 30.0, 900.0) != pings(VEMCO, 30.0, 900.0, index=1)
    assert pings(VEMCO, 30.0, 900.0) != pings(VEMCO, 30.0, 900.0, seed=2)


@pytest.mark.parametrize(("period", "time_step"), [(2.0, 30.0), (30.0, 30.0), (0.7, 10.0)])
def test_each_step_has_its_ping_where_the_period_is_no_longer(period: float, time_step: float) -> None:
    """Several pings in one step count as one, the last; a period equal to the step gives exactly one."""
    heard = np.array(pings(Tag(period=period), time_step, 200 * time_step))
    assert len(heard) == 200
    assert (np.arange(1, 201) * time_step - heard < period + 1e-9).all()
    phase = (heard - heard[0]) / period
    np.testing.assert_allclose(phase, np.round(phase), atol=1e-9)
