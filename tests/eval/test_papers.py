"""`tagtrack eval papers`: rows, files, repeatability and what is refused."""

import dataclasses
import json
import math
import re
from collections import Counter
from functools import partial

import numpy as np
import pytest

from tagtrack.eval.cells.engine import Engine
from tagtrack.eval.papers import command
from tagtrack.eval.papers.document import as_markdown_page, papers_document
from tagtrack.eval.papers.frame import QUICK, Experiment, Findings, Setting, Size, make_row
from tagtrack.eval.papers.lin2013_clock import HISTOGRAM_TWIN, PERIODS_TWIN
from tagtrack.eval.papers.masmitja2020_bound import BOUND_TWIN
from tagtrack.eval.papers.masmitja2020_field import FIELD
from tagtrack.eval.papers.pictures import plot_rows
from tagtrack.eval.papers.registry import EXPERIMENTS, WITHOUT_TWIN
from tagtrack.eval.papers.running import run_experiments
from tagtrack.eval.plots import empty_figure

KEYS = ["paper", "table", "row", "column", "paper_value", "ours", "low", "high", "unit", "note", "repeated"]

# Tables of ours that repeat a table or figure of a paper, and all that the papers number.
REPEATED = {
    "clark2013": {"Table II", "Table III", "Table IV", "Table V", "Fig. 7 and 8", "Fig. 8"},
    "lin2013": {"Table I", "Table II", "Table III", "Table IV", "Fig. 6", "Fig. 8", "Fig. 11", "Alg. 2"},
    "masmitja2020": {"Fig. 2A", "Fig. 3C", "Fig. 3D", "Fig. 3E", "Table 1", "Table S1"},
}
NUMBERED = {
    "clark2013": ["Table I", "Table II", "Table III", "Table IV", "Table V", *(f"Fig. {n}" for n in range(1, 10))],
    "lin2013": ["Table I", "Table II", "Table III", "Table IV", *(f"Fig. {n}" for n in range(1, 12))],
    "masmitja2020": ["Table 1", "Table 2", "Table S1", "Fig. 1", "Fig. 4", "Fig. 5", "Fig. 6"]
    + [f"Fig. S{n}" for n in range(1, 5)] + [f"Fig. 2{panel}" for panel in "ABCDE"] + [f"Fig. 3{panel}" for panel in "ABCDEFGH"],
}  # fmt: skip


def named_in(line):
    """Tables and figures that a line speaks of: of "Figs. 2B to 2D and S2" Fig. 2B, 2C, 2D and S2."""
    found = set()
    number = r"(?:S?\d+[A-H]?|[IV]+)\b"
    for kind, text in re.findall(rf"(Fig|Table)s?\.? ({number}(?:(?:, | and | to |, Figs\. ){number})*)", line):
        written = re.split(r", Figs\. |, | and ", text)
        for part in written:
            first, _, last = part.partition(" to ")
            span = [first]
            while last and span[-1] != last:
                digits, panel = re.fullmatch(r"(\d+)([A-H]?)", span[-1]).groups()
                span.append(digits + chr(ord(panel) + 1) if panel else str(int(digits) + 1))
            found |= {f"{'Fig.' if kind == 'Fig' else 'Table'} {each}" for each in span}
    return found


def row(repetitions, **changes):
    words = {"paper": "clark2013", "table": "Table III", "row": "PF", "column": "mean", "unit": "m", "note": "assumed: much"}
    return make_row(repetitions, **{**words, "paper_value": 24, **changes})


def make_experiment(paper="clark2013", rows=(), figures=()):
    def run(setting):
        setting.advance(setting.size.trials)
        return Findings(rows=rows, figures={name: empty_figure(width=2, height=2)[0] for name in figures})

    return Experiment(paper=paper, table="Table III", run=run, steps=lambda size: size.trials)


@pytest.fixture
def tiny(monkeypatch):
    """One experiment a paper, which costs nothing."""
    experiments = {
        "clark2013": (make_experiment(rows=[row([20, 25, 30])], figures=["clark2013_a"]),),
        "lin2013": (make_experiment("lin2013", rows=[row([1.0], paper="lin2013")]),),
    }
    monkeypatch.setattr(command, "EXPERIMENTS", experiments)


def test_ours_is_the_median_of_repetitions_within_their_middle_95_percent():
    found = row(np.arange(1001.0))
    assert (found.low, found.ours, found.high) == (25.0, 500.0, 975.0)


def test_a_row_has_the_agreed_keys_and_null_for_what_is_not_finite():
    assert list(row([1.0]).to_json()) == KEYS
    assert row([math.nan]).to_json()["ours"] is None


@pytest.mark.parametrize("size", [Size(), QUICK])
def test_every_experiment_can_tell_its_length(size):
    for paper, experiments in EXPERIMENTS.items():
        for experiment in experiments:
            assert experiment.paper == paper
            assert experiment.steps(size) > 0


@pytest.mark.parametrize("paper", EXPERIMENTS)
def test_every_table_and_figure_of_a_paper_is_repeated_or_said_to_be_left_out(paper):
    assert named_in("Figs. 2B to 2D and S2: so") == {"Fig. 2B", "Fig. 2C", "Fig. 2D", "Fig. S2"}
    covered = set().union(*map(named_in, (*REPEATED[paper], *WITHOUT_TWIN[paper])))
    assert set(NUMBERED[paper]) <= covered


def test_a_paper_is_a_choice_only_where_an_experiment_has_a_twin():
    assert set(EXPERIMENTS) == {"clark2013", "lin2013", "masmitja2020"}


def test_a_page_sets_printed_beside_ours_and_marks_what_lies_outside():
    rows = [row([20, 25, 30]), row([50, 60], column="median"), row([3.99979], column="T_c", unit="s", paper_value=3.99979)]
    experiment = make_experiment()
    found = {experiment: Findings(rows=rows)}
    page = as_markdown_page(papers_document(found, seconds={experiment: 1.0}, seed=0, size=QUICK, versions={}))
    assert "## clark2013, Table III" in page
    assert "|  | mean [m] | median [m] | T_c [s] |" in page
    assert "| PF | 24.0 → 25.0 [20.2, 29.8] | 24.0 → 55.0 [50.2, 59.8] * | 3.99979 → 3.99979 [3.99979, 3.99979] |" in page
    assert page.count("assumed: much") == 1


def test_where_a_paper_prints_nothing_a_dash_stands_beside_ours_and_nothing_is_counted(evaluate, monkeypatch, tmp_path):
    rows = [row([20, 25, 30]), row([1.0], table="Fig. 11", unit="s", paper_value=math.nan)]
    assert rows[1].to_json()["paper_value"] is None
    experiment = make_experiment(rows=rows)
    document = papers_document({experiment: Findings(rows=rows)}, seconds={}, seed=0, size=QUICK, versions={})
    page = as_markdown_page(document)
    assert "| PF | - → 1.00 [1.00, 1.00] |" in page and "*" not in page
    monkeypatch.setattr(command, "EXPERIMENTS", {"clark2013": (experiment,)})
    _, out, _ = evaluate("papers", "--out", tmp_path / "p")
    counts = [line.split() for line in out.splitlines() if "clark2013," in line]
    assert [cells[-2:] for cells in counts] == [["1", "1"], ["0", "-"]]


def test_a_picture_has_a_panel_for_each_table():
    figure = plot_rows([row([20, 25]), row([1, 2], table="Table III, bounded")], "error [m]")
    assert [axes.get_title() for axes in figure.axes] == ["Table III", "Table III, bounded"]


def test_it_writes_rows_page_and_pictures(evaluate, tiny, tmp_path):
    status, out, err = evaluate("papers", "--quick", "--out", tmp_path / "p")
    assert (status, err) == (0, "")
    assert "clark2013, Table III" in out and "written: " in out
    assert sorted(path.name for path in (tmp_path / "p").iterdir()) == ["clark2013_a.png", "papers.json", "papers.md"]
    document = json.loads((tmp_path / "p/papers.json").read_text(encoding="utf-8"))
    assert [found["paper"] for found in document["rows"]] == ["clark2013", "lin2013"]
    assert list(document["rows"][0]) == KEYS
    assert document["size"] == dataclasses.asdict(QUICK)
    assert list(document["seconds"]) == ["clark2013, Table III", "lin2013, Table III"]
    assert {"tagtrack", "commit", "python", "numpy"} <= set(document["versions"])


def test_one_paper_alone_replaces_an_earlier_result(evaluate, tiny, tmp_path):
    assert evaluate("papers", "--out", tmp_path / "p")[0] == 0
    assert evaluate("papers", "--paper", "lin2013", "--out", tmp_path / "p")[0] == 0
    assert sorted(path.name for path in (tmp_path / "p").iterdir()) == ["papers.json", "papers.md"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--paper", "einstein1905"), "error: unknown paper 'einstein1905'; known: clark2013, lin2013, masmitja2020\n"),
        (("--seed", "-1"), "error: seed must be from 0 to 2147483647, got -1\n"),
        (("--processes", "0"), "error: --processes must be at least 1, got 0\n"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(evaluate, tmp_path, arguments, complaint):
    assert evaluate("papers", "--quick", *arguments, "--out", tmp_path / "p") == (2, "", complaint)
    assert not (tmp_path / "p").exists()


def test_a_folder_of_others_is_refused(evaluate, tmp_path):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis/chapter.tex").write_text("all of it")
    status, _, err = evaluate("papers", "--out", tmp_path / "thesis")
    assert status == 2
    assert "holds chapter.tex, which is no part of a comparison with the papers" in err


SMALL = Size(
    recorded=2,
    trials=1,
    moving=2,
    moving_seconds=120,
    stationary=2,
    records=2,
    offline=1,
    astray=3,
    particles=50,
    settings=2,
    settings_seconds=1300,
    tracked=2,
    area_particles=50,
)


@pytest.mark.parametrize(
    "experiment", [each for experiments in EXPERIMENTS.values() for each in experiments], ids=lambda each: each.table
)
def test_an_experiment_tells_its_progress_and_repeats_itself(experiment, request):
    done = []
    data = request.getfixturevalue("tagtrack_data") if experiment is FIELD else None
    first = experiment.run(Setting(size=SMALL, seed=3, data=data, advance=done.append))
    assert sum(done) == experiment.steps(SMALL)
    assert {found.paper for found in first.rows} == {experiment.paper}
    assert all(found.note and found.unit for found in first.rows)
    assert all(name.startswith(f"{experiment.paper}_") for name in first.figures)
    assert {found.table.partition(",")[0] for found in first.rows} <= REPEATED[experiment.paper]
    cells = [(found.table, found.row, found.column) for found in first.rows]
    assert len(set(cells)) == len(cells)
    again = experiment.run(Setting(size=SMALL, seed=3, data=data))
    assert [found.to_json() for found in again.rows] == [found.to_json() for found in first.rows]


def test_experiments_in_processes_find_and_report_what_they_do_one_after_another():
    """Three that simulate no vehicle, and so compile nothing."""
    chosen = [HISTOGRAM_TWIN, PERIODS_TWIN, BOUND_TWIN]
    found, reported = [], []
    for processes in (1, 2):
        done = Counter()
        tell = partial(lambda counter, title, steps: counter.update({title: steps}), done)
        taken = run_experiments(chosen, Setting(size=SMALL, seed=3), Engine(processes=processes), tell)
        found.append({each.table: [row.to_json() for row in findings.rows] for each, (findings, _) in taken.items()})
        reported.append(done)
    assert json.dumps(found[0]) == json.dumps(found[1]) and list(found[1]) == [each.table for each in chosen]
    with pytest.raises(ValueError, match="negative"):
        run_experiments(chosen, Setting(size=SMALL, seed=-1), Engine(processes=2))
    assert reported[0] == reported[1] == {f"{each.paper}, {each.table}": each.steps(SMALL) for each in chosen}


@pytest.mark.slow
def test_a_quick_run_of_all_papers_as_a_command(run_python, tmp_path):
    code = "import sys; from tagtrack.eval.cli import main; sys.exit(main(sys.argv[1:]))"
    run_python(code, "papers", "--quick", "--out", str(tmp_path / "p"))
    document = json.loads((tmp_path / "p/papers.json").read_text(encoding="utf-8"))
    assert {found["paper"] for found in document["rows"]} == set(EXPERIMENTS)
