"""A value of many parts that lists them: in a terminal, in a script, in a notebook."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from dataclasses import dataclass

from recoil_acquisition.errors import visible


@dataclass(frozen=True)
class Listing:
    """A heading, and a row for each part.

    Attributes
    ----------
    columns
        Names of the columns.
    rows
        Rows of as many cells as there are columns; a number among them stands at the right of its column.
    """

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | int | float | None, ...], ...]

    def __str__(self) -> str:
        numeric = [any(isinstance(row[i], int | float) for row in self.rows) for i in range(len(self.columns))]
        cells = [self.columns, *([_cell(value) for value in row] for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = [
            "  ".join(
                cell.rjust(width) if right else cell.ljust(width)
                for cell, width, right in zip(row, widths, numeric, strict=True)
            ).rstrip()
            for row in cells
        ]
        return "\n".join([visible(self.heading), *(f"  {line}" for line in lines)])


class Listed(ABC):
    """``str`` is a heading and the parts in aligned columns, and a notebook shows the same."""

    @abstractmethod
    def listing(self) -> Listing:
        """Return what is listed."""

    def __str__(self) -> str:
        return str(self.listing())

    def _repr_html_(self) -> str:
        return f'<pre style="white-space:pre;overflow-x:auto;line-height:normal">{html.escape(str(self))}</pre>'


def _cell(value: str | float | None) -> str:
    if value is None:
        return "-"
    return visible(value) if isinstance(value, str) else f"{value:,}" if isinstance(value, int) else f"{value:,.6g}"
