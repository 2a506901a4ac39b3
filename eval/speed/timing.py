"""How fast something steps, beside a reference that is timed in turn with it, so that a busy machine slows both alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import perf_counter

Step = Callable[[], object]


@dataclass(frozen=True, kw_only=True)
class Pace:
    """Steps per second of a thing and of the reference, and their ratio; each the median over the rounds."""

    steps_per_s: float
    reference_steps_per_s: float
    ratio: float


def time_in_turn(step: Step, reference: Step, *, rounds: int, seconds: float) -> Pace:
    """Time two things in turn, each for a slice of time in every round.

    The ratio is the median of the rounds' ratios: within a round both meet the same machine, whatever else runs on it.

    Args:
        rounds: number of rounds. seconds: length of a slice [s].
    """
    chunk, reference_chunk = calls_within(step, seconds / 10), calls_within(reference, seconds / 10)
    own, others = [], []
    for _ in range(rounds):
        others.append(steps_per_second(reference, reference_chunk, seconds))
        own.append(steps_per_second(step, chunk, seconds))
    return Pace(
        steps_per_s=median(own),
        reference_steps_per_s=median(others),
        ratio=median(a / b for a, b in zip(own, others, strict=True)),
    )


def calls_within(step: Step, seconds: float) -> int:
    """Calls that take about so long [s], at least one; the first call, which may compile, is not counted."""
    step()
    calls = 1
    while True:
        started = perf_counter()
        for _ in range(calls):
            step()
        taken = perf_counter() - started
        if taken >= seconds / 2:
            return max(1, int(calls * seconds / taken))
        calls *= 2


def steps_per_second(step: Step, chunk: int, seconds: float) -> float:
    """Rate of calls over at least so long [s]; the clock is read once for every ``chunk`` of them."""
    calls, started, taken = 0, perf_counter(), 0.0
    while taken < seconds:
        for _ in range(chunk):
            step()
        calls += chunk
        taken = perf_counter() - started
    return calls / taken
