"""The layout of a text table: where its headings and rows are, and what dates the rows, be it found or declared."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from recoil_acquisition.readers.statements import Statements, folded, statements_in
from recoil_acquisition.readers.text.text_table import TextBlock, find_block
from recoil_acquisition.readers.text.time_base import TimeSource
from recoil_acquisition.readers.text_file import LongText


@dataclass(frozen=True, kw_only=True)
class TableLayout:
    """Layout of a text table.

    Attributes
    ----------
    separator
        Sign between two cells.
    first_row
        Index of the line of the first row.
    headings
        Name and unit of every column.
    time
        Source of the time of the rows.
    header_row
        Index of the line of the headings, where the recording keeps it apart.
    labels
        Names of the columns in messages, where they are not those of the headings.
    text_columns
        Columns that hold no numbers; they are left out, as is the column of time.
    applied
        Names in the head, folded, of numbers that the rows have already, or that are of the screen alone.
    decimal_comma, missing, comment, thousands
        Format of the rows, as `recoil_acquisition.readers.text.text_table.find_block` takes it.
    """

    separator: str
    first_row: int
    headings: Sequence[tuple[str, str]]
    time: TimeSource
    header_row: int | None = None
    labels: Sequence[str] = ()
    text_columns: Sequence[int] = ()
    applied: Collection[str] = ()
    decimal_comma: bool = False
    missing: Sequence[str] = ()
    comment: str = ""
    thousands: str | None = None

    def block(self, file: LongText) -> TextBlock:
        """Delimit the rows in a file, as `recoil_acquisition.readers.text.text_table.find_block` does."""
        return find_block(
            file, file.line_start(self.first_row), self.separator, self.labels or [name for name, _ in self.headings],
            decimal_comma=self.decimal_comma, missing=self.missing, comment=self.comment, thousands=self.thousands,
        )  # fmt: skip

    def statements(self, head: Mapping[str, Any]) -> Statements:
        """Return what the lines above the rows say of the numbers in them."""
        said = statements_in([*head.get("preamble", ()), head.get("header", "")])
        return Statements(said, [name for name in said if folded(name) in self.applied])

    def head(self, lines: Sequence[str]) -> Mapping[str, Any]:
        """Return the lines of a file above the rows, as a recording keeps them."""
        if self.header_row is None:
            return {"preamble": list(lines[: self.first_row])}
        return {"preamble": list(lines[: self.header_row]), "header": lines[self.header_row]}
