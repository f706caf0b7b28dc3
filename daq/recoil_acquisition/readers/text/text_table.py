"""The block of numbers of a text table, read strictly and in pieces.

A cell that is no number, or a row of another width, is an error with its line, never a value. Numbers
are what `float` makes of their text, to the last bit: pandas' parser does that since 3.1 and by
``round_trip`` before, and what it will not read is read again cell by cell, which finds the place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.text.cells import (
    BLANKS,
    decimals,
    groups_thousands,
    is_lost,
    is_number,
    split_cells,
)
from recoil_acquisition.readers.text.row_format import RowFormat, count_rows, is_comment, parted_once
from recoil_acquisition.readers.text.row_parser import count_byte
from recoil_acquisition.readers.text_file import LOOKED_AT, PART_BYTES, Text, one_line_end

PIECE_BYTES = 3 << 20
"""Text that is parsed at once; no row is longer."""

THREADS = 2
"""Pieces that are gone through at a time."""

MOST_EMPTY = 64
"""Empty cells behind the columns, which a spreadsheet saves with every row, up to which they are passed over."""


@dataclass(frozen=True)
class RowRange:
    """Some rows of a block.

    Attributes
    ----------
    start, stop
        Bytes of the file.
    line
        Number of the first row's line, from 1.
    """

    start: int
    stop: int
    line: int
    rows: int


@dataclass(frozen=True)
class TextBlock:
    """Place and format of the numbers of a text file.

    Attributes
    ----------
    start, stop
        Bytes of the complete rows; ``stop`` lies before the last row's line end.
    first_line
        Number of the first row's line in the file, from 1.
    format
        Format of the rows.
    dropped
        Reason why a last row was left out, or sign that the file was cut; empty if neither is so.
    text_columns
        Columns of which no cell is a number, with one of their cells, as far as the first and the last rows show.
    markers
        Numbers that commonly stand for a lost sample in such a table.
    """

    file: Text
    start: int
    stop: int
    first_line: int
    format: RowFormat
    dropped: str
    text_columns: Mapping[int, str] = field(default_factory=dict)
    markers: frozenset[float] = frozenset()

    @property
    def row_count(self) -> int:
        """Number of complete rows."""
        return sum(piece.rows for piece in self.pieces)

    def some_cells(self) -> list[list[str]]:
        """Return the cells of some of the first and of the last rows."""
        written = self.format
        return [
            split_cells(line.strip(b"\r").decode(written.encoding, errors="replace"), written.separator)
            for line in (line for lines in _some_lines(self) for line in lines)
            if not (written.comment and is_comment(line, written.comment))
        ]

    def place(self, row: int, column: str) -> str:
        """Return the place of a cell for messages."""
        return f"line {self.first_line + row}, column {column!r}"

    @cached_property
    def pieces(self) -> tuple[RowRange, ...]:
        """Parts of the rows that are parsed at once, in the file's order.

        Raises
        ------
        CorruptFileError
            If a line is longer than a table's rows are.
        """
        windows = range(self.start, self.stop, PIECE_BYTES)
        if len(windows) > THREADS:
            with ThreadPoolExecutor(THREADS) as pool:
                found = list(pool.map(self._line_ends, windows))
        else:
            found = [self._line_ends(at) for at in windows]
        at, line, pieces = self.start, self.first_line, []
        if found:
            found[-1] = (found[-1][0] + 1, self.stop)  # the last row's line end lies behind the block
        for lines, stop in found:
            if not lines:
                raise CorruptFileError(
                    f"a line is longer than {PIECE_BYTES} bytes", path=self.file.path, place=f"line {line}",
                    expected="a row of numbers", remedy="export it again",
                )  # fmt: skip
            piece = RowRange(at, stop, line, lines)
            if self.format.comment:
                piece = RowRange(at, stop, line, count_rows(self.text(piece), self.format.comment))
            pieces.append(piece)
            at, line = stop, line + lines
        return tuple(pieces)

    def _line_ends(self, start: int) -> tuple[int, int]:
        """Count the line ends in as much as is parsed at once; return also where the last of them ends."""
        count, last, at = 0, start, start
        for part in self.file.parts(start, min(start + PIECE_BYTES, self.stop)):
            count += count_byte(part, self.file.line_end)
            last = max(last, at + part.rfind(self.file.line_end) + 1) if self.file.line_end in part else last
            at += len(part)
        return count, last

    def text(self, piece: RowRange) -> bytes:
        r"""Read a piece: its last row ended, ``\r`` as ``\n`` where that alone ends lines, one blank between cells."""
        raw = self.file.read(piece.start, piece.stop)
        if not raw.endswith(self.file.line_end):
            raw += self.file.line_end
        text = raw if self.file.line_end == b"\n" else one_line_end(raw)
        return parted_once(text) if self.format.separator == BLANKS else text


def find_block(
    file: Text,
    start: int,
    separator: str,
    columns: Sequence[str],
    *,
    decimal_comma: bool,
    missing: Sequence[str] = (),
    comment: str = "",
    thousands: str | None = None,
    markers: frozenset[float] = frozenset(),
) -> TextBlock:
    """Delimit the rows of numbers that begin at a byte of a text file.

    A last row that may be cut is left out: one without a line end, whose last number cannot be
    trusted, or one with too few cells.

    Raises
    ------
    CorruptFileError
        If there is no complete row, or the last lines end otherwise than the first.
    """
    first_line = file.read(0, start).count(file.line_end) + 1
    base = max(start, file.size - PIECE_BYTES)
    tail = file.read(base, file.size)
    end = tail.rfind(file.line_end) + 1
    dropped = [file.cut] if file.cut else []
    if b"\r" in tail[end:].strip():
        raise two_line_ends(file, base + end)
    if tail[end:].strip():
        dropped.append("the last row has no line end and may be cut: it was left out")
    rows = tail[:end].rstrip(b" \r\n")
    last = rows[rows.rfind(file.line_end) + 1 :]
    if rows and _width(last, separator) < len(columns) and not (comment and is_comment(last, comment)):
        rows = rows[: len(rows) - len(last)].rstrip(b" \r\n")
        dropped.append(f"the last row has fewer than {len(columns)} cells: it was left out")
    if not rows.strip():
        raise CorruptFileError(
            "there is no complete row of numbers", path=file.path, place=f"line {first_line}", remedy="export it again"
        )
    stop = base + len(rows)
    width = len(columns) + _empty_behind(_first_row(file, start, stop, comment), separator, len(columns))
    rows_as_written = RowFormat(
        file.path, file.encoding, separator, tuple(columns), width, decimal_comma, tuple(missing), comment, thousands,
        _line_above(file, start),
    )  # fmt: skip
    block = TextBlock(file, start, stop, first_line, rows_as_written, "; ".join(dropped), markers=markers)
    return replace(block, text_columns=_text_columns(block))


def two_line_ends(file: Text, at: int) -> CorruptFileError:
    """Return the error of a text whose lines behind a byte end otherwise than those before it."""
    return CorruptFileError(
        "lines end in two ways", path=file.path, place=f"byte {at}", expected="the same sign behind all of them",
        remedy="export it again",
    )  # fmt: skip


def _line_above(file: Text, start: int) -> bytes:
    """Return the line that ends where a byte begins; empty if it holds no letter, as a row of numbers does not."""
    line = file.read(max(start - PART_BYTES, 0), start).strip(b"\r\n").rpartition(file.line_end)[2].strip()
    return line if any(chr(byte).isalpha() for byte in line) else b""


def _width(row: bytes, separator: str) -> int:
    """Return the number of cells of a row."""
    if b'"' not in row and separator != BLANKS:
        return row.count(separator.encode()) + 1
    return len(split_cells(row.decode("utf-8", errors="replace"), separator))


def _empty_behind(row: bytes, separator: str, columns: int) -> int:
    """Return how many cells follow those of the columns: one that a separator ends, or those of a spreadsheet."""
    if _width(row, separator) <= columns:
        return 0
    behind = split_cells(row.decode("utf-8", errors="replace"), separator)[columns:]
    return len(behind) if len(behind) <= MOST_EMPTY and not any(cell.strip() for cell in behind) else 0


def _text_columns(block: TextBlock) -> dict[int, str]:
    """Find the columns that hold text and no number in the first and the last rows."""
    written = block.format
    rows = [row for row in block.some_cells() if len(row) == written.width]
    found = {}
    for i in range(len(written.columns)):
        cells = [row[i] for row in rows if row[i] not in written.missing]
        texts = [cell for cell in cells if not is_lost(cell)]
        if texts and not any(is_number(cell) or groups_thousands(cell) for cell in texts):
            found[i] = texts[0]
    return found


def _some_lines(block: TextBlock) -> tuple[list[bytes], list[bytes]]:
    """Return some whole lines from the beginning of a block, and from its end where it is long."""
    head = one_line_end(block.file.read(block.start, min(block.start + 8192, block.stop)) + b"\n")
    tail = one_line_end(block.file.read(max(block.start, block.stop - 8192), block.stop))
    ends = (head.split(b"\n")[:LOOKED_AT], tail.split(b"\n")[1 - LOOKED_AT :])
    if len(ends[0]) > 2 and block.stop - block.start > 8192:
        ends = (ends[0][:-2] or ends[0], ends[1][1:] or ends[1])
    return ends


def _first_row(file: Text, start: int, stop: int, comment: str) -> bytes:
    """Return the first line that is no comment; of one that is longer than a row can be, its beginning."""
    at, row = start, b""
    while at < stop:
        *lines, rest = file.read(at, at + PIECE_BYTES).split(file.line_end)
        for row in lines or [rest]:
            if not (comment and is_comment(row, comment)):
                return row
            at += len(row) + 1
    return row


def printed_decimals(block: TextBlock, column: int) -> int:
    """Return the place of a column's last printed digit: 6 for ``0.000020``, 9 for ``1.5E-008``.

    Cells whose trailing zeros were left out say too little, so the finest of some cells counts; a
    fixed number of digits says less at the end of the file, so its beginning and end are compared.
    """
    separator = block.format.separator
    return min(
        max(
            (
                decimals(cells[column])
                for cells in (split_cells(row.decode("ascii", errors="replace"), separator) for row in rows)
                if len(cells) > column
            ),
            default=0,
        )
        for rows in _some_lines(block)
    )
