"""Names that tags, receivers, policies and folders may have do nothing where they are shown."""

from __future__ import annotations

import csv
import gzip

import numpy as np
import pytest
from matplotlib.figure import Figure

from tagtrack.envs import csv_table
from tagtrack.envs.csv_table import name_cell, name_field, open_csv, printable_name
from tagtrack.envs.motions.tracks import Track
from tagtrack.eval.field.array.maps import Cloud, plot_map
from tagtrack.eval.field.telemetry import read_tracks, write_tracks
from tagtrack.eval.plots import plot_errors, plot_learning_curve, save_figure
from tagtrack.eval.report import as_markdown

FORMULA = '=HYPERLINK("http://evil","a, b")'
RECEIVERS = np.array([[0.0, 0.0], [100.0, 0.0]])


def test_dollars_in_names_are_no_formulas(tmp_path):
    names = ["a$1$", "$x", r"$\frac{$"]
    save_figure(tmp_path / "map.png", plot_map([Cloud(name=name, position=RECEIVERS) for name in names], RECEIVERS, names[:2]))
    save_figure(tmp_path / "curve.png", plot_learning_curve({name: ([0.0, 1.0], [5.0, 4.0]) for name in names}, {}))
    save_figure(tmp_path / "errors.png", plot_errors({name: np.array([1.0, 20.0, 300.0]) for name in names}))


def test_powers_of_ten_on_axes_stay_powers(tmp_path):
    figure = Figure()
    axes = figure.add_subplot(xscale="log", xlim=(1, 1000), title="$1$")
    save_figure(tmp_path / "powers.png", figure)
    powers = [label for label in axes.get_xticklabels() if label.get_text().startswith("$")]
    assert powers and all(label.get_parse_math() for label in powers) and not axes.title.get_parse_math()


@pytest.mark.parametrize("name", [FORMULA, "+1", "-tag", "@SUM(1)"])
def test_a_name_that_begins_like_a_formula_is_text_in_csv_files_and_is_read_back(tmp_path, name):
    write_tracks(tmp_path / "tracks.csv", {name: Track(time=np.arange(2.0), position=RECEIVERS)})
    with (tmp_path / "tracks.csv").open(newline="") as file:
        assert [row["tag"] for row in csv.DictReader(file)] == [f"'{name}"] * 2
    assert list(read_tracks(tmp_path / "tracks.csv").of) == [name]
    assert next(csv.reader([name_field(name)])) == [f"'{name}"] and printable_name(name_cell(name), "tag") == name


def test_ordinary_names_stay_as_they_are():
    assert name_cell("A69-1601-7") == name_field("A69-1601-7") == "A69-1601-7"


def test_markdown_shows_names_letter_by_letter():
    text = as_markdown(["policy"], [["<img src=x onerror=alert(1)>"], ["[a](http://evil)"], ["a|b\nc"]], "<b> note")
    assert "<" not in text and "](" not in text and r"a\|b c" in text


def test_a_gzip_file_that_swells_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, "_SWELLS", 1 << 16)
    (tmp_path / "bomb.csv.gz").write_bytes(gzip.compress(b"t_unix_s,x,y\n" + b"0,0,0\n" * 1_000_000))
    with pytest.raises(ValueError, match="unpacks to more than 200 times its size, as no data do"):
        with open_csv(tmp_path / "bomb.csv.gz", "track", ("t_unix_s",)) as table:
            for _ in table.blocks(1 << 12):
                pass


def test_a_table_of_too_many_rows_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, "_MOST_ROWS", 10_000)
    (tmp_path / "long.csv").write_text("t_unix_s,x,y\n" + "0,0,0\n" * 20_000)
    with pytest.raises(ValueError, match="has more than 10,000 rows; divide it"):
        with open_csv(tmp_path / "long.csv", "track", ("t_unix_s",)) as table:
            list(table.rows(("t_unix_s",)))
