"""Weighted least squares in closed form: the two steps of Chan and Ho 1994 (Masmitja et al. 2020, Eqs. 12-13), all pings at once.

Squaring r_i = r_0 + c mu_i0 makes the equations linear in the position and the range r_0 of a reference receiver, which the first
step takes as free. The second step restores r_0 = |q - b_0|: here a projection on that cone, to first order Chan and Ho's own,
without the roots of noisy squares that fail where a coordinate of q - b_0 is small. Eq. 13 prints the index 1 in every row.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tagtrack.eval.field.static_array.likelihood import Likelihood, inverse_or_nan, make_likelihood
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings, Positions

REWEIGHTINGS = 2  # Chan and Ho repeat the first step once or twice with the ranges it gave
PROJECTIONS = 3
OPEN = 0.25  # spans of the array: standard deviation of r_0 from which the cone alone tells it


def weighted_least_squares(
    pings: Pings, receivers: ArrayLike, setting: ArraySetting, *, information: Floats | None = None
) -> Positions:
    """Positions in closed form, with the bound at each as its covariance.

    Args:
        pings: arrivals (K, R) [s].
        receivers: (R, n) [m].
        information: (K, R, R) [1/s^2]; by default independent arrival errors of ``setting.sigma``.
    Returns:
        NaN where the hyperbolas do not cross or fewer than n + 1 receivers heard; also where the differences known do not link
        all receivers that heard, and in 3D where these lie in a plane: there the equations are not linear in the position.
    Raises:
        ValueError: if the shapes disagree.
    """
    likelihood = make_likelihood(pings, receivers, setting, information)
    return likelihood.positions(solve_in_closed_form(likelihood, setting.sigma))


def solve_in_closed_form(likelihood: Likelihood, sigma: float) -> Floats:
    """Positions (K, n) [m]; ``sigma`` [s] bounds how near a receiver the weights still grow."""
    used = np.diagonal(likelihood.information, axis1=1, axis2=2) > 0
    reference = np.where(used, likelihood.arrival, np.inf).argmin(axis=1)
    first = np.take_along_axis(likelihood.arrival, reference[:, None], axis=1)
    further = np.where(used, likelihood.sound_speed * (likelihood.arrival - first), 0.0)
    origin = likelihood.receivers[reference]
    baseline = np.where(used[..., None], likelihood.receivers - origin[:, None], 0.0)
    rise = np.zeros_like(further) if likelihood.rise is None else np.where(used, likelihood.rise, 0.0)

    smallest = likelihood.sound_speed * sigma  # nearer than this the squared error outgrows the linear one
    ranges = np.full(used.shape, likelihood.span)
    for _ in range(1 + REWEIGHTINGS):
        weight = likelihood.information / (ranges[:, :, None] * ranges[:, None, :] * likelihood.sound_speed**2)
        equations = _reduce(baseline, further, weight, rise, np.take_along_axis(rise, reference[:, None], axis=1))
        offset = equations.at(equations.best_range)
        ranges = np.fmax(np.hypot(np.linalg.norm(offset[:, None] - baseline, axis=-1), rise), smallest)
    # With n + 1 receivers, or in the middle of a regular array, the linear equations leave r_0 open: only the cone tells it.
    crossings = np.stack([origin + crossing for crossing in equations.cross()])
    position = np.where(
        equations.is_open(likelihood.span)[:, None], likelihood.choose(crossings), origin + equations.project(offset)
    )
    known = likelihood.known_differences
    linked = (known >= likelihood.dimensions) & (known == used.sum(axis=1) - 1)
    return np.where(linked[:, None], position, np.nan)


class _Equations(NamedTuple):
    """The linear equations of Eq. 12 solved for the position, as a line in r_0: q - b_0 = foot + slope r_0."""

    foot: Floats  # (K, n) [m]
    slope: Floats  # (K, n)
    spread: Floats  # (K, n, n) covariance of the position given r_0 [m^2]
    range_information: Floats  # (K,) of r_0 [1/m^2]
    best_range: Floats  # (K,) r_0 that fits the linear equations best [m]; any where its information is 0
    rise: Floats  # (K,) of the tag above the reference receiver, where it is known; else 0 [m]

    def at(self, reference_range: Floats) -> Floats:
        """q - b_0 (K, n) [m] for a range r_0 (K,)."""
        return self.foot + self.slope * reference_range[:, None]

    def is_open(self, span: float) -> NDArray[np.bool_]:
        """(K,): whether r_0 is hardly known, where the projection may slide along the line to the wrong crossing."""
        return ~(self.range_information > (OPEN * span) ** -2)

    def cross(self) -> tuple[Floats, Floats]:
        """Where the line meets the cone r_0 = |q - b_0| > 0, a hyperboloid at a known rise: two crossings (K, n), else NaN."""
        square = np.einsum("kn,kn->k", self.slope, self.slope) - 1
        half = np.einsum("kn,kn->k", self.foot, self.slope)
        rest = np.einsum("kn,kn->k", self.foot, self.foot) + self.rise**2
        with np.errstate(divide="ignore", invalid="ignore"):
            larger = -(half + np.copysign(np.sqrt(half**2 - square * rest), half))
            roots = larger / square, rest / larger
        first, second = (self.at(np.where(np.isfinite(root) & (root > 0), root, np.nan)) for root in roots)
        return first, second

    def project(self, offset: Floats) -> Floats:
        """The second step (K, n): the point of the cone that is nearest to the first in the metric of its errors."""
        count = offset.shape[1]
        first = np.concatenate([offset, self.best_range[:, None]], axis=1)
        along = np.concatenate([self.slope, np.ones((len(offset), 1))], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            covariance = along[:, :, None] * along[:, None, :] / self.range_information[:, None, None]
        covariance[:, :count, :count] += self.spread
        point = np.concatenate([offset, np.hypot(np.linalg.norm(offset, axis=1), self.rise)[:, None]], axis=1)
        with np.errstate(invalid="ignore"):
            for _ in range(PROJECTIONS):
                normal = np.concatenate([-point[:, :count], point[:, count:]], axis=1)
                lever = np.einsum("kab,kb->ka", covariance, normal)
                short = 0.5 * (np.einsum("ka,ka->k", normal, point) - self.rise**2)
                miss = short + np.einsum("ka,ka->k", normal, first - point)
                point = first - lever * (miss / np.einsum("ka,ka->k", normal, lever))[:, None]
        return point[:, :count]


def _reduce(baseline: Floats, further: Floats, weight: Floats, rise: Floats, own_rise: Floats) -> _Equations:
    """Eqs. 12-13 for baselines b_i - b_0 (K, R, n) [m], range differences (K, R) [m] and weights (K, R, R) [1/m^4].

    At a known rise of the tag above each receiver (K, R) and the reference (K, 1) [m] the position is horizontal.
    """
    weighted = weight @ baseline
    spread = inverse_or_nan(baseline.swapaxes(1, 2) @ weighted)
    aim = 0.5 * (np.einsum("kan,kan->ka", baseline, baseline) - further**2 + rise**2 - own_rise**2)
    foot = np.einsum("knm,kam,ka->kn", spread, weighted, aim, optimize=True)
    slope = -np.einsum("knm,kam,ka->kn", spread, weighted, further, optimize=True)
    lever = further + np.einsum("kan,kn->ka", baseline, slope)
    pull = np.einsum("ka,kab->kb", lever, weight)
    known = np.einsum("kb,kb->k", pull, lever)
    left = aim - np.einsum("kan,kn->ka", baseline, foot)
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.where(known > 0, np.einsum("kb,kb->k", pull, left) / known, 0.0)
    return _Equations(
        foot=foot, slope=slope, spread=spread, range_information=known, best_range=best, rise=own_rise[:, 0]
    )
