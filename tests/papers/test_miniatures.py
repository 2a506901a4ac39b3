"""Each twin in miniature: a few numbers, and by hand what its table makes of them."""

import gzip
import math
from types import SimpleNamespace

import numpy as np
import pytest

from tagtrack.eval.field.tag_clock.time_of_flight import TagClock
from tagtrack.eval.papers import (
    clark2013_filters,
    clark2013_missions,
    lin2013_clock,
    lin2013_localization,
    lin2013_ranging,
    masmitja2020_bound,
    masmitja2020_field,
    masmitja2020_float,
    masmitja2020_turn,
)
from tagtrack.eval.papers.clark2013_missions import (
    VARIANTS,
    covered_rows,
    figures_of,
    mission_rows,
    rate_rows,
    shark_rows,
    signals_a_minute,
    table_ii_proportions,
)
from tagtrack.eval.papers.frame import Setting, Size
from tagtrack.eval.papers.masmitja2020_turn import is_lost, mean_error

FIELDS = [(name, float) for name in ("xx", "xy", "yy", "mean_x", "mean_y", "estimate_x", "estimate_y")]


def beliefs(xx, yy):
    """About the origin."""
    found = np.zeros(np.shape(xx), FIELDS)
    found["xx"], found["yy"] = xx, yy
    return found


def by_column(rows, name=None):
    return {row.column: row.ours for row in rows if name in (None, row.row)}


def test_range_error_of_lin_is_actual_minus_calculated():
    """A tag that seems nearer than it is has a positive error: 100 m away, calculated as 97 m."""
    pings = lin2013_ranging.RangedPings(
        time=np.zeros(2), true=np.array([99.0, 50.0]), actual=np.array([100.0, 52.0]), calculated=np.array([97.0, 51.0])
    )
    assert pings.error().tolist() == [3.0, 1.0]
    assert pings.error(exact=True).tolist() == [2.0, -1.0]


def test_lin_counts_a_millisecond_as_one_and_a_half_metres():
    clock = TagClock(period=4.0, first_ping=0.0)
    np.testing.assert_allclose(lin2013_clock.late_range(np.array([0.0, 4.001]), clock), [0.0, 1.5])


def test_fig_6_of_lin_takes_the_median_of_the_last_ten_minutes():
    arrival = np.arange(0.0, 1300.0, 100.0)
    error = np.where(arrival > 600.0, 8.0, -1.0)
    error[-1] = 73.0  # a misread code
    assert lin2013_clock.final_error(arrival, error) == 8.0


def test_table_iv_of_lin_sets_the_better_one_beside_both():
    errors = {"Angle": 4.0, "Distance": 6.0, "Angle and Distance": 2.0}
    found = {name: np.array([[[error - 1.0, error + 1.0]]]) for name, error in errors.items()}  # (missions, trials, steps)
    rows = lin2013_localization.rows_of_table(lin2013_localization.VARIANTS[0], found)
    assert by_column(rows, "Distance") == {"mean": 6.0, "σ": 1.0}
    assert by_column(rows, "the better one / both") == {"mean": 2.0}


def test_fig_8_of_lin_is_mean_and_deviation_of_the_estimate_on_board():
    fish = np.array([[9.0, 9.0], [3.0, 0.0], [3.0, 4.0]])  # the start does not count
    rows = lin2013_localization.rows_of_online([SimpleNamespace(fish=fish, belief=beliefs([1.0] * 3, [1.0] * 3))])
    assert by_column(rows) == {"mean": 4.0, "σ": 1.0}


def test_table_v_of_clark_has_least_mean_and_largest():
    figures = figures_of(np.array([[1.0, 4.0, 7.0]]), beliefs([[9.0, 25.0, 16.0]], [[4.0, 1.0, 36.0]]))
    assert {name: values.tolist() for name, values in figures.items()} == {
        "avg error": [4.0], "min error": [1.0], "max error": [7.0],
        "min σ_x": [3.0], "max σ_x": [5.0], "min σ_y": [1.0], "max σ_y": [6.0],
    }  # fmt: skip


def test_table_v_of_clark_leaves_out_the_first_minute():
    """62 values, of each second from the start on; what the first 60 tell is beyond all measure."""
    error, spread = np.full(62, 1e6), np.full(62, 1e12)
    error[60:], spread[60:] = (2.0, 4.0), (9.0, 25.0)
    mission = SimpleNamespace(error=error, belief=beliefs(spread, spread))
    rows = by_column(mission_rows("stationaryTrackA", [mission], VARIANTS[0]))
    assert (rows["avg error"], rows["max error"], rows["min σ_x"], rows["max σ_y"]) == (3.0, 4.0, 3.0, 5.0)
    sharks = by_column(shark_rows("sharkTrackA", [mission]))
    assert sharks == {"min σ_x": 3.0, "max σ_x": 5.0, "min σ_y": 3.0, "max σ_y": 5.0}


def test_area_of_clark_is_that_of_the_hull_and_the_distance_a_mean():
    vehicle = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0], [2.0, 1.0]])
    rows = covered_rows("stationaryTrackA", [SimpleNamespace(vehicle=vehicle, fish=vehicle + [[3.0, 4.0]])])
    assert by_column(rows) == {"area covered": 12.0, "mean distance between AUV and tag": 5.0}


def test_table_ii_of_clark_is_in_percent(monkeypatch):
    fish = np.array([[9.0, 9.0], [0.5, 1.0], [3.0, 1.0], [2.0, 3.0], [3.0, 1.0]])  # the start does not count
    mission = SimpleNamespace(belief=beliefs([1.0] * 5, [4.0] * 5), fish=fish)
    monkeypatch.setattr(clark2013_missions, "record_moving", lambda variant, setting: [mission])
    rows = [row for row in clark2013_missions.run_proportions(Setting()).rows if row.table == "Table II"]
    shares = {row.row: row.ours for row in rows}
    assert (shares["e_x < σ_X"], shares["e_y < σ_Y"], shares["e < σ"]) == (25.0, 75.0, 25.0)


def test_table_ii_of_clark_counts_errors_below_the_spread():
    """Errors (1, 3) and (3, 1) with sigma (2, 2): below it once in each axis; 10^(1/2) against 8^(1/2) never."""
    shares = table_ii_proportions(np.array([[1.0, 3.0], [3.0, 1.0]]), np.tile(4.0 * np.eye(2), (2, 1, 1)))
    assert [float(share) for share in shares.values()] == [0.5, 0.5, 0.5, 0.5, 0.0]


def test_signals_of_clark_are_counted_over_sixty_seconds():
    detected = np.zeros(122, bool)
    detected[[10, 20, 65]] = True
    rate = signals_a_minute(SimpleNamespace(detected=detected))
    assert (rate.size, rate.max(), rate[-1]) == (62, 3.0, 1.0)  # 10, 20 and 65 s lie within one minute
    rows = rate_rows("moving tag", [SimpleNamespace(detected=detected)])
    assert by_column(rows) == {"highest": 3.0, "lowest": 1.0}
    assert [row.paper_value for row in rows] == [25.0, 3.0]


def test_table_iii_of_clark_takes_quartiles_over_trials_and_the_median_over_missions():
    filters = clark2013_filters.filters_of_table()
    errors = {row: np.array([[1.0, 2.0, 3.0, 4.0, 5.0], [10.0, 20.0, 30.0, 40.0, 50.0]]) for row in filters}
    rows = clark2013_filters.rows_of(clark2013_filters.variants()[0], errors)
    ours = {row.column: row.ours for row in rows if row.row == "Standard PF"}
    assert ours == {"mean": 16.5, "25th quartile": 11.0, "median": 16.5, "75th quartile": 22.0}


def test_fig_3d_of_masmitja_averages_half_an_hour_and_ten_minutes():
    """An error that is the time in seconds: the last half hour before the turn, 67 min, is about 52 min, steps being 10 s."""
    steps = round(masmitja2020_turn.SECONDS / 10)
    error = np.stack([10.0 * np.arange(1, steps + 1), np.full(steps, 249.0)])
    error[1, -1] = 1000.0  # one step of sixty: 12.5 m more
    assert mean_error(error, 67 * 60.0)[0] == pytest.approx(52 * 60 + 5)
    assert is_lost(error).tolist() == [True, True] and not is_lost(error - 20.0)[1]


def test_fig_3d_of_masmitja_has_before_and_after_the_turn_and_the_share_lost():
    steps = round(masmitja2020_turn.SECONDS / 10)
    error = np.repeat([[50.0, 80.0]], steps // 2, axis=1)
    rows = masmitja2020_turn.turn_rows("60", error, masmitja2020_turn.VARIANTS[0], 0)
    assert by_column(rows) == {"before the turn": 50.0, "after the turn": 80.0, "iterations lost": 0.0}
    rows = masmitja2020_turn.turn_rows("60", error + 200.0, masmitja2020_turn.VARIANTS[0], 0)
    assert by_column(rows)["iterations lost"] == 100.0


def test_bound_of_masmitja_takes_differences_for_independent():
    """Amid the square: information 2 / (c sigma)^2 an axis from arrivals, four times that from six differences as printed."""
    found = {(row.row, row.column): row.ours for row in masmitja2020_bound.run_bound(Setting()).rows}
    printed, arrivals = masmitja2020_bound.READINGS
    assert found[printed, "largest, inside"] < 1.0 and found[printed, "largest, 250 m off"] == pytest.approx(7.5, abs=0.1)
    for column in ("largest, inside", "largest, 250 m off"):
        assert found[arrivals, column] == pytest.approx(2 * found[printed, column])


def test_what_table_i_of_lin_does_not_list_stands_beside_no_printed_number():
    found = lin2013_clock.run_histogram(Setting(size=Size(records=1))).rows
    assert math.isnan(found[-1].paper_value) and found[-1].row == "all others"
    assert sum(row.paper_value for row in found[:-1]) == 1546


def write_moorings(folder, speed):
    """Five moorings 40 to 160 m off, and what four receivers heard of the tag at each: sound came at a speed."""
    place = {"A": (0.0, 0.0), "B": (150.0, 0.0), "D": (0.0, 150.0), "E": (150.0, 150.0), "C": (40.0, 110.0)}
    stations, rows = ["mooring,receiver,sync_tag,table1_position1_x,table1_position1_y"], ["t_unix_s,receiver,tag"]
    for number, (letter, (x, y)) in enumerate(place.items()):
        stations.append(f"{letter},{'' if letter == 'C' else 'R' + letter},{number},{x},{y}")
        for ping in range(300):
            for name in "ABDE":
                away = math.dist((x, y), place[name]) / speed
                rows.append(f"{1.5e9 + 60 * ping + 7 * number + away:.6f},R{name},{number}")
    folder.mkdir()
    (folder / "stations.csv").write_text("\n".join(stations) + "\n")
    with gzip.open(folder / "sync_detections.csv.gz", "wt") as file:
        file.write("\n".join([rows[0], *sorted(rows[1:])]) + "\n")


def test_table_1_of_masmitja_is_located_at_1500_metres_a_second(tmp_path):
    write_moorings(tmp_path / "resnep", 1500.0)
    found = masmitja2020_field.run_field(Setting(data=tmp_path)).rows
    errors = {row.row: row.ours for row in found if row.table.startswith("Table 1,") and row.column == "Error"}
    assert set(errors) == set("ABCDE") and max(errors.values()) < 0.05  # at 1512 m/s the moorings at the edge are 0.4 m off
    assert all(math.isnan(row.paper_value) for row in found if row.column == "mean to Position 2")
    from_second = {row.row: row.ours for row in found if row.column == "A error"}
    assert from_second["WLS-ML"] == pytest.approx(math.hypot(543958.24, 4651491.60), abs=1.0)  # A stands at the origin
    assert not any(row.repeated for row in found)


def test_deviations_of_masmitja_are_of_places_and_of_distances():
    places = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 0.0], [4.0, 0.0]])
    assert masmitja2020_field._scatter(places) == 2.0
    assert masmitja2020_field._distance(places, np.array([0.0, 3.0])) == 4.0  # 3 and 5 m
    assert masmitja2020_field._distance_sd(places, np.array([0.0, 3.0])) == 1.0


def test_positions_that_hang_together_are_drawn_in_blocks():
    rng = np.random.default_rng(0)
    alone = rng.normal(size=(400, 2))
    assert masmitja2020_field.block_length(alone) <= 3
    walk = np.stack([np.convolve(column, np.ones(20), mode="valid") for column in rng.normal(size=(2, 419))], axis=1)
    length = masmitja2020_field.block_length(walk)
    assert 20 <= length <= 80  # a moving average over 20 has an integrated autocorrelation time of 20
    rows = masmitja2020_field.draw_blocks(400, length, rng)
    assert rows.shape == (masmitja2020_field.BOOTSTRAPS, 400)
    assert ((np.diff(rows[:, :length], axis=1) % 400) == 1).all()
    spread = np.std([walk[drawn].mean(axis=0) for drawn in rows], axis=0)
    naive = walk.std(axis=0) / 20.0
    assert (spread > 2.5 * naive).all()  # sqrt(20) = 4.5 times, less what so short a record lacks


def test_float_of_masmitja_dives_three_times_and_is_circled():
    voyage = masmitja2020_float.sail(3, np.random.default_rng(1))
    dives = np.flatnonzero(np.diff(voyage.depth) > 0)
    assert len(dives) == 3 and set(voyage.depth) == {0.0, 60.0}
    np.testing.assert_allclose(np.linalg.norm(voyage.glider - voyage.afloat, axis=-1), 200.0)
    np.testing.assert_allclose(voyage.slant_range[:, voyage.depth > 0], math.hypot(200.0, 60.0))
    speed = np.linalg.norm(np.diff(voyage.afloat, axis=1), axis=-1) / 60.0
    assert 0.02 < speed[:, voyage.depth[:-1] == 0].mean() < 0.12
    voyage = masmitja2020_float.sail(300, np.random.default_rng(1))
    speed = np.linalg.norm(np.diff(voyage.afloat, axis=1), axis=-1) / 60.0
    down = voyage.depth[:-1] > 0
    assert speed[:, down].mean() / speed[:, ~down].mean() == pytest.approx(0.5, rel=0.1)  # 300 voyages, four hours of memory


def test_ranges_tell_more_of_the_float_than_hearing_it(monkeypatch):
    monkeypatch.setattr(masmitja2020_float, "HOURS", 3)
    found = masmitja2020_float.run_float(Setting(size=Size(settings=2, area_particles=500))).rows
    errors = {row.row: row.ours for row in found if row.column.endswith("surface")}
    assert errors["USBL"] < 5.0 < 2 * errors["ROTT"] < errors["AOTT"]
