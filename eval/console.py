"""Tables for terminals of any width, and for pipes: what does not fit beside goes below, and nothing is cut off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich import box
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

SHORTEST_NAME = 12  # of a policy, before it is folded


class FittedTable(Table):
    """A table, the first column left, figures right, a note below; columns that have no room begin another table below.

    Args:
        header, rows: cells of equal number; a long first cell is folded. note: some sentences.
    """

    def __init__(self, header: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> None:
        super().__init__()
        self._cells = [[Text(_stacked(cell)) for cell in row] for row in (header, *rows)]  # Text: "[red]" is a name, no markup
        for row, (name, *_) in zip(self._cells, (header, *rows), strict=True):
            row[0] = Text(name, overflow="fold")
        self._note = note

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for chosen in self._fit(options.max_width):
            yield self._part(chosen)
        if self._note:
            yield Text(self._note, style="italic", overflow="fold")

    def _widths(self) -> list[int]:
        """Of each column, the space before it included."""
        return [1 + max(_width(row[column]) for row in self._cells) for column in range(len(self._cells[0]))]

    def _fit(self, width: int) -> Iterator[list[int]]:
        """Which columns stand beside the first one in each of the tables that are no wider than ``width``."""
        names, *others = self._widths()
        widest = max(others, default=0)
        fewest = min(names, SHORTEST_NAME)
        room = width - (fewest if fewest + sum(others) > width - names else names) - 1
        chosen: list[int] = []
        for column, needed in enumerate(others, start=1):
            if chosen and sum(others[place - 1] for place in chosen) + needed > max(room, widest):
                yield chosen
                chosen = []
            chosen.append(column)
        yield chosen

    def _part(self, chosen: Sequence[int]) -> Table:
        table = Table(box=box.SIMPLE_HEAD, padding=0)
        header, *rows = self._cells
        table.add_column(header[0], overflow="fold", min_width=min(self._widths()[0] - 1, SHORTEST_NAME))
        for column in chosen:
            table.add_column(header[column], justify="right", overflow="fold")
        for row in rows:
            table.add_row(row[0], *(row[column] for column in chosen))
        return table


def _width(text: Text) -> int:
    return max((line.cell_len for line in text.split("\n", allow_blank=True)), default=0)


def _stacked(text: str) -> str:
    """An interval below its figure and a title over several lines: nine columns have to fit a terminal of 80."""
    for mark in (" [", " range", " error", " perimeter", " policy", " near", " tag", " if", " lost", " in ["):
        text = text.replace(mark, "\n" + mark.strip())
    return text
