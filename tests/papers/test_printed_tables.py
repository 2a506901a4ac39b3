"""What the papers print, as `eval papers` sets it beside ours: the numbers, read off the papers' tables a second time."""

import csv
import math

import pytest

from tagtrack.eval.papers.clark2013_filters import filters_of_table
from tagtrack.eval.papers.clark2013_twin import (
    OFFLINE_SECONDS,
    STATIONARY_SECONDS,
    TIME_STEP,
    moving_scenario,
    printed_filter,
)
from tagtrack.eval.papers.frame import Size
from tagtrack.eval.papers.lin2013_localization import BINS, boat_scenario
from tagtrack.eval.papers.lin2013_ranging import ACTIVE_SECONDS
from tagtrack.eval.papers.lin2013_twin import CODE, TAGS
from tagtrack.eval.papers.printed import (
    CLARK2013_SIGNAL_RATES,
    CLARK2013_TABLE_III,
    CLARK2013_TABLE_V,
    LIN2013_FACTOR,
    LIN2013_FIG_6,
    LIN2013_FIG_8,
    LIN2013_TABLE_I,
    LIN2013_TABLE_II,
    LIN2013_TABLE_III,
    LIN2013_TABLE_IV,
    MASMITJA2020_POSITION_2,
    MASMITJA2020_TABLE_1,
    MASMITJA2020_TABLE_S1,
)

TABLE_III = """
Standard PF	24	23	24	24.4
Acoustic SS PF	21	21	21	22
Brownian only	19	19	19	19
Lévy γ = 1e-2	32	24	28	32
Lévy γ = 1e-1	23	22	23	24
Lévy γ = 1e0	39	39	39	40
Combined Brownian	17	17	17	18
Combined Lévy γ = 1e-3	93	78	93	107
Combined Lévy γ = 1e-2	22	20	21	24
Combined Lévy γ = 1e-1	22	22	23	23
Combined Lévy γ = 1e0	28	27	28	28
"""
TABLE_V = """
auv2Track	41.73	0.85	140.43	0.85	106.95	1.51	112.75
stationaryTrackA	7.01	0.25	15.46	2.61	13.43	3.17	12.00
stationaryTrackB	16.88	1.53	47.26	6.92	23.51	4.42	32.68
stationaryTrackC	21.70	3.13	47.54	4.21	29.10	3.49	31.05
"""
TABLE_IV = """
Angle	16.38	15.07
Distance	19.43	29.83
Angle and Distance	8.76	12.82
"""


def numbers(text):
    rows = (line.split("\t") for line in text.strip().splitlines())
    return {name: [float(value) for value in values] for name, *values in rows}


@pytest.mark.parametrize(("ours", "printed"), [(CLARK2013_TABLE_III, TABLE_III), (CLARK2013_TABLE_V, TABLE_V)])
def test_tables_of_clark2013(ours, printed):
    assert {row: list(columns.values()) for row, columns in ours.items()} == numbers(printed)


def test_signal_rates_of_clark2013():
    moving, resting = CLARK2013_SIGNAL_RATES["moving tag"], CLARK2013_SIGNAL_RATES["resting tag"]
    assert moving == {"highest": 25, "lowest": 3} and resting["highest"] == 30 and math.isnan(resting["lowest"])  # 6.2


def test_tables_of_lin2013():
    assert sum(LIN2013_TABLE_I.values()) == 1546
    assert LIN2013_TABLE_I[3.99979] == 1172 and LIN2013_TABLE_I[3.99980] == 235
    assert LIN2013_TABLE_II == {"55436": {"T_c": 3.99979, "σ": 0.00006}, "55488": {"T_c": 1.99988, "σ": 0.00010}}
    assert LIN2013_TABLE_III["Tied to buoy"] == {"mean": 1.93, "σ": 2.34}
    assert LIN2013_TABLE_III["Active tracking"] == {"mean": 0.62, "σ": 2.63}
    assert list(LIN2013_FIG_6.values()) == [-1.5, 8.0]
    assert {row: list(columns.values()) for row, columns in LIN2013_TABLE_IV.items()} == numbers(TABLE_IV)
    assert LIN2013_FIG_8 == {"mean": 8.46, "σ": 7.82}
    assert LIN2013_FACTOR == 2.0  # "by a factor of two" (V.E)


def test_tables_of_masmitja2020(tagtrack_data):
    with (tagtrack_data / "resnep" / "paper_table1.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            assert MASMITJA2020_TABLE_1[row["mooring"]] == {"Error": float(row["error_m"]), "SD": float(row["sd_m"])}
            assert MASMITJA2020_POSITION_2[row["mooring"]] == (float(row["position2_x"]), float(row["position2_y"]))
    with (tagtrack_data / "resnep" / "paper_tableS1.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 25
    for row in rows:
        for figure, column in (("error", "error_m"), ("SD", "sd_m")):
            printed = MASMITJA2020_TABLE_S1[row["algorithm"]][f"{row['mooring']} {figure}"]
            assert math.isnan(printed) if row[column] == "" else printed == float(row[column])


def test_experiments_last_as_long_as_the_papers():
    assert OFFLINE_SECONDS == 1500  # section 7
    assert Size().trials == 100  # section 7
    assert Size().moving_seconds == 98 * 60  # Table IV, auv2Track: 1:38
    assert [seconds / 60 for seconds in STATIONARY_SECONDS.values()] == [4, 10, 10]  # Table IV
    assert TIME_STEP == 1.0  # 4.2: the loop iterates at 1.0 Hz


def test_the_boat_is_tracked_as_long_and_filtered_as_often_as_in_lin2013():
    assert ACTIVE_SECONDS == 39 * 60  # "from 22:44 to 23:23" (V.D)
    assert Size().offline == 20  # "the state estimator was run twenty times offline" (V.E)
    assert BINS == ((0, 30), (30, 60), (60, 90))  # [0 m, 30 m), [30 m, 60 m), and [60 m, 90 m) (V.E)
    belief = boat_scenario(1000).belief
    assert (belief.weight_floor, belief.receiver.largest_jump) == (1e-7, 50.0)  # w_min (IV.C.3), Delta d_max (Alg. 1)


def test_the_filter_on_board_is_table_ones_with_no_bound_on_the_speed():
    motion = printed_filter("standard").motion
    assert (motion.speed_sigma, motion.turn_sigma) == (0.3, math.pi / 2)
    # In 1,500 s with no reading the speed of a particle is 0.3 * sqrt(1500) = 12 m/s (one sigma).
    assert motion.max_speed > 0.3 * math.sqrt(OFFLINE_SECONDS)
    assert moving_scenario(1000, 60).belief == printed_filter("standard")


def test_a_filter_for_each_row_of_table_three():
    filters = filters_of_table()
    assert list(filters) == list(CLARK2013_TABLE_III)
    assert [filters[f"Lévy γ = {gamma}"].motion.gamma for gamma in ("1e-2", "1e-1", "1e0")] == [0.01, 0.1, 1.0]
    assert filters["Combined Lévy γ = 1e-3"].motion.gamma == 0.001


def test_code_117_of_the_two_tags_has_the_periods_of_table_two():
    assert {name: round(tag.period(CODE), 5) for name, tag in TAGS.items()} == {"55436": 3.99979, "55488": 1.99988}
