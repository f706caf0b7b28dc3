"""Marks that may set thousands apart where they are taken for decimal marks: 998, 999, 1.000.

Three digits behind the only mark of a cell are either. What tells is the rest of its column: where whole numbers below
a thousand stand without a mark, and each number with one has three digits behind it and one to three before it, a
program has set the thousands apart. A program that prints decimals prints them in every cell, or leaves zeros at the
end out, and then some cell has one digit or two. A column in which every cell has three decimals is taken as it is.
"""

from __future__ import annotations

import re
import threading
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.overload import LEAST
from recoil_acquisition.readers.text.cells import split_cells
from recoil_acquisition.readers.text.row_format import RowFormat, count_rows, is_comment

_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
PART_BYTES = 1 << 17
"""Text of which the cells are found at a time."""
_KEPT = 3
"""Different numbers without a mark that are remembered."""
_FIRST_LOOK = 64
"""Numbers of a column that are looked at first: of most columns one of them already tells."""
_NEAR = 2.0
"""Times that a lone number without a mark may lie below the thousands to count as one of theirs: farther off it is a
marker of lost samples."""

Numbers = NDArray[np.float64]


@dataclass
class _Evidence:
    """Evidence of one column.

    Attributes
    ----------
    whole
        Numbers without a mark, some different ones.
    least
        Smallest number that may be thousands, as it was read; infinite if there is none.
    line, cell
        Line and cell of the first such number.
    """

    decimal: bool = False
    whole: set[float] = field(default_factory=set)
    least: float = np.inf
    line: int = 0
    cell: str = ""


class Grouping:
    """Search for marks between thousands in the rows of one table, a piece at a time, in any order.

    Parameters
    ----------
    markers
        Numbers that commonly stand for a lost sample, and so say nothing of how others are written.
    """

    def __init__(self, rows: RowFormat, markers: frozenset[float] = frozenset()) -> None:
        self._rows, self._markers = rows, markers
        self._mark = "," if rows.decimal_comma else "."
        self._columns = [_Evidence(decimal=rows.thousands is not None) for _ in rows.columns]
        self._lock = threading.Lock()

    def look(self, values: Numbers, text: bytes, line: int) -> None:
        r"""Look at some rows.

        Parameters
        ----------
        values : ndarray of float64, shape (n_rows, n_columns)
            Numbers as they were read.
        text
            The rows, each ended by ``\n``.
        line
            Number of the first one's line.
        """
        doubtful = [i for i, found in enumerate(self._columns) if not found.decimal]
        some = [i for i in doubtful if _may_be_thousands(values[:_FIRST_LOOK, i])]
        self._are_decimal(set(doubtful) - set(some))
        rest = [i for i in some if _may_be_thousands(values[_FIRST_LOOK:, i])]
        self._are_decimal(set(some) - set(rest))
        rest = [i for i in rest if _present(values[:, i]).any()]
        if not rest:
            return
        rows = text
        if self._mark.encode() not in rows:
            for i in rest:
                self._weigh(i, values[:, i], None, line)
            return
        at = start = 0
        while start < len(rows):
            stop = rows.find(b"\n", start + PART_BYTES) + 1 or len(rows)
            part = rows[start:stop]
            count = count_rows(part, self._rows.comment) if self._rows.comment else part.count(b"\n")
            cells = _Cells(part, self._rows, count)
            for i in rest:
                self._weigh(i, values[at : at + count, i], cells, line + at)
            start, at = stop, at + count

    def _are_decimal(self, columns: set[int]) -> None:
        for i in columns:
            self._columns[i].decimal = True

    def _weigh(self, column: int, numbers: Numbers, cells: _Cells | None, line: int) -> None:
        found = self._columns[column]
        if found.decimal:
            return
        present = _present(numbers)
        has_mark = np.zeros(numbers.size, dtype=bool)
        if cells is not None:
            has_mark, all_grouped = cells.marked(column, self._mark, present)
            if not all_grouped:
                found.decimal = True
                return
        whole = set(np.unique(numbers[~has_mark & present]).tolist()) - self._markers
        with self._lock:
            found.whole = set(sorted(found.whole | whole, key=abs)[-_KEPT:])
            if cells is None or not has_mark.any():
                return
            row = int(np.flatnonzero(has_mark)[0])
            thousands = numbers[has_mark]
            found.least = min(found.least, float(thousands[np.argmin(np.abs(thousands))]), key=abs)
            if not found.line or line + row < found.line:
                found.line, found.cell = line + row, cells.cell(row, column)

    def check(self) -> None:
        """Refuse a table of which a number may be read in two ways.

        Raises
        ------
        ReadError
            With line and column.
        """
        for name, found in zip(self._rows.columns, self._columns, strict=True):
            if found.decimal or not found.line or not found.whole:
                continue
            nearest = max(found.whole, key=lambda number: number * np.sign(found.least))
            alone = len(found.whole) == 1 and nearest != 0
            if alone and nearest * np.sign(found.least) * _NEAR < 1000 * abs(found.least):
                continue
            raise ReadError(
                "the mark in a number is a decimal mark, or sets thousands apart",
                path=self._rows.path,
                place=f"line {found.line}, column {name!r}",
                expected="decimals in all numbers of a column, or in none",
                found=f"{found.cell!r} beside {nearest:g}",
                remedy="export numbers without marks between thousands; or declare `[source.layout]` in the rig with"
                f' `thousands = "{self._mark}"`, or `thousands = ""` where it is the decimal mark',
            )


def _may_be_thousands(numbers: Numbers) -> bool:
    """Return whether numbers are 0, or have a size from 1 to below 1000 and three decimals at most."""
    present = numbers[_present(numbers)]
    size = np.abs(present)
    if not ((size < 1000) & ((size >= 1) | (size == 0))).all():
        return False
    return bool((np.round(present * 1000) / 1000 == present).all())


def _present(numbers: Numbers) -> NDArray[np.bool_]:
    """Return which numbers were measured."""
    with np.errstate(invalid="ignore"):
        return np.abs(numbers) < LEAST


class _Cells:
    """The cells of some rows, found without taking them apart where no quote is in the way."""

    def __init__(self, text: bytes, rows: RowFormat, count: int) -> None:
        self._text, self._rows = text, rows
        codes = np.frombuffer(text, np.uint8)
        ends = np.flatnonzero((codes == ord(rows.separator)) | (codes == ord("\n")))
        self._codes = codes
        self._split: list[list[str]] = []
        if ends.size == count * rows.width and b'"' not in text:
            self._ends = ends.reshape(count, rows.width)
            self._starts = np.r_[0, ends[:-1] + 1].reshape(count, rows.width)
        else:
            self._split = [
                split_cells(line.decode(rows.encoding, errors="replace"), rows.separator)
                for line in text.split(b"\n")[:-1]
                if not (rows.comment and is_comment(line, rows.comment))
            ]

    def cell(self, row: int, column: int) -> str:
        """Return one cell."""
        if self._split:
            return self._split[row][column]
        part = self._text[int(self._starts[row, column]) : int(self._ends[row, column])]
        return part.decode(self._rows.encoding, errors="replace").strip()

    def marked(self, column: int, mark: str, present: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], bool]:
        """Return which numbers of a column have a mark, and whether each of those may have it between thousands."""
        if self._split:
            cells = [row[column] for row in self._split]
            has_mark = np.array([mark in cell for cell in cells]) & present
            return has_mark, all(_GROUPED.fullmatch(cell) for cell, its in zip(cells, has_mark, strict=True) if its)
        starts, ends = self._starts[:, column], self._ends[:, column]
        places = np.flatnonzero(self._codes == ord(mark))
        first = np.searchsorted(places, starts)
        has_mark = (np.searchsorted(places, ends) > first) & present
        starts, ends, place = starts[has_mark].copy(), ends[has_mark].copy(), places[first[has_mark]]
        for blank in (b" ", b"\r", b" "):
            ends -= self._codes[ends - 1] == ord(blank)
        leading = self._codes[starts]
        while (skipped := np.isin(leading, np.frombuffer(b" +-", np.uint8))).any():
            starts += skipped
            leading = self._codes[starts]
        before = place - starts
        grouped = (ends - place == 4) & (before >= 1) & (before <= 3) & (leading != ord("0"))
        return has_mark, bool(grouped.all())
