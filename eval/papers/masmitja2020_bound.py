"""Masmitja et al. 2020, Fig. 2A: the least error among and beside four receivers 200 m apart, with arrivals good to 1 ms.

The paper takes all six differences of four arrivals for measurements with independent errors (Eq. 3, R = sigma^2 I). They share
the arrivals' errors, so that arrivals with independent errors tell half as much: the same bound, twice as large.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.eval.field.array.scene import place_receivers
from tagtrack.eval.field.static_array.bound import cramer_rao_bound, root_trace
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, arrival_information, full_pairs
from tagtrack.eval.papers.frame import Experiment, Findings, Row, Setting
from tagtrack.eval.papers.masmitja2020_twin import PAPER
from tagtrack.eval.papers.printed import MASMITJA2020_FIG_2A

TABLE = "Fig. 2A"
BASELINE = 200.0  # [m]
RECEIVERS = place_receivers("square", BASELINE)
NOISE = ArraySetting(sound_speed=1500.0, sigma=1e-3)
MARGIN = 5.0  # [m] from the receivers' lines, on which the bound has no finite value at a receiver

NOTE = (
    "Exact figures, which no star judges: the largest bound among the receivers, and on the circle of 250 m about their middle "
    "(inside it is printed as '< 1 m'). The paper's R counts the six differences as independent, but they share four "
    "arrivals: the bound of these is twice as large, and `array simulate` draws that."
)
READINGS = {
    "differences independent, as printed": arrival_information(np.ones(4, bool), NOISE.sigma, full_pairs(4)),
    "arrivals independent": arrival_information(np.ones(4, bool), NOISE.sigma),
}


def run_bound(setting: Setting) -> Findings:
    """Fig. 2A."""
    rows = [
        exact_row(name, column, float(root_trace(cramer_rao_bound(places, RECEIVERS, NOISE, information)).max()))
        for name, information in READINGS.items()
        for column, places in {"inside": inside(), "250 m off": circle(250.0)}.items()
    ]
    setting.advance(1)
    return Findings(rows=rows)


def exact_row(name: str, column: str, ours: float) -> Row:
    printed = MASMITJA2020_FIG_2A[column]
    return Row(
        paper=PAPER, table=TABLE, row=name, column=f"largest, {column}", paper_value=printed, ours=ours, low=math.nan,
        high=math.nan, unit="m", note=NOTE, repeated=False,
    )  # fmt: skip


def inside() -> Floats:
    """Places (N, 2) [m] among the receivers, 5 m apart."""
    along = np.arange(-0.5 * BASELINE + MARGIN, 0.5 * BASELINE, MARGIN)
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


def circle(radius: float) -> Floats:
    """Places (360, 2) [m] at a distance [m] from the middle."""
    angle = np.radians(np.arange(360))
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


BOUND_TWIN = Experiment(paper=PAPER, table=TABLE, run=run_bound, steps=lambda size: 1)
