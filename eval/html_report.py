"""A benchmark on one page: `report.html`, which needs no other file, no network and no script.

Names of policies, tags and files come from users and strangers: all text is escaped, and a content policy forbids the page to run
or to fetch anything.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from tagtrack.eval.comparison import Comparison
from tagtrack.eval.plots import COLOURS
from tagtrack.eval.report import Document, caption, table_rows

LARGEST = 1500  # points of a policy in the scatter
SIDE, MARGIN = 420, 52  # of the scatter [pixels]

STYLE = """
:root { color-scheme: light; --ink: #26323e; --faint: #5d6b78; --line: #d8e0e6; }
body { color: var(--ink); background: #fff; font: 16px/1.5 system-ui, sans-serif; }
body { margin: 0 auto; max-width: 62rem; padding: 1rem; }
h1 { font-size: 1.6rem; overflow-wrap: anywhere; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: .3rem .7rem; text-align: right; vertical-align: top; }
th:first-child, td:first-child { text-align: left; white-space: normal; overflow-wrap: anywhere; min-width: 6rem; }
small { color: var(--faint); }
td { white-space: nowrap; } .settings td { text-align: left; white-space: normal; overflow-wrap: anywhere; }
img, svg { max-width: 100%; height: auto; } figure { margin: 1rem 0; } figcaption, .note { color: var(--faint); }
pre { background: #f4f7f9; overflow-x: auto; padding: .7rem; white-space: pre-wrap; overflow-wrap: anywhere; }
"""
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


@dataclass(frozen=True, kw_only=True)
class Illustration:
    """A picture of the page."""

    title: str
    data: bytes
    kind: str  # png, gif
    words: str  # for those who do not see it


def html_report(
    document: Document,
    comparison: Comparison,
    *,
    settings: Mapping[str, Any],
    command: str,
    pictures: Sequence[Illustration],
) -> str:
    """The page.

    Args:
        document: what benchmark.json holds. settings: what was asked for (config.json). command: that repeats it.
    """
    title = f"{document['env']}: {', '.join(document['policies'])}"
    parts = [
        f"<h1>{escape(document['env'])}</h1>",
        "<h2>Errors</h2>",
        _table(*table_rows(document)),
        f'<p class="note">{escape(caption(document))}</p>',
        *_run_tables(document),
        *(_figure(picture) for picture in pictures),
        "<h2>Episode by episode</h2>",
        _scatter(comparison),
        "<h2>The command</h2>",
        f"<pre>{escape(command)}</pre>",
        "<h2>Settings</h2>",
        _pairs(settings),
        "<h2>Versions</h2>",
        _pairs(document["versions"]),
    ]
    body = "\n".join(parts)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = ["".join(f"<td>{_broken(escape(cell))}</td>" for cell in row) for row in rows]
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in header)
    body = "\n".join(f"<tr>{row}</tr>" for row in cells)
    return f'<div class="wide"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>'


def _broken(cell: str) -> str:
    """An interval goes below its figure, so that more columns are seen at once."""
    figure, mark, interval = cell.partition(" [")
    return f"{figure}<br><small>[{interval}</small>" if mark and figure.replace(".", "").isdigit() else cell


def _run_tables(document: Document) -> Iterator[str]:
    """Of each training its runs: what the seed was worth."""
    for name, runs in document["groups"].items():
        rows = [[run, f"{found['mean_error_m']:.3g}", f"{found['ratio']:.3g}"] for run, found in runs.items()]
        yield f"<h2>Training runs of {escape(name)}</h2>"
        yield _table(["run", "mean error [m]", f"{next(iter(document['policies']))} / run"], rows)


def _figure(picture: Illustration) -> str:
    data = base64.b64encode(picture.data).decode("ascii")
    image = f'<img alt="{escape(picture.words)}" src="data:image/{picture.kind};base64,{data}">'
    return f"<h2>{escape(picture.title)}</h2>\n<figure>{image}<figcaption>{escape(picture.words)}</figcaption></figure>"


def _pairs(values: Mapping[str, Any]) -> str:
    rows = [f"<tr><td>{escape(str(name))}</td><td>{escape(_told(value))}</td></tr>" for name, value in values.items()]
    return f'<div class="wide"><table class="settings"><tbody>\n{chr(10).join(rows)}\n</tbody></table></div>'


def _told(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {_told(each)}" for name, each in value.items()) or "-"
    if isinstance(value, list | tuple):
        return ", ".join(map(_told, value)) or "-"
    return "-" if value is None else str(value)


def _scatter(comparison: Comparison) -> str:
    """Each episode's mean error under every policy against that under the first, on logarithmic axes, as SVG."""
    errors = {name: np.maximum(error, 1e-3) for name, error in comparison.mean_errors().items()}
    first, *others = errors
    if not others:
        return f"<p>{escape(first)} stands alone: there is nothing to compare it with.</p>"
    shown = np.unique(np.linspace(0, comparison.episodes - 1, min(comparison.episodes, LARGEST)).astype(int))
    everything = np.concatenate([error[shown] for error in errors.values()])
    low, high = np.log10(everything.min()) - 0.05, np.log10(everything.max()) + 0.05

    def place(error: float) -> float:
        return float((np.log10(error) - low) / (high - low) * (SIDE - MARGIN - 10))

    parts = list(_axes(low, high, place, first))
    for name, colour in zip(others, _cycle(len(others)), strict=True):
        points = [
            f'<circle cx="{MARGIN + place(errors[first][e]):.1f}" cy="{SIDE - MARGIN - place(errors[name][e]):.1f}" r="3">'
            f"<title>{escape(name)}, seed {comparison.seed + e}: {errors[name][e]:.3g} m against {errors[first][e]:.3g} m</title>"
            "</circle>"
            for e in shown.tolist()
        ]
        parts.append(f'<g fill="{colour}" fill-opacity="0.55">{"".join(points)}</g>')
    legend = " ".join(
        f'<span style="color:{colour}">&#9679;</span> {escape(name)}'
        for name, colour in zip(others, _cycle(len(others)), strict=True)
    )
    words = f"Mean error of each episode under {', '.join(others)}, against that under {first}. Below the line is better."
    svg = f'<svg viewBox="0 0 {SIDE} {SIDE}" width="{SIDE}" role="img" aria-label="{escape(words)}">{"".join(parts)}</svg>'
    note = f"{escape(words)} Rest the pointer on a point to see its seed."
    return f"<figure><div>{legend}</div>{svg}<figcaption>{note}</figcaption></figure>"


def _axes(low: float, high: float, place: Any, first: str) -> Iterator[str]:
    """The frame, where both are equal, and round numbers along both axes."""
    end = SIDE - 10
    bottom = SIDE - MARGIN
    yield f'<path d="M{MARGIN} 10V{bottom}H{end}" fill="none" stroke="#9aa0a6"/>'
    yield f'<path d="M{MARGIN} {bottom}L{end} 10" stroke="#9aa0a6" stroke-dasharray="4 4"/>'
    ticks = [digit * 10.0**power for power in range(int(np.floor(low)), int(np.ceil(high)) + 1) for digit in (1, 2, 5)]
    for value in (tick for tick in ticks if low <= np.log10(tick) <= high):
        x = place(value)
        yield f'<text x="{MARGIN + x:.1f}" y="{bottom + 18}" font-size="12" text-anchor="middle" fill="#5d6b78">{value:g}</text>'
        yield f'<text x="{MARGIN - 6}" y="{bottom - x + 4:.1f}" font-size="12" text-anchor="end" fill="#5d6b78">{value:g}</text>'
    label = f"{escape(first)}, mean error of the episode [m]"
    turned = 'text-anchor="end" fill="#26323e" transform="rotate(-90 14 10)"'
    yield f'<text x="14" y="10" font-size="13" {turned}>that of the other policy [m]</text>'
    yield f'<text x="{end}" y="{SIDE - 12}" font-size="13" text-anchor="end" fill="#26323e">{label}</text>'


def _cycle(count: int) -> list[str]:
    return [COLOURS[k % len(COLOURS)] for k in range(count)]
