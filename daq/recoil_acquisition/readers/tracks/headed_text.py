"""A text of tracks under header rows of known number: its separator, its decimal mark, and its numbers.

The text is read in parts: beside its numbers, of which there is one copy, no more of it is held than a part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.readers.text.cells import SEPARATORS, has_decimal_comma, split_cells
from recoil_acquisition.readers.text.text_table import TextBlock, find_block
from recoil_acquisition.readers.text_file import LongText
from recoil_acquisition.readers.tracks.columns import LOST_MARKERS

HEAD_ROWS = 6
"""Rows by which header and decimal mark are found."""

Cells = Sequence[str]


@dataclass(frozen=True, eq=False)
class HeadedText:
    """A text whose first rows head its columns.

    Attributes
    ----------
    rows
        Cells of the first rows, those of the header and some of the numbers.
    """

    file: LongText
    separator: str
    rows: tuple[Cells, ...]

    def block(self, labels: Sequence[str], *, header_rows: int = 1, text_columns: int = 0) -> TextBlock:
        """Delimit the rows of numbers below the header.

        Parameters
        ----------
        labels
            Names of the columns, for messages.
        text_columns
            First columns that hold no numbers, and so say nothing about the decimal mark.

        Raises
        ------
        CorruptFileError
            If there is no complete row.
        """
        comma = has_decimal_comma([row[text_columns:] for row in self.rows[header_rows:]])
        start = self.file.line_start(header_rows)
        return find_block(self.file, start, self.separator, labels, decimal_comma=comma, markers=LOST_MARKERS)


def read_headed_text(path: Path, is_header: Callable[[Cells], bool]) -> HeadedText:
    """Read the first rows of a text, parted by the separator with which the first of them is a header.

    Raises
    ------
    ReadError
        If the file cannot be read.
    CorruptFileError
        If it announces UTF-16 and is not.
    """
    file = LongText(path)
    lines = file.lines(HEAD_ROWS)
    separator = next((s for s in SEPARATORS if is_header(split_cells(lines[0], s))), ",")
    return HeadedText(file, separator, tuple(split_cells(line, separator) for line in lines))
