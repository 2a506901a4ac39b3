"""Receivers whose clocks were set, or whose files were exported, in another time zone: whole or half hours off the others.

Raw clocks may be off by minutes, and nobody confuses these with a zone. Found is what fits when moved by a zone's difference, and
hardly at all as it stands.
"""

from __future__ import annotations

import numpy as np

from tagtrack.eval.field.static_array.detections import Detections, Floats, shorten

HOURS = np.arange(-14.0, 14.25, 0.5)
TOLERANCE = 2.0  # [s] between two receptions of one ping
SAMPLE = 2000  # detections of a receiver that are looked at
MOST_IN_POOL = 8  # receivers against which another is held
MOST_EACH = 100_000  # detections of each of these
LEAST_SHARE, CLEARER, LEAST_MATCHES = 0.3, 4.0, 20  # of the sample that fit; over those as they stand; in number


def hours_ahead(detections: Detections) -> dict[str, float]:
    """By how many hours the times of some receivers are ahead of those of the others, by name; empty where all agree.

    The receiver that heard most, and those that agree with it, are the others.
    """
    order = np.argsort(-np.bincount(detections.receiver, minlength=len(detections.receivers)), kind="stable")
    span = float(np.ptp(detections.time)) + 4 * 3600.0 * HOURS[-1] if detections.time.size else 0.0
    key = detections.time - detections.time.min(initial=np.inf) + span * detections.tag  # one line of time for each tag
    pool, others, reach = np.empty(0), 0, np.inf
    found: dict[str, float] = {}
    for receiver in order:
        own = np.sort(key[detections.receiver == receiver])
        own = own[own <= reach]
        if not own.size:
            continue
        interval = float(np.median(np.diff(own))) if own.size > 1 else 0.0
        ahead = _best_shift(own[:: -(-own.size // SAMPLE)], pool, interval) if others else 0.0
        if ahead:
            found[detections.receivers[receiver]] = ahead
        elif others < MOST_IN_POOL:
            pool, others, reach = np.sort(np.concatenate([pool, own[:MOST_EACH]])), others + 1, own[:MOST_EACH][-1]
    return found


def _best_shift(own: Floats, pool: Floats, interval: float) -> float:
    """By how many hours times (K,) are ahead of a pool (P,) that they fit then; 0 where they fit as they stand, or nowhere."""
    as_it_stands = _share(own, pool)
    if as_it_stands >= LEAST_SHARE:
        return 0.0
    share = np.array([_share(own - 3600.0 * hours, pool) for hours in HOURS])
    best = int(share.argmax())
    # A tag that pings regularly fits as well one interval on, whatever the clocks: it tells no zone.
    further = _share(own - 3600.0 * HOURS[best] + interval, pool)
    clear = share[best] > CLEARER * max(np.delete(share, best).max(), further)
    return float(HOURS[best]) if share[best] >= LEAST_SHARE and clear and share[best] * own.size >= LEAST_MATCHES else 0.0


def _share(own: Floats, pool: Floats) -> float:
    """Of times (K,) that have one of the pool (P,) within ``TOLERANCE``."""
    return float(np.mean(np.searchsorted(pool, own + TOLERANCE) > np.searchsorted(pool, own - TOLERANCE)))


def remark_on_zones(detections: Detections) -> list[str]:
    """A sentence for each difference of zones that was found."""
    found = hours_ahead(detections)
    remarks = []
    for hours in sorted(set(found.values())):
        names = [name for name, each in found.items() if each == hours]
        listed = shorten(tuple(names))
        way = "ahead of" if hours > 0 else "behind"
        much = f"{abs(hours):g} h {way} those of the other receivers"
        remarks.append(f"times of {listed} are {much}, as if in another time zone: export all in UTC")
    return remarks
