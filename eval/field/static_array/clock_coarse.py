"""Coarse clocks of receivers from the pings that pairs of them share: steps i and ii of Masmitja et al. 2020.

Raw clocks can differ by more than a tag's interval, so it is not known which receptions belong together. Random intervals make
a fingerprint: of all differences between the receptions of a tag at two receivers, the true ones agree. They are voted for in the
first stretch where they stand out. A line goes through those initial points (step i), is followed through the rest, and a
polynomial goes through all that was found (step ii). What sound takes from a tag to two receivers is a constant of the tag.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tagtrack.eval.field.static_array.clock_model import ClockModel
from tagtrack.eval.field.static_array.detections import Codes, Detections
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.static_array.outliers import is_regular

BLOCK = 6 * 3600.0  # of one vote [s]; a clock that drifts by 30 ppm moves 0.65 s in it
VOTE_WINDOW = 1.0  # within which differences agree [s]: drift within a block, and sound across the array
FEWEST_VOTES = 8
TRAILING_BLOCKS = 8  # that the line is fitted to by which the next block is predicted
SMALLEST_CUT = 0.01  # nothing this near to a fit is left out of it [s]


@dataclass(frozen=True, kw_only=True)
class PairClock:
    """A receiver's clock against its neighbour's in the tree that leads to the reference."""

    neighbour: str
    line: ClockModel  # through the initial points (step i)
    curve: ClockModel  # through all of the pair (step ii)


@dataclass(frozen=True, kw_only=True)
class CoarseClocks:
    """The tree of pairs; receivers that are not in it share no ping that can be recognised."""

    reference: str
    pairs: Mapping[str, PairClock]  # by receiver, nearer to the reference first

    @property
    def receivers(self) -> tuple[str, ...]:
        """Those with a clock."""
        return (self.reference, *self.pairs)

    def correct(self, receiver: str, time: Floats, *, initial: bool = False) -> Floats:
        """Times on a receiver's clock as the reference's shows them [s], after step ii, or, ``initial``, after step i."""
        while receiver != self.reference:
            pair = self.pairs[receiver]
            time = (pair.line if initial else pair.curve).correct(time)
            receiver = pair.neighbour
        return time


@dataclass(frozen=True, kw_only=True)
class Differences:
    """All differences of receptions of the same tag at a receiver and a neighbour, true ones and chance ones, by time."""

    time: Floats  # (D,) of the reception at the receiver, on its clock [s]
    value: Floats  # (D,) that time less the one at the neighbour [s]
    tag: Codes  # (D,)

    def between(self, first: float, last: float) -> slice:
        """Those with first <= time < last."""
        return slice(*np.searchsorted(self.time, (first, last)).tolist())


@dataclass(frozen=True, kw_only=True)
class Seed:
    """Initial points: the true differences between a receiver and a neighbour in the block where they stand out."""

    begin: float  # of the block [s, the receiver's clock]
    lowest: float  # of the differences, which reach 1 s up from there [s]
    votes: int

    def turned(self) -> Seed:
        """The same for the neighbour's differences from the receiver."""
        return Seed(begin=self.begin - self.lowest, lowest=-self.lowest - VOTE_WINDOW, votes=self.votes)


def coarse_clocks(
    sync: Detections,
    *,
    reference: str | None = None,
    tagged: Collection[str] = (),
    degree: int = 3,
    largest_offset: float = 600.0,
    progress: Callable[[str, int], None] = lambda step, pairs: None,
) -> CoarseClocks:
    """Steps i and ii for all receivers that can be tied to the reference, directly or by others.

    Args:
        sync: detections of the sync tags on raw clocks.
        reference: receiver; by default the one whose clock is in the middle of those in ``tagged``, the receivers with a tag
            of their own (as in the paper), or of all if none has.
        degree: of the polynomials. largest_offset: that is searched between two clocks [s]; of tags that ping at a fixed
            interval no difference stands out unless this is below half of it. progress: told of each pair.
    """
    by_receiver = [sync.take(sync.receiver == index) for index in range(len(sync.receivers))]
    seeds: dict[tuple[int, int], Seed] = {}
    for one, other in combinations(range(len(by_receiver)), 2):
        seed = vote(pair_differences(by_receiver[other], by_receiver[one], largest_offset))
        if seed is not None:
            seeds[one, other] = seed
        progress("votes", 1)
    own = {sync.receivers.index(name) for name in tagged if name in sync.receivers}
    root = _middle_clock(seeds, own) if reference is None else sync.receivers.index(reference)
    pairs: dict[str, PairClock] = {}
    for receiver, neighbour, seed in _tree(seeds, root):
        differences = pair_differences(by_receiver[receiver], by_receiver[neighbour], largest_offset)
        name = sync.receivers[receiver]
        pairs[name] = _pair_clock(name, sync.receivers[neighbour], differences, seed, degree)
    return CoarseClocks(reference=sync.receivers[root], pairs=pairs)


def _tree(seeds: Mapping[tuple[int, int], Seed], root: int) -> list[tuple[int, int, Seed]]:
    """Receiver, neighbour nearer to the root, and their initial points: all that can be reached, over pairs with most votes."""
    tied, branches = {root}, []
    while leaving := [pair for pair in seeds if (pair[0] in tied) != (pair[1] in tied)]:
        neighbour, receiver = best = max(leaving, key=lambda pair: seeds[pair].votes)
        seed = seeds[best]
        if receiver in tied:
            neighbour, receiver, seed = receiver, neighbour, seed.turned()
        branches.append((receiver, neighbour, seed))
        tied.add(receiver)
    return branches


def _middle_clock(seeds: Mapping[tuple[int, int], Seed], preferred: Collection[int]) -> int:
    """Of the receivers tied to the one with most votes, that whose clock is in the middle: least likely to be set wrong."""
    votes: Counter[int] = Counter()
    for pair, seed in seeds.items():
        votes.update(dict.fromkeys(pair, seed.votes))
    if not votes:
        return 0
    ahead = {votes.most_common(1)[0][0]: 0.0}
    for receiver, neighbour, seed in _tree(seeds, next(iter(ahead))):
        ahead[receiver] = ahead[neighbour] + seed.lowest + VOTE_WINDOW / 2
    candidates = [receiver for receiver in ahead if receiver in preferred] or list(ahead)
    return sorted(candidates, key=lambda receiver: ahead[receiver])[(len(candidates) - 1) // 2]


def pair_differences(receiver: Detections, neighbour: Detections, largest: float) -> Differences:
    """Every reception at ``receiver`` less every one of the same tag at ``neighbour``, up to ``largest`` apart [s]."""
    time, value, tag = [np.empty(0)], [np.empty(0)], [np.empty(0, dtype=np.int32)]
    for code in np.intersect1d(receiver.tag, neighbour.tag):
        here, there = (np.sort(side.time[side.tag == code]) for side in (receiver, neighbour))
        first = np.searchsorted(there, here - largest, side="left")
        count = np.searchsorted(there, here + largest, side="right") - first
        row = np.repeat(np.arange(here.size), count)
        column = np.arange(row.size) - np.repeat(np.cumsum(count) - count - first, count)
        time.append(here[row])
        value.append(here[row] - there[column])
        tag.append(np.full(row.size, code, dtype=np.int32))
    order = np.argsort(np.concatenate(time), kind="stable")
    return Differences(time=np.concatenate(time)[order], value=np.concatenate(value)[order], tag=np.concatenate(tag)[order])


def vote(differences: Differences) -> Seed | None:
    """Where the difference of two clocks first stands out: 8 votes within 1 s, and twice those of any other difference.

    None where it never does.
    """
    if not differences.time.size:
        return None
    for begin in np.arange(differences.time[0], differences.time[-1] + 1.0, BLOCK):
        value = np.sort(differences.value[differences.between(begin, begin + BLOCK)])
        if value.size < FEWEST_VOTES:
            continue
        votes = np.searchsorted(value, value + VOTE_WINDOW, side="right") - np.arange(value.size)
        best = int(np.argmax(votes))
        elsewhere = np.abs(value - value[best]) > 2 * VOTE_WINDOW
        if votes[best] >= max(FEWEST_VOTES, 2 * votes[elsewhere].max(initial=0)):
            return Seed(begin=float(begin), lowest=float(value[best]), votes=int(votes[best]))
    return None


def follow(differences: Differences, seed: Seed) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The true differences, by index: the initial ones, in the block of the vote, and all.

    From the initial block on, forward and backward, a line through the last 2 days found predicts the next block.
    """
    rows = np.arange(differences.time.size)
    initial = rows[differences.between(seed.begin, seed.begin + BLOCK)]
    above = differences.value[initial] - seed.lowest
    initial = initial[(above >= 0) & (above <= VOTE_WINDOW)]
    found = [initial]
    for step in (BLOCK, -BLOCK):
        recent, start = [initial], seed.begin + step
        while differences.time[0] - BLOCK < start <= differences.time[-1]:
            past = np.concatenate(recent[-TRAILING_BLOCKS:])
            origin, coefficients = fit_within_tags(differences, past, 1)
            block = rows[differences.between(start, start + BLOCK)]
            predicted = np.polynomial.polynomial.polyval(differences.time[block] - origin, coefficients)
            block = block[np.abs(differences.value[block] - predicted) <= VOTE_WINDOW / 2]
            if block.size:
                recent.append(block)
            start += step
        found += recent[1:]
    return initial, np.unique(np.concatenate(found))


def fit_within_tags(differences: Differences, rows: NDArray[np.intp], degree: int) -> tuple[float, Floats]:
    """A polynomial through differences that has one shape for all tags and a level of its own for each; here their mean level.

    What lies far off is left out and the fit repeated. Fewer than ten points for a coefficient lower the degree.

    Returns:
        origin [s] and coefficients of rising powers of the time since then [s^(1-n)].
    """
    origin = float(differences.time[rows].min())
    span = max(float(differences.time[rows].max()) - origin, 1.0)
    degree = min(degree, max(rows.size // 10, 1))
    for _ in range(5):
        time, value, tag = (differences.time[rows] - origin) / span, differences.value[rows], differences.tag[rows]
        powers = time[:, None] ** np.arange(1, degree + 1)
        levels = (tag[:, None] == np.unique(tag)).astype(np.float64)
        solution = np.linalg.lstsq(np.hstack([powers, levels]), value, rcond=None)[0]
        residual = value - np.hstack([powers, levels]) @ solution
        near = is_regular(residual, SMALLEST_CUT)
        shape = solution[:degree]
        level = float(np.mean(value - powers @ shape))
        if near.all():
            break
        rows = rows[near]
    return origin, np.concatenate([[level], shape / span ** np.arange(1, degree + 1)])


def _pair_clock(receiver: str, neighbour: str, differences: Differences, seed: Seed, degree: int) -> PairClock:
    """The line through the initial points of a pair, and the curve through all."""
    models = []
    for rows, power in zip(follow(differences, seed), (1, degree), strict=True):
        origin, coefficients = fit_within_tags(differences, rows, power)
        limits = np.array([origin, float(differences.time[rows].max())])
        models.append(ClockModel(receiver=receiver, reference=neighbour, limits=limits, coefficients=coefficients[None]))
    return PairClock(neighbour=neighbour, line=models[0], curve=models[1])
