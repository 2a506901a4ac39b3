"""Clocks of moored receivers from sync tags: the four steps of Masmitja et al. 2020 ("Receiver clock drift adjustment").

Steps i (a line through the initial points) and ii (a polynomial through all) put the receptions of two receivers together
(``clock_coarse.py``). Steps iii (polynomials by segment) and iv (offsets from distances, or from d_ij = d_ji) are one fit of all
receivers (``clock_fit.py``). What is left out of it is counted, never dropped in silence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.clock_coarse import CoarseClocks, coarse_clocks
from tagtrack.eval.field.static_array.clock_fit import Fit, Receptions, fit_clocks
from tagtrack.eval.field.static_array.clock_model import ClockModel, correct
from tagtrack.eval.field.static_array.clock_segments import WHOLE, fit_by_segments
from tagtrack.eval.field.static_array.detections import Detections, shorten
from tagtrack.eval.field.static_array.matching import DEFAULT_WINDOW, group_pings
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.static_array.travel import SyncTag, travel_times

__all__ = ["ClockModel", "SyncSetting", "SyncTag", "Synchronization", "correct", "synchronize"]

NOTHING_SHARED = "shares too few pings of sync tags with the others, or none that stand out"


@dataclass(frozen=True, kw_only=True)
class SyncSetting:
    """What the fit assumes."""

    sound_speed: float = 1500.0  # [m/s]
    degree: int = 3  # of the polynomials (N of Eq. 18)
    segment: float | None = None  # length of a segment [s], infinite for one polynomial; None: as the data ask for
    window: float = DEFAULT_WINDOW  # of a ping after the coarse correction [s]
    largest_offset: float = 600.0  # between two raw clocks [s]; below half the interval of tags that ping regularly

    def __post_init__(self) -> None:
        for name in ("sound_speed", "segment", "window", "largest_offset"):
            value = getattr(self, name)
            endless = name == "segment" and value == WHOLE
            if value is not None and not endless and not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive, got {value!r}")
        if not 1 <= self.degree <= 9:
            raise ValueError(f"the degree of a clock's polynomial must be 1 to 9, got {self.degree}")


@dataclass(frozen=True, kw_only=True)
class Synchronization:
    """Clocks, and the N receptions of sync tags they rest on."""

    reference: str
    models: Mapping[str, ClockModel]  # by receiver, the reference among them
    excluded: Mapping[str, str]  # receivers without a clock, and why
    receivers: tuple[str, ...]  # that the receptions' numbers mean
    tags: tuple[str, ...]
    receptions: Receptions
    uncorrected: Floats  # (N,) raw time less what it should be on the reference's clock [s]
    straightened: Floats  # (N,) the same after step i [s]
    residual: Floats  # (N,) the same at the end [s]
    used: NDArray[np.bool_]  # (N,): False for outliers
    echoes: int  # later arrivals of a ping at the same receiver
    alone: int  # receptions of sync tags that no second receiver shared
    sigma: float  # of one reception, with what was fitted taken into account [s]
    segment: float  # length of the segments that got a polynomial each [s]; infinite for one

    @property
    def rms(self) -> float:
        """Of the residuals, without outliers [s]."""
        return float(np.sqrt(np.mean(self.residual[self.used] ** 2)))


def synchronize(
    detections: Detections,
    sync_tags: Sequence[SyncTag],
    places: Mapping[str, Floats] | None = None,
    setting: SyncSetting | None = None,
    *,
    reference: str | None = None,
    progress: Callable[[str, int], None] = lambda step, done: None,
) -> Synchronization:
    """Find the clock of every receiver that shares pings of sync tags with others.

    Args:
        detections: on raw clocks; only those of ``sync_tags`` are used.
        places: (2,) of receivers, by name [m]. Without them travel times are fitted too, which takes sync tags beside receivers.
        reference: receiver whose clock is the time; by default, of those with a tag of their own, the one whose clock is in the
            middle.
            No clock knows the true time: all that is corrected is as late or early as this one.
        progress: told a step's name and how much of it is done.
    Raises:
        ValueError: if no receiver shares recognisable pings with another (or with the reference), or if the data leave an
            offset open because neither places nor two-way times are known.
    """
    setting = setting or SyncSetting()
    sync = _of_sync_tags(detections, sync_tags)
    if reference is not None and reference not in sync.receivers:
        raise ValueError(f"no detection by the reference {reference!r}; receivers are {shorten(sync.receivers)}")
    travel = travel_times(sync.tags, sync.receivers, sync_tags, places or {}, setting.sound_speed)
    coarse = coarse_clocks(
        sync,
        reference=reference,
        tagged=[tag.receiver for tag in sync_tags if tag.receiver is not None],
        degree=setting.degree,
        largest_offset=setting.largest_offset,
        progress=progress,
    )
    if not coarse.pairs:
        raise ValueError(f"{coarse.reference} {NOTHING_SHARED}: clocks cannot be compared")
    receptions, echoes, alone = match_receptions(sync, coarse, setting.window)
    root = sync.receivers.index(coarse.reference)
    if setting.segment is None:
        segment, fit = fit_by_segments(receptions, travel, root, degree=setting.degree)
    else:
        segment = setting.segment
        fit = fit_clocks(receptions, travel, root, degree=setting.degree, segment=segment)
    progress("fit", 1)
    if fit.undetermined:
        names = shorten(tuple(sync.receivers[index] for index in fit.undetermined))
        raise ValueError(f"the offsets of {names} cannot be told from travel times; give places, or sync tags beside receivers")
    models = _models(sync.receivers, root, receptions, fit)
    uncorrected, straightened = _earlier_residuals(sync.receivers, receptions, coarse, models, fit.residual)
    return Synchronization(
        reference=coarse.reference,
        models=models,
        excluded={name: NOTHING_SHARED for name in detections.receivers if name not in models},
        receivers=sync.receivers,
        tags=sync.tags,
        receptions=receptions,
        uncorrected=uncorrected,
        straightened=straightened,
        residual=fit.residual,
        used=fit.used,
        echoes=echoes,
        alone=alone,
        sigma=float(np.sqrt(np.sum(fit.residual[fit.used] ** 2) / max(fit.freedom, 1))),
        segment=segment,
    )


def match_receptions(sync: Detections, coarse: CoarseClocks, window: float) -> tuple[Receptions, int, int]:
    """Receptions of sync tags that two receivers or more share; how many were echoes, and how many one receiver heard alone."""
    time = np.full(sync.time.size, np.nan)
    for index, name in enumerate(sync.receivers):
        rows = sync.receiver == index
        if name in coarse.receivers:
            time[rows] = coarse.correct(name, sync.time[rows])
    kept, pings, echoes, alone, opened = [], [], 0, 0, 0
    for tag in range(len(sync.tags)):
        rows = np.flatnonzero((sync.tag == tag) & np.isfinite(time))
        rows = rows[np.argsort(time[rows], kind="stable")]
        ping = group_pings(time[rows], window)
        _, first = np.unique(ping * len(sync.receivers) + sync.receiver[rows], return_index=True)
        shared = np.bincount(ping[first], minlength=1)[ping[first]] > 1
        echoes += rows.size - first.size
        alone += int(np.sum(~shared))
        kept.append(rows[first[shared]])
        pings.append(opened + ping[first[shared]])
        opened += int(ping.max(initial=-1)) + 1
    chosen = np.concatenate(kept)
    receptions = Receptions(
        ping=np.unique(np.concatenate(pings), return_inverse=True)[1].reshape(-1),
        receiver=sync.receiver[chosen],
        tag=sync.tag[chosen],
        time=sync.time[chosen],
        coarse=time[chosen],
    )
    return receptions, echoes, alone


def _of_sync_tags(detections: Detections, sync_tags: Sequence[SyncTag]) -> Detections:
    """Detections of the sync tags, under a list of tags that holds no others."""
    wanted = {sync.tag for sync in sync_tags}
    codes = [index for index, tag in enumerate(detections.tags) if tag in wanted]
    kept = detections.take(np.isin(detections.tag, codes))
    if not kept.time.size:
        raise ValueError(f"no detection of a sync tag ({shorten(tuple(wanted))}); there are {shorten(detections.tags)}")
    return Detections(
        time=kept.time,
        receiver=kept.receiver,
        tag=np.searchsorted(codes, kept.tag).astype(np.int32),
        receivers=kept.receivers,
        tags=tuple(detections.tags[code] for code in codes),
    )


def _models(receivers: Sequence[str], reference: int, receptions: Receptions, fit: Fit) -> dict[str, ClockModel]:
    """The clocks of the receivers that were fitted, and of the reference."""
    models = {}
    for index in sorted({reference, *fit.limits}):
        rows = receptions.receiver == index
        used = rows & fit.used
        time = receptions.time[rows]
        models[receivers[index]] = ClockModel(
            receiver=receivers[index],
            reference=receivers[reference],
            limits=fit.limits.get(index, np.array([time.min(), time.max()])),
            coefficients=fit.coefficients.get(index, np.zeros((1, 2))),
            points=int(used.sum()),
            outliers=int(rows.sum() - used.sum()),
            rms=float(np.sqrt(np.mean(fit.residual[used] ** 2))) if used.any() else 0.0,
        )
    return models


def _earlier_residuals(
    receivers: Sequence[str], receptions: Receptions, coarse: CoarseClocks, models: Mapping[str, ClockModel], final: Floats
) -> tuple[Floats, Floats]:
    """What the final residuals (N,) were on raw clocks, and after step i [s]."""
    uncorrected, straightened = final.copy(), final.copy()
    for index, name in enumerate(receivers):
        if name in models:
            rows = receptions.receiver == index
            time = receptions.time[rows]
            uncorrected[rows] += models[name].offset(time)
            straightened[rows] += coarse.correct(name, time, initial=True) - models[name].correct(time)
    return uncorrected, straightened
