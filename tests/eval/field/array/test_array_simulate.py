"""`tagtrack eval array simulate`: its scene, its figures against the bound, and what it prints and writes."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import run

import numpy as np
import pytest

from tagtrack.eval.field.array.monte_carlo import Outcome, bound_of_pings, repeat, summarize
from tagtrack.eval.field.array.plots import plot_bound
from tagtrack.eval.field.array.scene import ARRAYS, Noise, Scene, place_receivers
from tagtrack.eval.field.array.simulate import Simulate
from tagtrack.eval.field.static_array.model import ArraySetting
from tagtrack.eval.field.static_array.registry import METHODS

ONE_MS = Noise(sigma=1e-3)
SMALL = ("array", "simulate", "--runs", "2", "--sigma", "0.001", "--speed", "1", "--methods", "wls", "wls_ml")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Simulate().make_scene()


def test_target_goes_equal_ways_in_equal_times_among_and_around_the_receivers(scene: Scene) -> None:
    ways = np.linalg.norm(np.diff(scene.position, axis=0), axis=1)
    assert ways.max() <= 24.0 + 1e-6  # 0.2 m/s for 120 s; the chord of a bend is a little shorter
    assert ways.min() > 23.5
    assert 0.3 < scene.inside.mean() < 0.7
    assert np.abs(scene.position).max() < 250  # as far as tags are heard


def test_inside_is_the_square_between_the_receivers(scene: Scene) -> None:
    np.testing.assert_array_equal(scene.inside, np.all(np.abs(scene.position) <= 100, axis=1))


def test_acceleration_is_found_from_a_track_that_was_made_with_it(scene: Scene) -> None:
    rng, dt, sigma = np.random.default_rng(1), 60.0, 2e-3
    first, second = rng.standard_normal((2, 4000, 2))
    velocity = sigma * np.sqrt(dt) * np.cumsum(first, axis=0)
    start = np.vstack([np.zeros(2), velocity[:-1]])
    # Given the change of velocity the way deviates by its half, dt / 2 of it, and by sqrt(dt^3 / 12).
    way = dt * start + 0.5 * dt * sigma * np.sqrt(dt) * first + sigma * np.sqrt(dt**3 / 12) * second
    made = dataclasses.replace(scene, position=np.cumsum(way, axis=0), delay=dt)
    assert made.acceleration_sigma == pytest.approx(sigma, rel=0.05)  # of 8000 terms: 1 % and their overlap


def test_noise_and_outliers_are_as_large_and_as_many_as_asked_for(scene: Scene) -> None:
    long = dataclasses.replace(scene, position=np.tile(scene.position, (40, 1)))
    flight = np.linalg.norm(long.position[:, None] - long.receivers, axis=-1) / 1500
    sent = 120.0 * np.arange(len(long.position))[:, None]
    clean = long.draw_pings(ONE_MS, np.random.default_rng(0)).arrival - sent - flight
    assert np.std(clean) == pytest.approx(1e-3, rel=0.03)  # of 8480
    spoilt = long.draw_pings(Noise(sigma=1e-9, outliers=0.05), np.random.default_rng(0)).arrival - sent
    far = spoilt / flight > 2
    assert np.mean(far) == pytest.approx(0.05, abs=0.01)
    np.testing.assert_allclose(spoilt[far] / flight[far], 4.0, rtol=1e-5)


def test_random_delays_are_within_a_fifth_of_the_mean(scene: Scene) -> None:
    random = dataclasses.replace(scene, random_delay=True)
    gaps = np.diff(random.draw_pings(ONE_MS, np.random.default_rng(0)).time)
    assert 95 < gaps.min() < 110 and 130 < gaps.max() < 145


def test_bound_in_the_middle_of_a_square_is_sound_speed_times_sigma(scene: Scene) -> None:
    # Four directions at right angles: the information is 2 / (c sigma)^2 on either axis.
    middle = dataclasses.replace(scene, position=np.zeros((1, 2)))
    np.testing.assert_allclose(bound_of_pings(middle, ONE_MS), 1500 * 1e-3)


def test_wls_ml_reaches_the_bound_inside_the_array(scene: Scene) -> None:
    methods = {"wls_ml": METHODS["wls_ml"]}
    found = repeat(scene, [ONE_MS], methods, {ONE_MS: ArraySetting(sigma=1e-3)}, runs=30, seed=0)
    figures = summarize(scene, found)["noises"][0]
    assert figures["methods"]["wls_ml"]["rmse_inside_m"]["value"] == pytest.approx(figures["bound_inside_m"], rel=0.1)


def test_a_run_is_the_same_whatever_else_is_run(scene: Scene) -> None:
    settings = {ONE_MS: ArraySetting(sigma=1e-3), Noise(sigma=2e-3): ArraySetting(sigma=2e-3)}
    methods = {name: METHODS[name] for name in ("wls", "wls_ml")}
    alone = repeat(scene, [ONE_MS], {"wls": METHODS["wls"]}, settings, runs=2, seed=3)
    beside = repeat(scene, list(settings), methods, settings, runs=3, seed=3)
    np.testing.assert_array_equal(alone[ONE_MS]["wls"].error, beside[ONE_MS]["wls"].error[:2])


def test_rmse_leaves_out_pings_without_a_position() -> None:
    outcome = Outcome(error=np.array([[3.0, np.nan, 5.0], [np.nan, 1.0, np.nan]]), seconds=np.zeros(2))
    np.testing.assert_allclose(outcome.rmse(np.array([True, True, True])), [np.sqrt(17), 1.0])
    np.testing.assert_allclose(outcome.rmse(np.array([True, False, True])), [np.sqrt(17), np.nan])


def test_every_array_of_the_paper_has_a_map(scene: Scene) -> None:
    figure = plot_bound(scene, 200.0, 1e-3)
    titles = [axes.get_title() for axes in figure.axes]
    assert [sum(name in title for title in titles) for name in ARRAYS] == [4, 1, 1, 1, 1]  # "square" is in four of them
    assert len(place_receivers("square and middle", 200.0)) == 5


def test_command_prints_and_writes_figures_and_pictures(tmp_path: Path, repository: Path) -> None:
    command = [sys.executable, "-m", "eval", *SMALL, "--out", str(tmp_path / "out")]
    done = run(command, cwd=repository, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("bound") >= 2 and "wls_ml" in done.stdout and "5 % out" in done.stdout
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"simulation.json", "table.md", "rmse.png", "rmse_over_time.png", "bound.png", "time.png"}
    document = json.loads((tmp_path / "out" / "simulation.json").read_text())
    assert [noise["outliers"] for noise in document["noises"]] == [0.0, 0.05]
    assert list(document["noises"][0]["methods"]) == ["wls", "wls_ml"] == list(document["seconds_per_position"])
    assert document["delay"] == 120.0 and document["speed"] == 1.0
    page = (tmp_path / "out" / "table.md").read_text()
    assert "## Inside" in page and "## Outside" in page and "| bound |" in page


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--methods", "wsl"), "unknown method 'wsl'; known: wls, ml"),
        (("--runs", "0"), "--runs must be at least 1, got 0"),
        (("--outliers", "1.5"), "--outliers must be a share in [0, 1), got 1.5"),
        (("--speed", "-1"), "--speed must be positive, got -1.0"),
        (("--delay", "nan"), "--delay must be positive, got nan"),
        (("--sigma", "-0.001"), "sigma must be positive, got -0.001"),
        (("--speed", "10"), "too short for steps of 1200 m"),
        (("--seed", "-1"), "--seed must not be negative, got -1"),
    ],
)
def test_bad_choices_are_refused_in_one_line(
    evaluate: Callable[..., tuple[int, str, str]], tmp_path: Path, arguments: tuple[str, ...], complaint: str
) -> None:
    status, out, err = evaluate("array", "simulate", *arguments, "--out", tmp_path / "out")
    assert (status, out) == (2, "")
    assert err.startswith("error: ") and err.count("\n") == 1 and complaint in err
    assert not (tmp_path / "out").exists()


def test_the_authors_own_path_has_19_points_60_metres_apart_and_one_late_arrival_a_passage() -> None:
    command = Simulate(paper_path=True, late=0.1)
    command.check()
    scene, noises = command.make_scene(), command.list_noises()
    assert scene.position.shape == (19, 2) and scene.delay == 60.0
    np.testing.assert_allclose(np.linalg.norm(np.diff(scene.position, axis=0), axis=1), 60.0)
    corners = scene.position[[0, 3, 7, 11, 18]].tolist()  # of their program, its receivers at (+-100, +-100)
    assert corners == [[0, 0], [0, 180], [240, 180], [240, -60], [-180, -60]]
    assert command.make_setting(scene, noises[0]).first_speed_sigma == 1.0
    assert [noise.label for noise in noises][-1] == "1.5 ms, one 0.1 s late"
    flight = np.linalg.norm(scene.position[:, None] - scene.receivers, axis=-1) / 1500
    pings = scene.draw_pings(Noise(sigma=1e-9, late=0.1), np.random.default_rng(0))
    late = pings.arrival - 60.0 * np.arange(19)[:, None] - flight
    assert (np.abs(late - 0.1) < 1e-6).sum() == 1 and (np.abs(late) < 1e-6).sum() == 75


def test_options_of_the_authors_path_do_not_go_with_others() -> None:
    with pytest.raises(ValueError, match="drop --speed and --delay"):
        Simulate(paper_path=True, speed=1.0).check()
    with pytest.raises(ValueError, match="--late must be from 0 to 10 s, got -1"):
        Simulate(late=-1).check()
