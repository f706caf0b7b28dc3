"""Lines and tables of the armed screen: columns that go where it is narrow, text that breaks between words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from recoil_acquisition.errors import visible

if TYPE_CHECKING:
    from rich.text import Text

NAME_WIDTH = 24
"""Most cells of the name of a source or a channel."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    leaves
        Rank in which the column goes where the screen is narrow, the largest first; 0 never goes.
    right
        Whether its cells are aligned to the right.
    most, least
        Largest and smallest width of the column, cells of the terminal. A column as wide as its cells get keeps its
        place from picture to picture.
    """

    title: str
    leaves: int = 0
    right: bool = False
    most: int = 1000
    least: int = 0


def table_lines(
    columns: Sequence[Column],
    rows: Sequence[Sequence[Text]],
    last: tuple[str, Sequence[Callable[[int], list[Text]]]],
    width: int,
    *,
    least: int = 0,
) -> list[Text]:
    """Join cells to lines.

    Parameters
    ----------
    rows
        Rows of the table, each with a cell per column.
    last
        Title of the last column, which takes what room the others leave, and for each row the function from that room
        to the lines of its cell.
    width
        Width of the terminal, cells.
    least
        Width that the last column needs, cells.
    """
    title, draw = last
    widths = []
    for i, column in enumerate(columns):
        cells = max((row[i].cell_len for row in rows), default=0)
        widths.append(max(min(cells, column.most), column.least, len(column.title)))
    kept = list(range(len(columns)))
    while (room := width - sum(widths[i] + 2 for i in kept)) < least:
        first = max(kept, key=lambda i: columns[i].leaves)
        if not columns[first].leaves:
            break
        kept.remove(first)

    def joined(cells: Sequence[Text], end: Text) -> Text:
        line = line_of("")
        for i in kept:
            cell = cells[i].copy()
            cell.truncate(widths[i], overflow="ellipsis")
            cell.align("right" if columns[i].right else "left", widths[i])
            line.append_text(cell).append("  ")
        line.append_text(end).rstrip()
        return line

    lines = [joined([line_of(column.title, "bold") for column in columns], line_of(title, "bold"))]
    for row, cell in zip(rows, draw, strict=True):
        first_line, *more = cell(room) or [line_of("")]
        lines.append(joined(row, first_line))
        lines += [joined([line_of("") for _ in columns], end) for end in more]
    return lines


def line_of(text: str, style: str = "") -> Text:
    """Return text that is one line, cut with an ellipsis where it is too long."""
    from rich.text import Text

    return Text(visible(text), style=style, no_wrap=True, overflow="ellipsis")


def wrapped(
    text: str | Text, width: int, *, style: str = "", most: int = 1000, indent: int = 0, fill: bool = False
) -> list[Text]:
    """Break text between its words into lines; what does not fit into the most lines ends in an ellipsis.

    Parameters
    ----------
    indent
        Number of blanks before every line but the first.
    fill
        Whether each line is as wide as the screen, so that its colour is.
    """
    from rich.console import Console

    one = line_of(text, style) if isinstance(text, str) else text
    width = max(width, 1)
    console = Console(width=width, file=None, legacy_windows=False)
    pieces = list(one.wrap(console, max(width - indent, 1), no_wrap=False))
    for piece in pieces:
        piece.rstrip()
    lines = [
        piece if i == 0 or not indent else line_of(" " * indent).append_text(piece) for i, piece in enumerate(pieces)
    ]
    if len(lines) > most:
        del lines[most:]
        lines[-1].append(" …")
        lines[-1].truncate(width, overflow="ellipsis")
    for line in lines:
        line.no_wrap, line.overflow = True, "ellipsis"
        if fill:
            line.align("left", width)
    return lines
