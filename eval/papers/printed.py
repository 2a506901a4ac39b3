"""What the papers print, as they print it; tests/papers pins these numbers to the papers' text.

Clark et al. 2013, Table II stands in ``eval/consistency.py``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

Table = Mapping[str, Mapping[str, float]]


def _table(columns: tuple[str, ...], rows: Mapping[str, tuple[float, ...]]) -> Table:
    return MappingProxyType({row: MappingProxyType(dict(zip(columns, values, strict=True))) for row, values in rows.items()})


# Average error over the first 1,500 s [m].
CLARK2013_TABLE_III = _table(
    ("mean", "25th quartile", "median", "75th quartile"),
    {
        "Standard PF": (24, 23, 24, 24.4),
        "Acoustic SS PF": (21, 21, 21, 22),
        "Brownian only": (19, 19, 19, 19),
        "Lévy γ = 1e-2": (32, 24, 28, 32),
        "Lévy γ = 1e-1": (23, 22, 23, 24),
        "Lévy γ = 1e0": (39, 39, 39, 40),
        "Combined Brownian": (17, 17, 17, 18),
        "Combined Lévy γ = 1e-3": (93, 78, 93, 107),
        "Combined Lévy γ = 1e-2": (22, 20, 21, 24),
        "Combined Lévy γ = 1e-1": (22, 22, 23, 23),
        "Combined Lévy γ = 1e0": (28, 27, 28, 28),
    },
)

# Error and standard deviations over each mission [m].
CLARK2013_TABLE_V = _table(
    ("avg error", "min error", "max error", "min σ_x", "max σ_x", "min σ_y", "max σ_y"),
    {
        "auv2Track": (41.73, 0.85, 140.43, 0.85, 106.95, 1.51, 112.75),
        "stationaryTrackA": (7.01, 0.25, 15.46, 2.61, 13.43, 3.17, 12.00),
        "stationaryTrackB": (16.88, 1.53, 47.26, 6.92, 23.51, 4.42, 32.68),
        "stationaryTrackC": (21.70, 3.13, 47.54, 4.21, 29.10, 3.49, 31.05),
    },
)

# Standard deviations over the missions after a shark, whose place nobody knew [m].
CLARK2013_TABLE_V_SHARKS = _table(
    ("min σ_x", "max σ_x", "min σ_y", "max σ_y"),
    {
        "sharkTrackA": (4.23, 51.59, 3.44, 56.12),
        "sharkTrackB": (4.95, 52.10, 2.79, 46.89),
        "sharkTrackC": (1.54, 79.83, 2.77, 65.75),
        "sharkTrackD": (1.91, 80.91, 2.34, 87.72),
    },
)

# Area covered [m^2], of which the paper does not say how it was measured. That of auv2Track is printed "27,7148".
CLARK2013_AREAS = MappingProxyType(
    {
        "sharkTrackA": 14_025.0, "sharkTrackB": 3_150.0, "sharkTrackC": 9_720.0, "sharkTrackD": 7_280.0, "auv2Track": 277_148.0,
        "stationaryTrackA": 2_408.0, "stationaryTrackB": 1_782.0, "stationaryTrackC": 2_376.0,
    }
)  # fmt: skip

# Usable signals a minute: of the resting tag 30 at most, of the moving one "just over 25", and "as low as 3" (6.2).
CLARK2013_SIGNAL_RATES = _table(("highest", "lowest"), {"moving tag": (25, 3), "resting tag": (30, math.nan)})

# How often each difference [s] of code 117 from tag 55436 occurred in 105 minutes.
LIN2013_TABLE_I = MappingProxyType(
    {
        0.04875: 3,
        0.04896: 1,
        3.95104: 3,
        3.99958: 55,
        3.99959: 30,
        3.99979: 1172,
        3.99980: 235,
        3.99999: 1,
        4.00000: 43,
        7.95063: 1,
        7.99937: 1,
        7.99958: 1,
    }
)

# Period and spread of the differences of code 117 [s], by tag.
LIN2013_TABLE_II = _table(("T_c", "σ"), {"55436": (3.99979, 0.00006), "55488": (1.99988, 0.00010)})

# Actual minus calculated distance [m].
LIN2013_TABLE_III = _table(("mean", "σ"), {"Tied to buoy": (1.93, 2.34), "Active tracking": (0.62, 2.63)})

# Error of the distance after 22 hours [m]: of the figure, and of the same experiment on another day (V.C).
LIN2013_FIG_6 = MappingProxyType({"day of the figure": -1.5, "another day": 8.0})

# Localization error of the tagged boat [m], offline by measurements; online with both (Fig. 8, caption). Both decrease it "by a
# factor of two" (V.E).
LIN2013_TABLE_IV = _table(
    ("mean", "σ"), {"Angle": (16.38, 15.07), "Distance": (19.43, 29.83), "Angle and Distance": (8.76, 12.82)}
)
LIN2013_FIG_8 = MappingProxyType({"mean": 8.46, "σ": 7.82})
LIN2013_FACTOR = 2.0

# The largest bound [m] (Results, "TDOA tracking"): "< 1 m" inside, so no figure, and "up to 7 m at 250 m off the ... center".
MASMITJA2020_FIG_2A = MappingProxyType({"inside": math.nan, "250 m off": 7.0})

# Largest error of area-only tracking while the float was down: "then increased up to ~100 m" (Discussion, "AOTT algorithm").
MASMITJA2020_FIG_3E = 100.0

# The ratios that follow from the simulations of Fig. 3C: TCR / MTR (0.8 "the greatest"), MPR / MTR (300 m over 250 m), and the
# share of the particles that compound resampling spreads ("AOTT simulations").
MASMITJA2020_FIG_3C = MappingProxyType({"radius": 0.8, "range": 1.2, "resampling": 0.015})

# Error before and after the turn [m] by reception ratio [%], and iterations lost with 60 % [%] (Discussion, "AOTT algorithm").
MASMITJA2020_FIG_3D = _table(("before the turn", "after the turn"), {"100": (50, 50), "60": (100, 100)})
MASMITJA2020_LOST = 2.0

# Error and standard deviation of the five moorings by WLS-ML [m], and where it puts them: Position 2, UTM 31N [m].
MASMITJA2020_TABLE_1 = _table(
    ("Error", "SD"),
    {"A": (0.74, 0.55), "B": (0.68, 0.40), "C": (1.29, 1.05), "D": (0.51, 0.29), "E": (0.48, 0.27)},
)
MASMITJA2020_POSITION_2 = MappingProxyType(
    {
        "A": (543958.24, 4651491.60),
        "B": (544089.80, 4651482.68),
        "C": (544092.10, 4651433.95),
        "D": (543952.56, 4651348.23),
        "E": (544114.03, 4651341.52),
    }
)

# Error and standard deviation by estimator and mooring [m]; the paper has none of MAP-M at D.
MASMITJA2020_TABLE_S1 = _table(
    tuple(f"{mooring} {figure}" for mooring in "ABCDE" for figure in ("error", "SD")),
    {
        "PF": (3.20, 0.46, 3.85, 0.20, 0.48, 0.29, 5.36, 0.17, 10.28, 0.16),
        "MAP-M": (0.06, 0.43, 0.06, 0.47, 0.02, 0.25, math.nan, math.nan, 0.15, 0.40),
        "ML": (0.04, 0.75, 0.01, 0.41, 0.02, 0.25, 0.07, 0.52, 0.04, 0.56),
        "WLS": (0.03, 0.25, 0.12, 1.22, 0.08, 0.28, 7.07, 2.52, 9.02, 4.67),
        "WLS-ML": (0.03, 0.27, 0.09, 0.92, 0.02, 0.25, 0.15, 0.91, 0.02, 0.74),
    },
)
