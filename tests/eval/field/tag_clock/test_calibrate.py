"""`tagtrack eval calibrate`: what it prints and writes, and one line where the arrivals give no period."""

import errno
import json

import numpy as np
import pytest

from tagtrack.eval.field.tag_clock import calibrate as command
from tagtrack.eval.field.tag_clock.arrivals import write_arrivals
from tagtrack.eval.field.tag_clock.calibration import Kind, calibrate
from tagtrack.eval.field.tag_clock.calibration_plot import plot_differences
from tagtrack.eval.field.tag_clock.coded_tag import CodedTag, CodeReceiver, simulate_arrivals


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def arrivals(tmp_path):
    """A record of 20 minutes, which the file arrivals.csv holds."""
    heard = simulate_arrivals(CodedTag(), CodeReceiver(missed=0.02), duration=1200.0, generator=np.random.default_rng(2))
    write_arrivals(tmp_path / "arrivals.csv", heard)
    return heard


@pytest.fixture
def refused(evaluate, tmp_path):
    """Assert that the command refuses a file with these lines; returns its one line, without the file's name."""

    def refuse(lines, *arguments):
        (tmp_path / "a.csv").write_text(lines)
        status, out, err = evaluate("calibrate", "--arrivals", "a.csv", "--out", "out", *arguments)
        assert (status, out) == (2, "")
        assert err.startswith("error: ") and err.count("\n") == 1
        assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
        return err.removeprefix("error: ").removeprefix("a.csv")

    return refuse


def rows(times, code=117):
    return "t_s,code\n" + "".join(f"{time},{code}\n" for time in times)


def test_it_prints_the_period_by_both_ways_and_the_outliers_by_kind(evaluate, arrivals):
    status, out, err = evaluate("calibrate", "--arrivals", "arrivals.csv", "--code", "117")
    found = calibrate(arrivals.of_code(117))
    assert (status, err) == (0, "")
    assert f"T_c {found.by_line.period:.8f} s, standard error {found.by_line.standard_error:.1e} s (line" in out
    assert f"T_c {found.by_differences.period:.8f} s" in out
    assert f"t_0 {found.clock.first_ping:.5f} s" in out
    assert "missed codes: several periods" in out
    assert "shift" not in out  # there is none


def test_it_writes_json_and_a_picture(evaluate, arrivals, tmp_path):
    assert evaluate("calibrate", "--arrivals", "arrivals.csv", "--code", "121", "--out", "out")[0] == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["calibration.json", "differences.png"]
    assert (tmp_path / "out/differences.png").read_bytes().startswith(b"\x89PNG")
    result = json.loads((tmp_path / "out/calibration.json").read_text(encoding="utf-8"))
    found = calibrate(arrivals.of_code(121))
    assert result["code"] == 121
    assert result["arrivals"] == arrivals.of_code(121).size
    assert result["by_line"]["period"] == pytest.approx(found.by_line.period, abs=1e-12)
    assert result["aliasing_range_m"] == pytest.approx(1500.0 * found.by_line.period / 2)
    assert result["kinds"]["missed"]["count"] == len(found.differences.of_kind(Kind.MISSED)) > 0
    assert result["outliers"] == sum(figures["count"] for kind, figures in result["kinds"].items() if kind != "regular")
    listed = result["differences"]
    assert sum(line["frequency"] for line in listed) == result["arrivals"] - 1
    assert {line["kind"] for line in listed if 3.99 < line["difference_s"] < 4.01} == {"regular"}
    assert {"tagtrack", "commit", "python", "numpy"} <= set(result["versions"])


def test_again_replaces_the_earlier_one(evaluate, arrivals, tmp_path):
    calls = [("--code", "117"), ("--code", "121"), ("--code", "117")]
    seen = []
    for chosen in calls:
        assert evaluate("calibrate", "--arrivals", "arrivals.csv", *chosen, "--out", "out")[0] == 0
        seen.append((tmp_path / "out/calibration.json").read_bytes())
    assert seen[0] == seen[2] != seen[1]


def test_a_file_of_one_code_needs_no_choice(evaluate, tmp_path):
    (tmp_path / "a.csv").write_text(rows(2.0 * np.arange(10)))
    status, out, _ = evaluate("calibrate", "--arrivals", "a.csv")
    assert status == 0
    assert "T_c 2.00000000 s" in out
    assert not (tmp_path / "runs").exists()  # without --out nothing is written


def test_a_shift_of_the_clock_is_told(evaluate, tmp_path):
    (tmp_path / "a.csv").write_text(rows([*(4.0 * np.arange(9)), *(1000.7 + 4.0 * np.arange(9))]))
    status, out, _ = evaluate("calibrate", "--arrivals", "a.csv", "--out", "out")
    assert status == 0
    assert "shift of the clock" in out
    assert "t_0 1000.70000 s, in the last of 2 stretches" in out


@pytest.mark.parametrize(
    ("lines", "arguments", "complaint"),
    [
        ("", (), ": line 1 must name the columns t_s,code, got nothing"),
        ("t_s,code\n", (), " holds no arrivals"),
        (rows([0, 4, "late"]), (), ": line 4: t_s must be a number, got 'late'"),
        (rows([0, 8, 4]), (), ": line 4: times must rise, got 4.00000 after 8.00000; sort the file"),
        (rows([0, 4, 4]), (), ": line 4: code 117 arrives twice at 4.00000 s; remove the duplicate"),
        (rows([7]), (), ", code 117: a period needs at least three arrivals of a code, got 1; record for longer"),
        (rows([0, 3, 6, 9]), (), ", code 117: 0 of 3 differences lie within 0.01 s of the nominal period 2 s"),
        (rows([0, 600, 4000]), (), ", code 117: 0 of 2 differences lie within 0.01 s"),
        (rows([0, 4, 8, 12]), ("--nominal-period", "2"), "median difference is 4.00000 s: give a nominal period near"),
        (rows([0, 2, 4, 6, 10, 14]), ("--nominal-period", "4"), "period 4 s, which is 2 periods: give a nominal period of 2 s"),
        (rows([0, 4, 8]), ("--nominal-period", "0"), "the nominal period must be positive, got 0 s"),
        (rows([0, 4, 8]), ("--tau", "-1"), "tau must be positive and below a quarter of the nominal period 2 s, got -1 s"),
        (rows([0, 4, 8]), ("--resolution", "0"), "the resolution must be positive and at most tau, 0.01 s, got 0 s"),
        (rows([0, 4, 8]), ("--sound-speed", "nan"), "speed of sound must be positive, got nan m/s"),
        (rows([0, 4, 8]), ("--code", "5"), " holds no code 5; it holds 117"),
        (rows([0, 4, 8]) + "9,121\n", (), " holds codes 117, 121; choose one: --code 117"),
    ],
)
def test_what_gives_no_period_is_refused_in_one_line(refused, lines, arguments, complaint):
    assert complaint in refused(lines, *arguments)


def test_a_missing_file_and_a_folder_of_others_are_refused(evaluate, arrivals, tmp_path):
    status, _, err = evaluate("calibrate", "--arrivals", "none.csv")
    assert (status, err) == (2, "error: no arrival file none.csv; give a csv with columns t_s,code\n")
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis/chapter.tex").write_text("all of it")
    status, out, err = evaluate("calibrate", "--arrivals", "arrivals.csv", "--code", "117", "--out", "thesis")
    assert (status, out) == (2, "")
    assert err.startswith("error: --out thesis holds chapter.tex, which is no part of a calibration")


def test_a_full_disk_leaves_no_file_and_no_folder(evaluate, arrivals, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(command, "save_figure", full)
    status, _, err = evaluate("calibrate", "--arrivals", "arrivals.csv", "--code", "117", "--out", "out")
    assert (status, err) == (2, "error: [Errno 28] No space left on device\n")
    assert [path.name for path in tmp_path.iterdir()] == ["arrivals.csv"]


def test_the_picture_counts_every_difference_and_names_its_axes(arrivals):
    found = calibrate(arrivals.of_code(117))
    near, wide = plot_differences(found).axes
    counts = [sum(bar.get_height() for bar in axes.patches) for axes in (near, wide)]
    assert counts == [len(found.differences.of_kind(Kind.REGULAR)), found.differences.value.size]
    assert near.get_xlabel().endswith("[ms]") and wide.get_xlabel() == "difference [s]"


def test_the_picture_of_a_record_with_a_gap_of_hours_shows_the_rest():
    arrival = np.append(4.0 * np.arange(9), 40_000.0 + 4.0 * np.arange(9))
    _, wide = plot_differences(calibrate(arrival)).axes
    assert wide.get_xlim()[1] < 25.0
    assert sum(bar.get_height() for bar in wide.patches) == 17


def test_whole_seconds_tell_of_no_clock(evaluate, tmp_path, monkeypatch):
    """A period of 3.99979 s, exported in whole seconds, would look like 4 s with a standard error of 7e-8 s."""
    monkeypatch.chdir(tmp_path)
    times = [round(1000.0 + 3.99979 * k) for k in range(400)]
    (tmp_path / "whole.csv").write_text("t_s,code\n" + "".join(f"{time},7\n" for time in times))
    status, _, error = evaluate("calibrate", "--arrivals", "whole.csv")
    assert status == 2 and "all times are multiples of 1 s, of which no clock can be calibrated" in error
