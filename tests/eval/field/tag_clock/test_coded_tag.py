"""The simulated tag and receiver: bursts, periods, ticks, losses and clocks."""

import numpy as np
import pytest

from tagtrack.eval.field.tag_clock.arrivals import read_arrivals, write_arrivals
from tagtrack.eval.field.tag_clock.calibration import calibrate
from tagtrack.eval.field.tag_clock.coded_tag import CodedTag, CodeReceiver, clock_wander, simulate_arrivals

FIVE, SIX = (117, 2, 3, 4, 5), (117, 2, 3, 4, 5, 6)
PERFECT = CodeReceiver(jitter=0.0, tick=1e-9, resolution=1e-9, missed=0.0, misread=0.0)


def record(tag, receiver=PERFECT, *, duration=600.0, seed=0, **conditions):
    return simulate_arrivals(tag, receiver, duration=duration, generator=np.random.default_rng(seed), **conditions)


def test_every_burst_has_three_codes():
    arrivals = record(CodedTag(codes=SIX, burst_period=2.0, wander=0.0), duration=60.0)
    bursts = arrivals.code.reshape(-1, 3)
    assert len(bursts) == 30
    assert bursts[:3].tolist() == [[117, 2, 3], [4, 5, 6], [117, 2, 3]]
    np.testing.assert_allclose(np.diff(arrivals.time[:4]), [0.04876, 0.04876, 2.0 - 2 * 0.04876], atol=1e-8)


@pytest.mark.parametrize(("codes", "of_first", "of_others"), [(SIX, 4.0, 4.0), (FIVE, 2.0, 4.0)])
def test_one_of_five_codes_has_half_the_period_of_the_others(codes, of_first, of_others):
    tag = CodedTag(codes=codes, burst_period=2.0, wander=0.0)
    arrivals = record(tag)
    for code in codes:
        period = of_first if code == 117 else of_others
        assert tag.period(code) == period
        np.testing.assert_allclose(np.diff(arrivals.of_code(code)), period, atol=1e-8)


def test_a_distant_tag_is_heard_later():
    tag = CodedTag(wander=0.0)
    late = record(tag, distance=150.0, sound_speed=1500.0).time - record(tag).time
    np.testing.assert_allclose(late, 0.1, atol=1e-8)


def test_a_power_cycle_shifts_the_bursts_and_keeps_the_period():
    tag = CodedTag(wander=0.0)
    found = calibrate(record(tag, power_cycles=(301.0,)).of_code(117))
    assert found.stretches == 2
    assert found.by_line.period == pytest.approx(tag.period(117), abs=1e-8)
    assert found.clock.first_ping > 301.0


def test_arrivals_are_whole_ticks_to_five_decimals():
    time = record(CodedTag(), CodeReceiver()).time
    assert np.abs(time - np.round(time, 5)).max() < 1e-9
    assert np.abs(time - np.round(time * 4800) / 4800).max() <= 0.51e-5


def test_losses_have_their_shares():
    """10,000 bursts: three standard errors of a share of 0.1 are 0.009."""
    tag = CodedTag(codes=SIX, burst_period=2.0)
    missed = record(tag, CodeReceiver(missed=0.1, misread=0.0), duration=20_000.0)
    assert missed.code.size / 30_000 == pytest.approx(0.9, abs=0.009)
    misread = record(tag, CodeReceiver(missed=0.0, misread=0.1), duration=20_000.0)
    steps = np.diff(misread.of_code(117))
    assert np.mean(steps[steps < 1.0]) == pytest.approx(0.04876, abs=1e-4)  # the second code of a burst, read as the first
    assert np.sum(steps < 1.0) / 5_000 == pytest.approx(0.1, abs=0.013)


def test_a_wandering_clock_errs_with_the_power_of_three_halves():
    """wander * sqrt(t^3 / 3), within 10 %: 1,000 walks know a root mean square to 2 %."""
    generator = np.random.default_rng(0)
    walks = np.array([clock_wander(3e-10, 100.0, 400, generator) for _ in range(1000)])
    for steps in (100, 400):
        spread = np.sqrt(np.mean(walks[:, steps - 1] ** 2))
        assert spread == pytest.approx(3e-10 * np.sqrt((100.0 * steps) ** 3 / 3), rel=0.1)


def test_the_same_generator_gives_the_same_record_and_another_one_another():
    first, again, other = (record(CodedTag(), CodeReceiver(), seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.time, again.time)
    assert first.time[0] != other.time[0]


def test_a_record_survives_its_file(tmp_path):
    arrivals = record(CodedTag(), CodeReceiver())
    write_arrivals(tmp_path / "arrivals.csv", arrivals)
    read = read_arrivals(tmp_path / "arrivals.csv")
    np.testing.assert_allclose(read.time, arrivals.time, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(read.code, arrivals.code)


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda: CodedTag(codes=(1, 2, 3, 4)), "CodedTag.codes must be five or six different numbers"),
        (lambda: CodedTag(codes=(1, 2, 3, 4, 5, 5)), "CodedTag.codes must be five or six different numbers"),
        (lambda: CodedTag(burst_period=-2.0), "CodedTag.burst_period must be positive, got -2.0"),
        (lambda: CodedTag(code_spacing=0.9), "CodedTag.code_spacing must be below a third"),
        (lambda: CodedTag(wander=-1e-9), "CodedTag.wander must be at least 0"),
        (lambda: CodedTag().period(7), "the tag has no code 7; it has 117, 121"),
        (lambda: CodeReceiver(missed=1.2), "CodeReceiver.missed must be within 0 to 1, got 1.2"),
        (lambda: CodeReceiver(tick=0.0), "CodeReceiver.tick must be positive"),
        (lambda: CodeReceiver(jitter=-1e-5), "CodeReceiver.jitter must be at least 0"),
        (lambda: record(CodedTag(), duration=-5.0), "within the record of -5 s"),
        (lambda: record(CodedTag(), power_cycles=(700.0,)), r"within the record of 600 s, got \[700.0\]"),
    ],
)
def test_wrong_numbers_are_refused(make, complaint):
    with pytest.raises(ValueError, match=complaint):
        make()


def test_sound_from_a_moving_tag_is_under_way_for_as_long_as_it_was_far_when_it_was_sent():
    """At 3 m/s away from the receiver a period of 4 s is stretched by 12 m / 1500 m/s = 8 ms."""
    exact = CodeReceiver(jitter=0.0, tick=1e-9, resolution=1e-9, missed=0.0, misread=0.0)
    tag = CodedTag(wander=0.0)

    def arrivals(distance):
        return simulate_arrivals(tag, exact, duration=60.0, generator=np.random.default_rng(0), distance=distance).of_code(117)

    np.testing.assert_allclose(np.diff(arrivals(lambda time: 3.0 * time)), tag.period(117) * (1 + 3 / 1500), atol=1e-8)
    np.testing.assert_allclose(arrivals(lambda time: np.full(time.shape, 75.0)), arrivals(75.0), atol=1e-12)
