"""A range test finds the water it was made in, and says where it tells nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, binomtest

from tagtrack.live.range_test import Curve, Trials, count_by_distance, fit_curve, wilson
from tests.live.test_steer import Live

TRUE = Curve(near=0.85, reach=250.0, width=30.0)


def trials(count: int, seed: int = 0) -> Trials:
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0.0, 500.0, count)
    return Trials(distance=distance, heard=rng.random(count) < TRUE.at(distance))


def test_the_curve_of_the_water_is_found() -> None:
    found = fit_curve(trials(20_000))
    assert (found.near, found.reach, found.width) == pytest.approx((0.85, 250.0, 30.0), rel=0.06)


def test_shares_and_their_intervals() -> None:
    rows = count_by_distance(trials(5000), 100.0)
    assert [row["from_m"] for row in rows] == [0.0, 100.0, 200.0, 300.0, 400.0]
    assert rows[0]["share"] == pytest.approx(0.85, abs=0.03)
    assert wilson(7, 20) == pytest.approx(binomtest(7, 20).proportion_ci(method="wilson"), abs=1e-6)
    held = sum(binom.pmf(k, 40, 0.8) for k in range(41) if wilson(k, 40)[0] <= 0.8 <= wilson(k, 40)[1])
    assert 0.92 < held < 0.97


def test_a_buoy_past_which_a_tag_is_towed(tmp_path: Path, live: Live) -> None:
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 20_000.0, 10.0)
    x = 500.0 * np.abs(((t / 2000.0) % 2.0) - 1.0)
    heard = rng.random(t.size) < TRUE.at(x)
    (tmp_path / "buoy.csv").write_text("t,x,y\n0,0,0\n20000,0,0\n")
    (tmp_path / "boat.csv").write_text("t,x,y\n" + "".join(f"{a},{b},0\n" for a, b in zip(t, x, strict=True)))
    (tmp_path / "pings.csv").write_text("t,tag\n" + "".join(f"{a + 3},7\n" for a in t[heard]))
    logs = ("--log", tmp_path / "buoy.csv", tmp_path / "pings.csv", "--reference", tmp_path / "boat.csv")
    status, shown, error = live("range-test", *logs, "--interval", 10, "--bin", 100, "--out", tmp_path / "out")
    assert status == 0, error
    found = json.loads((tmp_path / "out" / "range_test.json").read_text())
    assert found["curve"]["reach_m"] == pytest.approx(250.0, abs=15.0)
    assert found["overrides"] in shown and (tmp_path / "out" / "range_test.png").stat().st_size > 5000
    for options, message in (
        (("--interval", 0), "--interval must be a positive number"),
        (("--interval", 10, "--tag", 8), "tag 8 is not in the log; it has 7"),
        (("--interval", 10, "--bin", 0), "--bin must be a positive number"),
        (("--interval", 30_000), "at least 30 expected pings"),
    ):
        status, _, error = live("range-test", *logs, *options)
        assert status == 2 and message in error


def test_receivers_of_the_public_tow(tagtrack_data: Path, live: Live) -> None:
    """Nineteen moored receivers and a towed tag: most pings near by, half of that at some 200 m."""
    folder = tagtrack_data / "ssu1"
    status, shown, error = live(
        "range-test", "--detections", folder / "test_tag_detections.csv.gz", "--receivers", folder / "receivers.csv",
        "--reference", folder / "gps_track.csv", "--interval", 30,
    )  # fmt: skip
    assert status == 0, error
    assert "chance 0.80 near by, half of it at 201 m" in shown


@pytest.mark.parametrize(("heard", "message"), [(True, "all of 50 .* go further off"), (False, "none of 50 .* go nearer")])
def test_what_tells_nothing_is_said(heard: bool, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fit_curve(Trials(distance=np.linspace(0, 100, 50), heard=np.full(50, heard)))
    with pytest.raises(ValueError, match="at least 30 expected pings, got 5"):
        fit_curve(Trials(distance=np.linspace(0, 100, 5), heard=np.full(5, heard)))
