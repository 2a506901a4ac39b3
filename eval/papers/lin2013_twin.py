"""What the experiments of Lin et al. 2013 share: the two tags, records beside the hydrophone, and the clock that these give."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tagtrack.envs.sensors import Measurements, Sensor, TimeOfFlightReceiver
from tagtrack.eval.field.tag_clock.calibration import calibrate
from tagtrack.eval.field.tag_clock.coded_tag import CodedTag, CodeReceiver, simulate_arrivals
from tagtrack.eval.field.tag_clock.time_of_flight import TagClock

CODE = 117  # of both tags
TAGS = {
    "55436": CodedTag(),
    "55488": CodedTag(codes=(117, 2, 3, 4, 5), burst_period=1.99988),  # of five codes 117 is in every burst
}
CALIBRATION = 100 * 60.0  # [s]: "roughly 100 minutes" (IV.B.1)
SPEED = 1500.0  # [m/s]: the paper's approximation (Fig. 6)

Floats = NDArray[np.float64]


def generators(seed: int, records: int, stream: int) -> Iterator[np.random.Generator]:
    """One for each record; ``stream`` keeps experiments apart."""
    for record in range(records):
        yield np.random.default_rng([seed + record, stream])


def record_beside(tag: CodedTag, duration: float, generator: np.random.Generator) -> Floats:
    """Arrivals of the code [s] with the tag beside the hydrophone."""
    return simulate_arrivals(tag, CodeReceiver(), duration=duration, generator=generator).of_code(CODE)


def paper_clock(arrival: Floats) -> TagClock:
    """The clock as the paper finds it: T_c as the mean of differences, t_0 as the first arrival (IV.B)."""
    return TagClock(period=calibrate(arrival).by_differences.period, first_ping=float(arrival[0]))


def bursts(tag: CodedTag, duration: float) -> int:
    """How many a record holds: what progress is counted in."""
    return round(duration / tag.burst_period)


def with_measurements(receiver: Sensor, measurements: Measurements) -> Sensor:
    """The receiver of a belief that weighs by these readings."""
    assert isinstance(receiver, TimeOfFlightReceiver)
    return replace(receiver, measurements=measurements)
