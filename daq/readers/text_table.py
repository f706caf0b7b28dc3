"""Numbers in text: separator, decimal mark, headings with units, and the block of numbers itself.

A block of numbers is read strictly: a cell that is no number, or a row of another width, is an error
with its line, never a value.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from daq.errors import CorruptFileError
from daq.readers.text_file import TextFile

SEPARATORS = ("\t", ";", ",")
"""Separators in the order in which they are tried: a comma may also be a decimal mark."""

LOST_WORDS = ("nan", "-nan", "inf", "+inf", "-inf")
"""Words, in any case, that stand for a sample that is no number."""

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
_NUMERIC_BYTES = b"0123456789+-.,;\teE \nNnAaIiFf"


@dataclass(frozen=True)
class Block:
    """Where the numbers of a text file are, and how they are written.

    Attributes
    ----------
    file : TextFile
    body : bytes
        The complete rows, each with its line end.
    first_line : int
        Number of the first row's line in the file, from 1.
    separator : str
    columns : tuple of str
        Names of the columns, for messages.
    decimal_comma : bool
    dropped : str
        Why a last row was left out; empty if none was.
    """

    file: TextFile
    body: bytes
    first_line: int
    separator: str
    columns: tuple[str, ...]
    decimal_comma: bool
    dropped: str

    @cached_property
    def row_count(self) -> int:
        """Number of complete rows."""
        return self.body.count(b"\n")

    def place(self, row: int, column: str) -> str:
        """Return the place of a cell for messages."""
        return f"line {self.first_line + row}, column {column!r}"


def split_cells(line: str, separator: str) -> list[str]:
    """Split one line into stripped cells; quotes around a cell are taken off."""
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    except (csv.Error, StopIteration):
        return [cell.strip().strip('"') for cell in line.split(separator)]


def is_number(cell: str) -> bool:
    """Tell whether a cell is a number, with either decimal mark."""
    return _NUMBER.fullmatch(cell) is not None


def is_lost(cell: str) -> bool:
    """Tell whether a cell stands for a lost sample: empty, or one of `LOST_WORDS`."""
    return not cell or cell.casefold() in LOST_WORDS


def has_decimal_comma(rows: Sequence[Sequence[str]], separator: str) -> bool:
    """Tell whether numbers are written with a decimal comma; never where the comma separates cells."""
    return separator != "," and any("," in cell and is_number(cell) for row in rows for cell in row)


def split_unit(heading: str) -> tuple[str, str]:
    """Split a column's heading into name and unit.

    The unit is the content of the last pair of parentheses or brackets at the end, or what stands
    behind a last comma and a space; ``()`` and ``(-)`` state none. Names may hold parentheses.

    Returns
    -------
    tuple of str
        Name and unit; the unit is empty if none is stated.
    """
    text = heading.strip()
    for opening, closing in ("()", "[]"):
        if text.endswith(closing):
            depth = 0
            for i in range(len(text) - 1, -1, -1):
                depth += (text[i] == closing) - (text[i] == opening)
                if depth == 0:
                    unit = text[i + 1 : -1].strip()
                    return text[:i].strip(), "" if unit == "-" else unit
    name, comma, unit = text.rpartition(", ")
    if comma and name and re.fullmatch(r"[^\W\d_]{1,4}(/[^\W\d_]{1,2}\d?)?|%|°", unit):
        return name.strip(), unit
    return text, ""


def unique_names(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Tell equal names apart by ``#2``, ``#3`` ... and say so.

    Returns
    -------
    tuple of tuple of str
        The names, and a note per name that was repeated.
    """
    seen: dict[str, int] = {}
    taken = set(names)
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        candidate, n = name, seen[name]
        while n > 1 and (candidate := f"{name}#{n}") in taken:
            n += 1
        taken.add(candidate)
        unique.append(candidate)
    notes = tuple(
        f"{count} signals are named {n!r}: the later ones read {n}#2 ..." for n, count in seen.items() if count > 1
    )
    return tuple(unique), notes


def find_block(file: TextFile, start: int, separator: str, columns: Sequence[str], *, decimal_comma: bool) -> Block:
    """Delimit the rows of numbers that begin at a byte of a text file.

    A last row that may be cut is left out: one without a line end, whose last number cannot be
    trusted, or one with too few cells.

    Raises
    ------
    CorruptFileError
        If there is no complete row.
    """
    first_line = file.data.count(b"\n", 0, start) + 1
    end = file.data.rfind(b"\n") + 1
    dropped = ""
    if file.data[end:].strip():
        dropped = "the last row has no line end and may be cut: it was left out"
    stop = end
    while stop > start and file.data[stop - 1 : stop] in (b" ", b"\n"):
        stop -= 1
    body = file.data[start:stop] + b"\n" if file.data[stop : stop + 1] != b"\n" else file.data[start : stop + 1]
    tail = body[body.rfind(b"\n", 0, -1) + 1 :]
    if body.strip() and tail.count(separator.encode()) < len(columns) - 1:
        body = body[: len(body) - len(tail)]
        dropped = f"the last row has fewer than {len(columns)} cells: it was left out"
    if not body.strip():
        raise CorruptFileError(
            "there is no complete row of numbers", path=file.path, place=f"line {first_line}", remedy="export it again"
        )
    return Block(file, body, first_line, separator, tuple(columns), decimal_comma, dropped)


def read_block(block: Block, *, text_first_column: bool = False) -> tuple[NDArray[np.float64], list[str]]:
    """Read the numbers of a block.

    Parameters
    ----------
    block : Block
    text_first_column : bool
        Whether the first column is text, which is returned apart; its column of numbers is NaN.

    Returns
    -------
    values : ndarray of float64, shape (n_rows, n_columns)
        NaN where a cell is empty or says that there is no number.
    texts : list of str
        The first column's cells; empty unless it is text.

    Raises
    ------
    CorruptFileError
        If a row has another width or a cell is no number, with line and column.
    """
    width, has_empty = _check_widths(block)
    separator = block.separator.encode()
    texts: list[str] = []
    body = block.body
    if text_first_column:
        rows = [row.partition(separator) for row in body.split(b"\n")[:-1]]
        texts = [first.decode(block.file.encoding, errors="replace").strip() for first, _, _ in rows]
        body = b"".join(rest + b"\n" for _, _, rest in rows)
    if block.decimal_comma:
        body = body.replace(b",", b".")
    if body.translate(None, _NUMERIC_BYTES):
        raise _bad_cell(block, first=int(text_first_column))
    try:
        if has_empty or b" " in body:
            body = _fill_empty_cells(body, separator)
        values = np.loadtxt(io.BytesIO(body), delimiter=block.separator, comments=None, ndmin=2)
    except (ValueError, OverflowError) as error:
        raise _bad_cell(block, first=int(text_first_column)) from error
    if values.shape != (block.row_count, width - text_first_column):
        raise CorruptFileError("rows cannot be told apart", path=block.file.path, found=f"{values.shape} cells")
    if text_first_column:
        values = np.insert(values, 0, np.nan, axis=1)
    values[~np.isfinite(values)] = np.nan
    if width > len(block.columns) and not np.isnan(values[:, -1]).all():
        row = int(np.flatnonzero(~np.isnan(values[:, -1]))[0])
        raise _wrong_width(block, row, width)
    return values[:, : len(block.columns)], texts


def _fill_empty_cells(body: bytes, separator: bytes) -> bytes:
    """Write NaN into empty cells."""
    mark = re.escape(separator)
    return re.sub(rb"(?:\A|(?<=\n)|(?<=" + mark + rb")) *(?=\n|" + mark + rb")", b"nan", body)


def _check_widths(block: Block) -> tuple[int, bool]:
    """Return the number of cells per row, and whether a cell is empty.

    A row may have one cell more than there are columns: a separator at its end.
    """
    data = np.frombuffer(block.body, dtype=np.uint8)
    marks = np.flatnonzero((data == ord("\n")) | (data == ord(block.separator)))
    ends = np.flatnonzero(data[marks] == ord("\n"))
    widths = np.diff(ends, prepend=-1)
    allowed = len(block.columns) + (1 if widths[0] == len(block.columns) + 1 else 0)
    wrong = np.flatnonzero(widths != allowed)
    if wrong.size:
        raise _wrong_width(block, int(wrong[0]), int(widths[wrong[0]]))
    return allowed, bool(marks[0] == 0 or (np.diff(marks) == 1).any())


def _wrong_width(block: Block, row: int, width: int) -> CorruptFileError:
    comma = block.separator == "," and width > len(block.columns)
    return CorruptFileError(
        "a row does not fit the header",
        path=block.file.path,
        place=f"line {block.first_line + row}",
        expected=f"{len(block.columns)} cells",
        found=f"{width}",
        remedy="export with a decimal point or with ; between cells" if comma else "export it again",
    )


def _bad_cell(block: Block, first: int) -> CorruptFileError:
    """Find the first cell that is no number."""
    for i, line in enumerate(block.body.decode(block.file.encoding, errors="replace").split("\n")):
        for column, cell in zip(block.columns[first:], line.split(block.separator)[first:], strict=False):
            text = cell.strip()
            wrong_mark = "," in text and not block.decimal_comma
            if not is_lost(text) and (not is_number(text) or wrong_mark):
                return CorruptFileError(
                    "a cell is not a number",
                    path=block.file.path,
                    place=f"line {block.first_line + i}, column {column!r}",
                    expected="a number or an empty cell",
                    found=repr(text[:40]),
                )
    return CorruptFileError("the rows are not numbers", path=block.file.path, place=f"line {block.first_line}")


def printed_decimals(block: Block, column: int) -> int:
    """Return the place of a column's last printed digit: 6 for ``0.000020``, 9 for ``1.5E-008``.

    Cells whose trailing zeros were left out say too little, so the finest of some cells counts; a
    fixed number of digits says less at the end of the file, so its beginning and end are compared.
    """
    separator = block.separator.encode()
    ends = (block.body[:8192].split(b"\n")[:50], block.body[-8192:].split(b"\n")[-50:-1])
    return min(
        max(
            (_decimals(row.split(separator)[column].decode("ascii", errors="replace")) for row in rows if row),
            default=0,
        )
        for rows in ends
    )


def _decimals(cell: str) -> int:
    mantissa, _, exponent = cell.strip().casefold().replace(",", ".").partition("e")
    try:
        return len(mantissa.partition(".")[2]) - (int(exponent) if exponent else 0)
    except ValueError:
        return 0
