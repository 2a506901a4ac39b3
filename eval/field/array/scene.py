"""The simulated deployment of Masmitja et al. 2020 (Fig. 2B, S1): receivers, a target that swims among and around them, noise.

The paper shows its trajectory but prints no coordinates (``paper_path`` has those of the authors' program); ours likewise enters
and leaves the array and passes near receivers. Of speed and tag delay the paper's text says 1 m/s and 60 s, its methods 0.2 m/s
and 120 s: these are the command's default, as the methods list them as the parameters simulated and lobsters are slow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import Delaunay

from tagtrack.eval.field.static_array.model import Floats, Pings

SQUARE = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
ARRAYS = {  # in baselines, from the middle; Fig. 2A, then S1's A-D
    "square": SQUARE,
    "not square": ((-0.5, -0.25), (0.6, -0.55), (0.4, 0.5), (-0.65, 0.55)),
    "square and middle": (*SQUARE, (0.0, 0.0)),
    "triangle": ((-0.5, -0.4), (0.5, -0.4), (0.0, 0.5)),
    "wider square": tuple((1.5 * x, 1.5 * y) for x, y in SQUARE),
}
WAYPOINTS = (
    ((-1.1, 0.3), (-0.75, -0.1), (-0.35, -0.3), (0.0, 0.0), (0.3, 0.35), (0.6, 0.55), (0.95, 0.3), (0.9, -0.3))
    + ((0.45, -0.4), (0.1, -0.25), (-0.25, 0.1), (-0.42, 0.45), (-0.1, 0.9), (0.4, 1.0))
)
# The authors' own simulation, from their published program (github.com/imasmitja/TDOA_algorithms_SR, "TDOA(Sim).py"): corners of
# the path [m] about receivers 200 m apart, a ping each 60 m, once a minute. Fig. 2B draws it.
PAPER_CORNERS = ((0.0, 0.0), (0.0, 180.0), (240.0, 180.0), (240.0, -60.0), (-180.0, -60.0))
PAPER_STEP, PAPER_DELAY = 60.0, 60.0  # [m], [s]
OUTLIER_FACTOR = 4.0  # of the time of flight (Fig. S2D)
RANDOM_SPREAD = 0.2  # of the interval, either way: 60-90 s are 75 s +- 20 %


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Of arrival times."""

    sigma: float  # [s]
    outliers: float = 0.0  # share of arrivals whose time of flight is four times too long
    late: float = 0.0  # by which one arrival of a passage comes late, as in the authors' own simulation [s]

    @property
    def label(self) -> str:
        """As a table's column says it: ``1.5 ms, 5 % out``."""
        outliers = f", {100 * self.outliers:g} % out" if self.outliers else ""
        return f"{1e3 * self.sigma:g} ms{outliers}" + (f", one {self.late:g} s late" if self.late else "")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A deployment and the true track of K pings."""

    receivers: Floats  # (R, 2) [m]
    position: Floats  # (K, 2) [m]
    delay: float  # of the tag, from ping to ping [s]; the mean where it is random
    random_delay: bool
    sound_speed: float  # [m/s]

    @property
    def inside(self) -> NDArray[np.bool_]:
        """(K,): within the polygon of the receivers."""
        return Delaunay(self.receivers).find_simplex(self.position) >= 0

    @property
    def acceleration_sigma(self) -> float:
        """White acceleration [m/s^1.5] under which a track bends as much as this one: of positions dt apart, the second
        difference has the variance sigma^2 dt^3 2/3."""
        return float(np.sqrt(np.mean(np.diff(self.position, 2, axis=0) ** 2) * 1.5 / self.delay**3))

    def draw_pings(self, noise: Noise, rng: np.random.Generator) -> Pings:
        """What the receivers hear of one passage: all of it, at wrong times."""
        count = len(self.position)
        interval = np.full(count - 1, self.delay)
        if self.random_delay:
            interval *= 1 + rng.uniform(-RANDOM_SPREAD, RANDOM_SPREAD, count - 1)
        sent = np.concatenate([[0.0], np.cumsum(interval)])
        flight = np.linalg.norm(self.position[:, None] - self.receivers, axis=-1) / self.sound_speed
        flight = flight + noise.sigma * rng.standard_normal(flight.shape)
        flight *= np.where(rng.random(flight.shape) < noise.outliers, OUTLIER_FACTOR, 1.0)
        if noise.late:
            flight[rng.integers(count), rng.integers(flight.shape[1])] += noise.late
        arrival = sent[:, None] + flight
        return Pings(time=arrival.min(axis=1), arrival=arrival)


def place_receivers(name: str, baseline: float) -> Floats:
    """Receivers (R, 2) of one of ``ARRAYS`` [m]. Raises ValueError that lists them."""
    if name not in ARRAYS:
        raise ValueError(f"unknown array {name!r}; known: {', '.join(ARRAYS)}")
    return baseline * np.array(ARRAYS[name])


def paper_path() -> Floats:
    """Positions (19, 2) [m] of the authors' own simulation."""
    corner = np.array(PAPER_CORNERS)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corner, axis=0), axis=1))])
    place = np.arange(0.0, along[-1] + 1.0, PAPER_STEP)
    return np.stack([np.interp(place, along, coordinate) for coordinate in corner.T], axis=1)


def swim(baseline: float, step: float) -> Floats:
    """Positions (K, 2) [m] along the trajectory, ``step`` metres of way apart.

    Raises:
        ValueError: if fewer than ten steps fit into it.
    """
    corner = baseline * np.array(WAYPOINTS)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corner, axis=0), axis=1))])
    fine = CubicSpline(along, corner)(np.linspace(0, along[-1], 20_001))
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    if way[-1] < 10 * step:
        raise ValueError(f"the trajectory is {way[-1]:.0f} m long, too short for steps of {step:g} m; take a larger baseline")
    place = np.arange(0.0, way[-1], step)
    return np.stack([np.interp(place, way, coordinate) for coordinate in fine.T], axis=1)
