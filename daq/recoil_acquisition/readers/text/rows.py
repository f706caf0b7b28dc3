"""The numbers of a block, read part by part into one array."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from functools import partial

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.text.row_parser import RowParser
from recoil_acquisition.readers.text.text_table import TextBlock


def read_rows(block: TextBlock) -> NDArray[np.float64]:
    """Read all numbers of a block.

    Returns
    -------
    ndarray of float64, shape (n_rows, n_columns)
        NaN where a cell is empty or says that there is no number.

    Raises
    ------
    CorruptFileError
        If a row has another width or a cell is no number, with line and column.
    """
    values = np.empty((block.row_count, len(block.format.columns)))
    for rows, numbers, _ in iter_rows(block):
        values[rows] = numbers
    return values


def iter_rows(block: TextBlock, *, named: bool = False) -> Iterator[tuple[slice, NDArray[np.float64], list[str]]]:
    """Read the numbers of a block part by part.

    Parameters
    ----------
    named
        Whether the first column is text; its numbers are NaN.

    Yields
    ------
    rows : slice
        Rows of the block.
    numbers : ndarray of float64, shape (rows of the part, n_columns)
    names : list of str
        The first column's cells; empty unless it is text.

    Raises
    ------
    CorruptFileError
        If a row has another width or a cell is no number, with line and column.
    """
    at = 0
    with closing(RowParser(block.format, (0,) if named else ())) as parser:
        for piece in block.pieces:
            numbers, texts = parser.parse(partial(block.parts, piece), piece.line, piece.rows)
            if len(numbers) != piece.rows:
                raise CorruptFileError(
                    "rows cannot be separated", path=block.file.path, place=f"line {piece.line}",
                    expected=f"{piece.rows} rows", found=f"{len(numbers)}",
                )  # fmt: skip
            yield slice(at, at + len(numbers)), numbers, texts[0] if named else []
            at += len(numbers)
