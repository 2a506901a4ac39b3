"""The particle filter as an object of its own: it begins, predicts over any time, corrects with any measurements, and summarizes.

It lives on measurements alone, wherever they come from, and knows of no fish. A measurement that comes late is dealt with by
going back to the state before it and replaying what came since: because every draw is keyed by its step, the belief is then, bit
for bit, what it would have been had the measurement come in time.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tagtrack.envs.belief.assumptions import Belief, filter_rule
from tagtrack.envs.belief.row import (
    BELIEF,
    Scratch,
    begin_listeners,
    begin_row,
    correct_row,
    make_scratch,
    predict_row,
)
from tagtrack.envs.belief.summary import covariance, summarize
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import stream_of
from tagtrack.envs.kernels.records import to_record
from tagtrack.envs.measurement import LISTENER, MEASUREMENT, NAVIGATION, Status
from tagtrack.envs.tag import Tag
from tagtrack.envs.workers import Workers

LARGEST = 1e10  # of times [s], places [m] and readings: beyond, float64 loses what matters, and nobody means it
SAME_TIME = 1e-9  # two times nearer than this are one [s]

# What keys the draws of a row: seed, episode and step as in a world, and the row's place among the rows of one world. The place
# stands first, lest numba take a key for a kind of a world's clock, and warn.
KEY = np.dtype([("place", np.int64), ("seed", np.uint64), ("episode", np.uint64), ("step", np.int64)])


class Rows(NamedTuple):
    """The whole state of R beliefs that hear of V vehicles."""

    key: np.ndarray  # (R,) KEY
    particles: np.ndarray  # (R, 4 or 5, N) float32
    carried: np.ndarray  # (R, N or 0) float32: weights that the particles carry; none where every correction resamples
    beliefs: np.ndarray  # (R,) BELIEF
    listeners: np.ndarray  # (R, V) LISTENER
    about: np.ndarray  # (R,) NAVIGATION: where the vehicle was that told the belief something last


@compiled
def begin_rows(first, last, parameters, time, rows, scratch):
    for r in range(first, last):
        rule, about = parameters[0], rows.about[r]
        stream = stream_of(rows.key[r])
        begin_row(
            rows.particles[r], rows.carried[r], rows.beliefs[r], about.x, about.y, stream, rows.key[r].place, rule, scratch
        )  # fmt: skip
        begin_listeners(rows.listeners[r], time, rule)


@compiled
def predict_rows(first, last, parameters, time_step, rows, scratch):
    for r in range(first, last):
        key = rows.key[r]
        key.step += 1
        predict_row(
            rows.particles[r], rows.carried[r], rows.beliefs[r], rows.listeners[r], stream_of(key), key.place, parameters[0],
            time_step, scratch,
        )  # fmt: skip


@compiled
def correct_rows(first, last, parameters, measurements, rows, scratch):
    """``measurements`` (R, V)."""
    for r in range(first, last):
        key = rows.key[r]
        correct_row(
            rows.particles[r], rows.carried[r], rows.beliefs[r], measurements[r], rows.listeners[r], stream_of(key), key.place,
            parameters[0], scratch,
        )  # fmt: skip
        for v in range(measurements.shape[1] - 1, -1, -1):
            if measurements[r, v].status != Status.ABSENT:
                rows.about[r].x = measurements[r, v].x
                rows.about[r].y = measurements[r, v].y
                rows.about[r].heading = measurements[r, v].heading


@compiled
def summarize_rows(first, last, parameters, rows, scratch):
    for r in range(first, last):
        about = rows.about[r]
        summarize(rows.particles[r], rows.carried[r], rows.beliefs[r], about.x, about.y, about.heading, parameters[0])


@dataclass
class Step:
    """A prediction and the correction after it, with the state before both."""

    time: float  # after the prediction [s]
    time_step: float
    measurements: np.ndarray  # (R, V) MEASUREMENT
    before: tuple[np.ndarray, ...] | None = None  # copies of ``Rows``
    divided: bool = False  # whether another part of the same step follows


class ParticleFilter:
    """R beliefs, each about one tag, that hear of V vehicles; by default one of each.

    >>> from tagtrack.envs.measurement import measurement
    >>> from tagtrack.envs.sensors import RangeReceiver
    >>> belief = ParticleFilter(Belief(receiver=RangeReceiver(), half_width=400.0), Tag(period=10.0))
    >>> belief.begin(x=0.0, y=0.0)
    >>> for k, slant_range in enumerate((250.0, 245.0, 242.0)):
    ...     belief.predict(10.0)
    ...     belief.correct(measurement(time=belief.time, x=10.0 * k, y=0.0, readings=[slant_range]))
    >>> belief.mean.shape
    (1, 2)

    Args:
        belief: what is assumed. tag: the schedule on which its tag pings.
        rows: R. vehicles: V, numbered from 0; each tells at most one measurement a step.
        tags: (R,) the tag that each row is about; 0 for all if None.
        remember: steps that can be gone back to for a measurement that comes late; each keeps a copy of all particles.
        threads: the rows are split among so many; results do not depend on it.
        state: arrays to keep the state in, for instance views of a larger one's; its own if None.
    Raises:
        ValueError: for a number out of range.
    """

    def __init__(
        self,
        belief: Belief,
        tag: Tag | None = None,
        *,
        rows: int = 1,
        vehicles: int = 1,
        tags: ArrayLike | None = None,
        remember: int = 0,
        threads: int = 1,
        state: Rows | None = None,
    ) -> None:
        least_of = {"rows": (rows, 1), "vehicles": (vehicles, 1), "remember": (remember, 0), "threads": (threads, 1)}
        for name, (value, least) in least_of.items():
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
                raise ValueError(f"{name} must be a whole number of at least {least}, got {value!r}")
        self.belief, self.tag = belief, tag or Tag()
        self.tags = np.zeros(rows, np.int64) if tags is None else np.asarray(tags, np.int64)
        if self.tags.shape != (rows,):
            raise ValueError(f"tags must name one tag for each of {rows} rows, got shape {self.tags.shape}")
        self.vehicles = vehicles
        self.rows = state or Rows(
            key=np.zeros(rows, KEY),
            particles=np.zeros((rows, belief.rows, belief.particles), np.float32),
            carried=np.ones((rows, belief.carried), np.float32),
            beliefs=np.zeros(rows, BELIEF),
            listeners=np.zeros((rows, vehicles), LISTENER),
            about=np.zeros(rows, NAVIGATION),
        )
        self.time = np.nan  # of the last prediction [s]; NaN before the beginning
        self._parameters = to_record(filter_rule(belief, self.tag))
        self._workers: Workers = Workers(rows, threads, lambda: make_scratch(belief.particles))
        self._remember = remember
        self._steps: deque[Step] = deque()
        self._corrected = False  # since the last prediction
        self._stale = False  # whether particles have changed since they were summarized

    @property
    def scratch(self) -> Scratch:
        """The rows that the first thread works in (for tests)."""
        return self._workers.scratch[0]

    def begin(
        self, x: ArrayLike, y: ArrayLike, *, time: float = 0.0, seed: ArrayLike = 0, episode: ArrayLike = 0, place: ArrayLike = 0
    ) -> None:
        """Scatter the first particles about the vehicle.

        Args:
            x, y: where it believes to be [m], for all rows or (R,). time: now [s].
            seed: of row 0, row r gets seed + r; or (R,). episode, place: further keys of the draws, for all rows or (R,).
        Raises:
            ValueError: for a place or time that is not finite.
        """
        for name, value in (("x", x), ("y", y), ("time", time)):
            if not np.isfinite(value).all():
                raise ValueError(f"{name} must be finite, got {value}")
        rows = self.rows
        rows.about["x"], rows.about["y"], rows.about["heading"] = x, y, 0.0
        seeds = np.asarray(seed, np.uint64)
        rows.key["seed"] = seeds + np.arange(rows.key.size, dtype=np.uint64) if seeds.ndim == 0 else seeds
        rows.key["episode"], rows.key["place"], rows.key["step"] = episode, place, 0
        self.time = float(time)
        self._steps.clear()
        self._corrected = True  # there is no step to correct yet
        self._workers.run(begin_rows, self._parameters, self.time, rows)
        self._stale = True
        self._refresh()

    def predict(self, time_step: float) -> None:
        """Let the particles swim for ``time_step`` seconds. Raises ValueError unless that is positive and finite."""
        self._require_begun()
        if not (np.isfinite(time_step) and time_step > 0):
            raise ValueError(f"time_step must be a positive number of seconds, got {time_step}")
        measurements = np.zeros((self.rows.key.size, self.vehicles), MEASUREMENT)
        self._predict(Step(self.time + float(time_step), float(time_step), measurements))

    def _predict(self, step: Step) -> None:
        self._refresh()  # compound resampling spreads particles about the last estimate
        if self._remember:
            step.before = tuple(array.copy() for array in self.rows)
        self._steps.append(step)
        while sum(not each.divided for each in self._steps) > max(self._remember, 1):
            self._steps.popleft()
        self._workers.run(predict_rows, self._parameters, step.time_step, self.rows)
        self.time = step.time
        self._corrected, self._stale = False, True

    def correct(self, measurements: np.ndarray) -> None:
        """Weigh the particles by what vehicles measured, now or, within ``remember`` steps, before.

        Args:
            measurements: (M,) of ``MEASUREMENT``, each for the rows about its tag; or (R, M), a row's own. Records of status
                ABSENT are passed over. One whose time lies between two predictions divides that step in two. A ping goes before
                what said that nothing was heard at that time.
        Raises:
            ValueError: for a time, pose, depth or reading that is not finite, an unknown tag, vehicle or status, a time to come
                or no longer remembered, or a second measurement of one vehicle at one time; the belief is left as it was.
        """
        self._require_begun()
        told = self._told(measurements)
        late = [each for each in told if each[0] < self.time - SAME_TIME]
        if not late and not self._corrected:
            self._place(self._steps[-1], told)
            self._correct(self._steps[-1])
        elif told:
            self._replay(told)

    def _told(self, measurements: np.ndarray) -> list[tuple[float, int, Any]]:
        """Time, row and record of all measurements that are there, checked."""
        given = np.asarray(measurements)
        if given.dtype != MEASUREMENT or given.ndim not in (1, 2):
            raise ValueError(f"measurements must be (M,) or (rows, M) of MEASUREMENT, got {given.dtype} of shape {given.shape}")
        if given.ndim == 2 and len(given) != len(self.tags):
            raise ValueError(f"measurements must have a row for each of {len(self.tags)}, got {len(given)}")
        told = []
        for place in np.argwhere(given["status"] != int(Status.ABSENT)):
            record: Any = given[tuple(place)]
            self._check(record)
            rows = [int(place[0])] if given.ndim == 2 else np.flatnonzero(self.tags == record["tag"]).tolist()
            if not all(self.tags[row] == record["tag"] for row in rows) or not rows:
                known = ", ".join(str(tag) for tag in np.unique(self.tags))
                raise ValueError(f"{_name(record)}: this belief is about tag {known}")
            told += [(float(record["time"]), row, record) for row in rows]
        return told

    def _check(self, record: Any) -> None:
        if record["status"] not in list(Status):
            raise ValueError(f"{_name(record)}: status must be one of {', '.join(Status.__members__)}, got {record['status']}")
        for name in ("time", "x", "y", "heading", "depth"):
            require_sensible(record[name], f"{_name(record)}: {name}")
        if not 0 <= record["vehicle"] < self.vehicles:
            raise ValueError(f"{_name(record)}: vehicles are numbered from 0 to {self.vehicles - 1}")
        if record["status"] == int(Status.HEARD):
            for place in self.belief.receiver.weighed:
                name = self.belief.receiver.readings[place]
                require_sensible(record["readings"][place], f"{_name(record)}: the reading {name!r}")
        if record["time"] > self.time + SAME_TIME:
            raise ValueError(f"{_name(record)} is from the future: the belief is at {self.time:g} s; predict first")
        oldest = self._steps[0].time - self._steps[0].time_step if self._steps else self.time
        if record["time"] <= oldest + SAME_TIME or (self._remember == 0 and record["time"] < self.time - SAME_TIME):
            least = oldest if self._remember else self.time
            raise ValueError(f"{_name(record)} is too old: the belief remembers what came after {least:g} s; raise remember")

    def _place(self, step: Step, told: list[tuple[float, int, Any]]) -> None:
        """Enter measurements into the step that they belong to."""
        taken = set()
        for _, row, record in told:
            there = step.measurements["status"][row, record["vehicle"]] not in (int(Status.ABSENT), int(Status.NOTHING))
            if there or (row, int(record["vehicle"])) in taken:
                raise ValueError(f"{_name(record)}: this vehicle has told another one of that time; predict to the time of each")
            taken.add((row, int(record["vehicle"])))
        for _, row, record in told:
            step.measurements[row, record["vehicle"]] = record

    def _correct(self, step: Step) -> None:
        self._workers.run(correct_rows, self._parameters, step.measurements, self.rows)
        self._corrected, self._stale = True, True

    def _replay(self, told: list[tuple[float, int, Any]]) -> None:
        """Go back to before the first of the measurements, and go on from there with all of them."""
        if not self._remember:
            raise ValueError(f"the belief was corrected at {self.time:g} s already; give all of one time together, or remember")
        steps = [replace(step, measurements=step.measurements.copy()) for step in self._steps]
        first = len(steps)
        for time in sorted({each[0] for each in told}):
            index = next(k for k, step in enumerate(steps) if time <= step.time + SAME_TIME)
            if time < steps[index].time - SAME_TIME:
                steps[index : index + 1] = _divide(steps[index], time)
            self._place(steps[index], [each for each in told if each[0] == time])
            first = min(first, index)
        for own, saved in zip(self.rows, steps[first].before or (), strict=True):
            np.copyto(own, saved)
        while len(self._steps) > first:
            self._steps.pop()
        self._stale = False  # a state is saved after it was summarized
        for step in steps[first:]:
            self._predict(step)
            self._correct(step)

    def _refresh(self) -> None:
        if self._stale:
            self._workers.run(summarize_rows, self._parameters, self.rows)
            self._stale = False

    def _require_begun(self) -> None:
        if np.isnan(self.time):
            raise RuntimeError("the belief has not begun; call begin first")

    @property
    def summary(self) -> np.ndarray:
        """(R,) of ``BELIEF``: what is reported of each row; the filter's own, copy what you keep."""
        if self._corrected:
            self._refresh()
            return self.rows.beliefs
        # A correction that is still to come spreads particles about the estimate from before the prediction: leave that one.
        seen = self.rows._replace(beliefs=self.rows.beliefs.copy())
        self._workers.run(summarize_rows, self._parameters, seen)
        return seen.beliefs

    @property
    def listeners(self) -> np.ndarray:
        """(R, V) of ``LISTENER``: silence, shares heard and last readings; the filter's own."""
        return self.rows.listeners

    @property
    def particles(self) -> np.ndarray:
        """(R, 4 or 5, N) float32; the filter's own."""
        return self.rows.particles

    @property
    def weights(self) -> np.ndarray:
        """(R, N) float32, with a mean of 1 in each row: all 1 unless the belief lets particles carry weights."""
        return self.rows.carried if self.belief.carried else np.ones((self.tags.size, self.belief.particles), np.float32)

    @property
    def mean(self) -> np.ndarray:
        """(R, 2) [m]."""
        summary = self.summary
        return np.stack([summary["mean_x"], summary["mean_y"]], axis=-1)

    @property
    def estimate(self) -> np.ndarray:
        """(R, 2) what the filter reports: the mean or the best particle [m]."""
        summary = self.summary
        return np.stack([summary["estimate_x"], summary["estimate_y"]], axis=-1)

    @property
    def covariance(self) -> np.ndarray:
        """(R, 2, 2) [m^2]."""
        return covariance(self.summary)

    def close(self) -> None:
        """End the threads."""
        self._workers.close()


def require_sensible(value: float, what: str) -> None:
    """Raise ValueError for a number that nobody can have measured."""
    if not np.isfinite(value):
        raise ValueError(f"{what} must be finite, got {value}")
    if abs(value) > LARGEST:
        raise ValueError(f"{what} must be within +-{LARGEST:g}, got {value}")


def _divide(step: Step, time: float) -> list[Step]:
    """The two parts of a step, the first of which ends at a time."""
    first = Step(time, time - (step.time - step.time_step), np.zeros_like(step.measurements), step.before, divided=True)
    return [first, Step(step.time, step.time - time, step.measurements, divided=step.divided)]


def _name(record: Any) -> str:
    return f"the measurement of tag {record['tag']} by vehicle {record['vehicle']} at {record['time']:g} s"
