"""A table on the armed screen: columns that go where it is narrow, and never get narrower while it is shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from recoil_acquisition.errors import visible

if TYPE_CHECKING:
    from rich.text import Text


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    leaves
        Rank in which the column goes where the screen is narrow, the largest first; 0 never goes.
    right
        Whether its cells are aligned to the right.
    most
        Largest width of the column, cells of the terminal.
    """

    title: str
    leaves: int = 0
    right: bool = False
    most: int = 1000


class ScreenTable:
    """A table whose columns keep their place from picture to picture.

    Parameters
    ----------
    last
        Title of the last column, which takes what room the others leave.
    """

    def __init__(self, columns: Sequence[Column], last: str) -> None:
        self._columns = tuple(columns)
        self._last = last
        self._widths = [len(column.title) for column in columns]

    def forget(self) -> None:
        """Let the columns get narrower again: the terminal has another width."""
        self._widths = [len(column.title) for column in self._columns]

    def lines(
        self, rows: Sequence[Sequence[Text]], width: int, least: int, draw: Callable[[int, int], list[Text]]
    ) -> list[Text]:
        """Join cells to lines.

        Parameters
        ----------
        rows
            Rows of the table, each with a cell per column.
        width
            Width of the terminal, cells.
        least
            Width that the last column needs, cells.
        draw
            Function from a row's number and the room of the last column to the lines of that cell.
        """
        for i, column in enumerate(self._columns):
            cells = max((row[i].cell_len for row in rows), default=0)
            self._widths[i] = max(min(cells, column.most), self._widths[i])
        kept = list(range(len(self._columns)))
        while (room := width - sum(self._widths[i] + 2 for i in kept)) < least:
            first = max(kept, key=lambda i: self._columns[i].leaves)
            if not self._columns[first].leaves:
                break
            kept.remove(first)

        def joined(cells: Sequence[Text], end: Text) -> Text:
            line = line_of("")
            for i in kept:
                cells[i].align("right" if self._columns[i].right else "left", self._widths[i])
                line.append_text(cells[i]).append("  ")
            line.append_text(end).rstrip()
            return line

        titles = [line_of(column.title, "bold") for column in self._columns]
        lines = [joined(titles, line_of(self._last, "bold"))]
        for i, row in enumerate(rows):
            first_line, *more = draw(i, room)
            lines.append(joined(row, first_line))
            lines += [joined([line_of("") for _ in self._columns], end) for end in more]
        return lines


def line_of(text: str, style: str = "") -> Text:
    """Return text that is one line, cut with an ellipsis where it is too long."""
    from rich.text import Text

    return Text(visible(text), style=style, no_wrap=True, overflow="ellipsis")
