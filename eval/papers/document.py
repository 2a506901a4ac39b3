"""papers.json and what is printed from it: tables of rows and columns, each figure as printed -> ours [low, high]."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from tagtrack.eval.papers.frame import Experiment, Findings, Size
from tagtrack.eval.papers.registry import WITHOUT_TWIN
from tagtrack.eval.report import Document, as_console_table, as_markdown, interval_cell, value_cell

if TYPE_CHECKING:
    from rich.table import Table

INTRODUCTION = (
    "Each cell: what the paper prints → ours. The papers did each experiment once; ours is the median of many simulated "
    "repetitions, in brackets their middle 95 %. A star marks a printed figure outside of it, a dash stands where none is "
    "printed. Field data cannot be repeated: brackets there are how sure ours is, and no star judges the printed figure. "
    "Nothing in a paper's own tables was tuned to match but what a note names. The tables whose names go on after a "
    "comma change one assumption at a time; their values were chosen after a look at several, so they explain a difference "
    "and predict nothing."
)


def papers_document(
    found: Mapping[Experiment, Findings],
    *,
    seconds: Mapping[Experiment, float],
    seed: int,
    size: Size,
    versions: Mapping[str, str],
) -> Document:
    """What papers.json holds."""
    return {
        "rows": [row.to_json() for findings in found.values() for row in findings.rows],
        "seconds": {f"{experiment.paper}, {experiment.table}": round(taken, 1) for experiment, taken in seconds.items()},
        "seed": seed,
        "size": dataclasses.asdict(size),
        "versions": dict(versions),
    }


def as_markdown_page(document: Document) -> str:
    """papers.md."""
    lines = ["# The papers' tables, repeated in simulation", "", INTRODUCTION, ""]
    for title, header, cells, note in _tables(document):
        lines += [f"## {title}", "", as_markdown(header, cells, note)]
    for paper in dict.fromkeys(row["paper"] for row in document["rows"]):
        if left := WITHOUT_TWIN.get(paper):
            lines += [f"## {paper}, without a table here", "", *(f"- {line}" for line in left), ""]
    time = ", ".join(f"{table} {taken:.0f} s" for table, taken in document["seconds"].items())
    size = ", ".join(f"{name} {number}" for name, number in document["size"].items())
    return "\n".join([*lines, f"Seed {document['seed']}; {size}. Time taken: {time}.", ""])


def console_table(document: Document) -> Table:
    """How many printed figures each table of ours holds within its intervals; papers.md has them all."""
    tables: dict[str, list[bool]] = {}
    for row in document["rows"]:
        agree = tables.setdefault(f"{row['paper']}, {row['table']}", [])
        if row["paper_value"] is not None and row["repeated"]:
            agree.append(_agrees(row))
    cells = [[table, str(len(agree)), str(sum(agree)) if agree else "-"] for table, agree in tables.items()]
    note = "Within: printed figures inside the middle 95 % of our repetitions. papers.md has every figure, and what was assumed."
    return as_console_table(["table", "printed", "within"], cells, note)


def _tables(document: Document) -> Iterator[tuple[str, list[str], list[list[str]], str]]:
    """Title, header, cells and note of each table."""
    tables: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in document["rows"]:
        tables.setdefault((row["paper"], row["table"]), []).append(row)
    for (paper, table), rows in tables.items():
        columns = list(dict.fromkeys(_column(row) for row in rows))
        cells: dict[str, dict[str, str]] = {}
        for row in rows:
            cells.setdefault(row["row"], {})[_column(row)] = _cell(row)
        filled = [[name, *(found.get(column, "") for column in columns)] for name, found in cells.items()]
        note = "\n\n".join(dict.fromkeys(row["note"] for row in rows))
        yield f"{paper}, {table}", ["", *columns], filled, note


def _column(row: Mapping[str, Any]) -> str:
    return row["column"] if row["unit"] == "1" else f"{row['column']} [{row['unit']}]"


def _cell(row: Mapping[str, Any]) -> str:
    figure = {"value": row["ours"], "low": row["low"], "high": row["high"]}
    printed = value_cell({"value": row["paper_value"]})
    ours = interval_cell(figure)
    if row["paper_value"] is None:
        return f"{printed} → {ours}"
    if row["unit"] == "s":  # printed periods: three digits would hide what they are about
        printed = f"{row['paper_value']:.5f}"
        ours = f"{row['ours']:.5f} [{row['low']:.5f}, {row['high']:.5f}]"
    return f"{printed} → {ours}" + ("" if _agrees(row) or not row["repeated"] else " *")


def _agrees(row: Mapping[str, Any]) -> bool:
    """Whether the printed figure lies within our interval."""
    return row["low"] is not None and row["low"] <= row["paper_value"] <= row["high"]
