"""The numbers of a block, read part by part into one array."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.overload import LEAST, find_marks
from recoil_acquisition.readers.text.row_parser import RowParser
from recoil_acquisition.readers.text.text_table import TextBlock
from recoil_acquisition.readers.text.thousands import Grouping


def take_marks_out(values: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Put NaN where a number marks a lost sample, in place.

    Parameters
    ----------
    values : ndarray of float64, shape (n_rows, n_columns)

    Returns
    -------
    lost, overloads : ndarray of int64, shape (n_columns,)
        Numbers of each column that are lost, and those of them that are marks of an overload, counted.
    """
    lost = np.zeros(values.shape[1], dtype=np.int64)
    overloads = np.zeros_like(lost)
    with np.errstate(all="ignore"):
        # squares cannot cancel each other as marks of both signs do
        squares = np.einsum("ij,ij->j", values, values)
        doubtful = np.flatnonzero(~(squares < LEAST**2))
    for i in doubtful:
        marks = find_marks(values[:, i]) | np.isinf(values[:, i])
        if marks.any():
            values[marks, i] = np.nan
            overloads[i] = np.count_nonzero(marks)
        lost[i] = np.count_nonzero(np.isnan(values[:, i]))
    return lost, overloads


def read_rows(block: TextBlock, *, marked: bool = True) -> NDArray[np.float64]:
    """Read all numbers of a block.

    Parameters
    ----------
    marked
        Whether infinities and other marks of instruments are lost samples.

    Returns
    -------
    ndarray of float64, shape (n_rows, n_columns)
        Numbers of the block; NaN where a cell is empty or says that there is no number.

    Raises
    ------
    CorruptFileError
        If a row has another width or a cell is no number, with line and column.
    """
    values = np.empty((block.row_count, len(block.format.columns)))
    for rows, numbers, _ in iter_rows(block, marked=marked):
        values[rows] = numbers
    return values


def iter_rows(
    block: TextBlock, *, named: bool = False, marked: bool = True
) -> Iterator[tuple[slice, NDArray[np.float64], list[str]]]:
    """Read the numbers of a block part by part.

    Parameters
    ----------
    named
        Whether the first column is text; its numbers are NaN.
    marked
        Whether infinities and other marks of instruments are lost samples.

    Yields
    ------
    rows : slice
        Rows of the block.
    numbers : ndarray of float64, shape (rows of the part, n_columns)
    names : list of str
        Cells of the first column; empty unless it is text.

    Raises
    ------
    CorruptFileError
        If a row has another width or a cell is no number, with line and column.
    """
    at = 0
    grouping = Grouping(block.format, block.markers)
    others = [i for i in block.text_columns if not (named and i == 0)]
    parser = RowParser(block.format, ((0,) if named else ()) + tuple(others), grouping)
    for piece in block.pieces:
        numbers, texts = parser.parse(block.text(piece), piece.line, piece.rows)
        if len(numbers) != piece.rows:
            raise CorruptFileError(
                "rows cannot be separated", path=block.file.path, place=f"line {piece.line}",
                expected=f"{piece.rows} rows", found=f"{len(numbers)}",
            )  # fmt: skip
        if marked:
            take_marks_out(numbers)
        yield slice(at, at + len(numbers)), numbers, texts[0] if named else []
        at += len(numbers)
    grouping.check()
