"""Clocks that step: set anew, or begun anew with a battery. A receiver is then two, before and after, each with its own clock.

A large step shows as an end of what can be matched, a small one as a fit that no smooth clock explains: two straight pieces do
much better than the model does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tagtrack.eval.field.static_array.clock_segments import WHOLE
from tagtrack.eval.field.static_array.clocks import Synchronization, SyncSetting
from tagtrack.eval.field.static_array.detections import Detections, Floats

LEAST_STEP = 5e-3  # [s]: 7.5 m of sound; less is within what temperature does to a clock
LEAST_POINTS = 12  # receptions on either side of a step
UNMATCHED = 3600.0  # time beyond the last reception that could be matched, with detections in it, that tells of a step [s]
MOST_STEPS = 6
BETTER = 6.0  # by which two pieces must fit better than the smooth clock (mean square)

Synchronize = Callable[[Detections, Mapping[str, Floats], SyncSetting], Synchronization]


@dataclass(frozen=True, kw_only=True)
class Step:
    """A clock that was set anew."""

    receiver: str  # the name after it; ``R2 (2)`` is R2 after its first step
    original: str
    after: float  # by the receiver's own clock, between this time and the next [s]
    before: float
    size: float  # by which it is further ahead afterwards [s]; NaN where that is not known


def synchronize_in_pieces(
    detections: Detections, places: Mapping[str, Floats], synchronize: Synchronize, setting: SyncSetting
) -> tuple[Synchronization, Detections, list[Step]]:
    """Synchronize; where a clock seems to step, again with the receiver as two.

    Steps are looked for with one polynomial where the setting leaves segments to the data: fine ones would bend along a step.

    Returns:
        The synchronization, the detections with the names of its receivers, and the steps in order of time.
    """
    stiff = replace(setting, segment=WHOLE) if setting.segment is None else setting
    found = synchronize(detections, places, stiff)
    steps: list[Step] = []
    while len(steps) < MOST_STEPS:
        suspect = _find_step(found, detections, [step.receiver for step in steps])
        if suspect is None:
            break
        name, after, before = suspect
        new = _next_name(name, detections)
        parted = _part(detections, name, new, after)
        original = name.partition(" (")[0]
        nearby = {**places, new: places[name]} if name in places else places
        try:
            again = synchronize(parted, nearby, stiff)
        except ValueError:
            break
        if new not in again.models or name not in again.models:
            break
        size = float(again.models[new].offset(np.array([before]))[0] - again.models[name].offset(np.array([after]))[0])
        if abs(size) < LEAST_STEP:
            break
        steps.append(Step(receiver=new, original=original, after=after, before=before, size=size))
        found, detections, places = again, parted, nearby
    if setting.segment is None:
        found = synchronize(detections, places, setting)
    return found, detections, sorted(steps, key=lambda step: step.after)


def under_original_names(detections: Detections, steps: list[Step]) -> Detections:
    """The same detections with the pieces of a receiver as one again."""
    original = {step.receiver: step.original for step in steps}
    names = [original.get(name, name) for name in detections.receivers]
    kept = tuple(dict.fromkeys(names))
    number = np.array([kept.index(name) for name in names], np.int32)
    return replace(detections, receiver=number[detections.receiver], receivers=kept)


def _find_step(found: Synchronization, detections: Detections, parted: list[str]) -> tuple[str, float, float] | None:
    """The clearest step: receiver, and the times on its clock between which it is."""
    ends: list[tuple[float, str, float, float]] = []
    bends: list[tuple[float, str, float, float]] = []
    for index, name in enumerate(found.receivers):
        if name not in found.models or name == found.reference:
            continue
        own = detections.time[detections.receiver == detections.receivers.index(name)]
        limits = found.models[name].limits
        late, early = own[own > limits[-1]], own[own < limits[0]]
        for rows, gap in ((late, late.max(initial=limits[-1]) - limits[-1]), (early, limits[0] - early.min(initial=limits[0]))):
            if rows.size >= LEAST_POINTS and gap > UNMATCHED:
                edge = (limits[-1], float(rows.min())) if rows is late else (float(rows.max()), limits[0])
                ends.append((gap, name, *map(float, edge)))
        bend = _find_bend(found, index, name)
        if bend is not None:
            bends.append(bend)
    return max(ends)[1:] if ends else max(bends)[1:] if bends else None


def _find_bend(found: Synchronization, index: int, name: str) -> tuple[float, str, float, float] | None:
    """Where two straight pieces explain a clock so much better than its model that it must have stepped."""
    rows = np.flatnonzero(found.receptions.receiver == index)
    rows = rows[np.argsort(found.receptions.time[rows], kind="stable")]
    if rows.size < 2 * LEAST_POINTS:
        return None
    time = found.receptions.time[rows]
    offset = found.models[name].offset(time) + found.residual[rows]
    t = (time - time[0]) / max(time[-1] - time[0], 1.0)
    left, right = _line_costs(t, offset), _line_costs(1.0 - t[::-1], offset[::-1])[::-1]
    places = np.arange(LEAST_POINTS, rows.size - LEAST_POINTS)
    both = left[places - 1] + right[places]
    k = int(places[both.argmin()])
    smooth = float(np.sum(found.residual[rows] ** 2))
    before, after = (np.polyval(np.polyfit(t[part], offset[part], 1), t[k]) for part in (slice(0, k), slice(k, None)))
    if smooth < BETTER * both.min() or abs(after - before) < LEAST_STEP:
        return None
    return smooth / max(float(both.min()), 1e-12), name, float(time[k - 1]), float(time[k])


def _line_costs(t: Floats, y: Floats) -> Floats:
    """Sum of squares about a line through the first k + 1 points, for each k."""
    n = np.arange(1, len(t) + 1)
    y = y - y[0]
    st, sy, stt, sty, syy = (np.cumsum(each) for each in (t, y, t * t, t * y, y * y))
    var, cov, own = stt - st * st / n, sty - st * sy / n, syy - sy * sy / n
    with np.errstate(divide="ignore", invalid="ignore"):
        explained = np.where(var > 1e-15, cov * cov / var, 0.0)
    return np.maximum(own - explained, 0.0)


def _next_name(name: str, detections: Detections) -> str:
    base, number = name.partition(" (")[0], 2
    while f"{base} ({number})" in detections.receivers:
        number += 1
    return f"{base} ({number})"


def _part(detections: Detections, name: str, new: str, after: float) -> Detections:
    """The detections of a receiver later than a time on its clock, under another name."""
    receiver = detections.receiver.copy()
    later = (receiver == detections.receivers.index(name)) & (detections.time > after)
    receiver[later] = len(detections.receivers)
    return replace(detections, receiver=receiver, receivers=(*detections.receivers, new))
