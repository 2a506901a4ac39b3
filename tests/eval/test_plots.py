"""Pictures: each says what its axes are, is written as a PNG, and leaves pyplot alone."""

import math
import subprocess
import sys

import numpy as np
import pytest

from tagtrack.eval.plots import (
    EpisodePaths,
    TradeoffCurve,
    plot_calibration,
    plot_errors,
    plot_learning_curve,
    plot_track,
    plot_tradeoff,
    save_figure,
)
from tagtrack.eval.statistics.estimate import Interval


def some_track(steps=50):
    time = np.arange(steps)
    fish = np.stack([0.5 * time, 0.2 * time], axis=1)
    return EpisodePaths(fish=fish, vehicle=fish + 20.0, belief=fish + [3.0, 4.0])


def figures():
    near, far = Interval(value=0.2, low=0.1, high=0.3), Interval(value=0.6, low=math.nan, high=math.nan)
    error = Interval(value=5.0, low=4.0, high=6.5)
    return {
        "errors": plot_errors({"three_step": np.geomspace(1, 200, 100), "run": np.geomspace(0.5, 150, 100)}),
        "track": plot_track({"three_step": some_track(), "run": some_track()}, title="one episode"),
        "learning_curve": plot_learning_curve({"ppo": ([0, 1000, 2000], [9.0, math.nan, 5.0])}, {"three_step": 6.3}),
        "tradeoff": plot_tradeoff(
            {"circle": TradeoffCurve(inside=[near, far], error=[error, error], labels=["30 m", "10 m"])}
        ),
        "calibration": plot_calibration({"belief": {0.5: near, 0.9: far, 0.99: far}}),
    }


LABELS = {
    "errors": ("localization error [m]", "share of steps below [%]"),
    "track": ("x [m]", "y [m]"),
    "learning_curve": ("environment steps", "validation error [m]"),
    "tradeoff": ("share of time inside the perimeter [%]", "mean localization error [m]"),
    "calibration": ("", "share of time the truth lies inside [%]"),
}


@pytest.mark.parametrize("name", LABELS)
def test_each_picture_names_its_axes_and_is_a_png(name, tmp_path):
    figure = figures()[name]
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == LABELS[name]
    path = tmp_path / f"{name}.png"
    save_figure(path, figure)
    assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert path.stat().st_size > 5000
    assert list(tmp_path.iterdir()) == [path]


def test_error_curves_pass_half_at_the_median_of_the_legend():
    figure = plot_errors({"policy": np.append(np.arange(1.0, 12.0), np.nan)})
    (curve,) = figure.axes[0].get_lines()
    assert curve.get_label() == "policy, median 6 m"
    assert np.interp(50.0, curve.get_ydata(), curve.get_xdata()) == pytest.approx(6.0)
    assert figure.axes[0].get_xscale() == "log"


def test_lost_bound_is_drawn_only_where_errors_reach_it():
    def vertical(figure):
        return [line for line in figure.axes[0].get_lines() if list(line.get_xdata()) == [100.0, 100.0]]

    assert len(vertical(plot_errors({"a": np.geomspace(1, 500, 50)}))) == 1
    assert vertical(plot_errors({"a": np.geomspace(1, 50, 50)})) == []


def test_perfect_errors_can_be_drawn(tmp_path):
    save_figure(tmp_path / "zero.png", plot_errors({"oracle": np.zeros(10)}))


def test_tracks_share_one_scale_with_equal_axes_and_print_the_mean_error():
    figure = plot_track({"a": some_track(), "b": some_track(steps=400)})
    first, second = figure.axes
    assert first.get_xlim() == second.get_xlim()
    assert first.get_aspect() == second.get_aspect() == 1.0
    assert first.get_title() == "a\nmean error 5 m"
    assert [text.get_text() for text in first.texts] == ["50 m"]  # the scale bar


def test_more_tracks_than_fit_a_row_wrap_and_the_empty_panel_is_hidden():
    figure = plot_track({name: some_track() for name in "abcde"})
    assert [axes.get_visible() for axes in figure.axes] == [True] * 5 + [False] * 3
    assert [bool(axes.get_xlabel()) for axes in figure.axes[:5]] == [False, True, True, True, True]


def test_learning_curve_marks_its_best_point_and_draws_heuristics_as_levels():
    axes = figures()["learning_curve"].axes[0]
    labels = [line.get_label() for line in axes.get_lines()]
    assert "ppo, best 5 m" in labels
    level = axes.get_lines()[labels.index("three_step, 6.3 m")]
    assert set(level.get_ydata()) == {6.3}


def test_calibration_shows_the_share_beside_the_nominal_one():
    axes = figures()["calibration"].axes[0]
    assert [bar.get_height() for bar in axes.patches] == pytest.approx([20.0, 60.0, 60.0])
    nominal = sorted({segment[0][1] for lines in axes.collections for segment in lines.get_segments() if len(segment)})
    assert {50.0, 90.0, 99.0} <= set(nominal)


def test_drawing_loads_no_pyplot():
    program = (
        "import sys, tagtrack.eval.plots as plots; assert 'matplotlib' not in sys.modules;"
        "plots.plot_errors({'a': [1.0, 2.0]}); assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
