"""Rows of numbers read cell by cell: slow, and able to say what is wrong and where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.text.cells import is_lost, is_number
from recoil_acquisition.readers.text.row_format import RowFormat, is_comment


def parse_strictly(
    rows: RowFormat, text: bytes, line: int, text_columns: Sequence[int]
) -> tuple[NDArray[np.float64], list[list[str]]]:
    r"""Read rows cell by cell.

    Parameters
    ----------
    text
        Complete rows, each ended by ``\n``.
    line
        Number of the first one's line, from 1.
    text_columns
        Columns that are text; their numbers are NaN.

    Returns
    -------
    values : ndarray of float64, shape (n_rows, width)
        NaN where a sample is lost.
    texts : list of list of str
        The cells of each column of text.

    Raises
    ------
    CorruptFileError
        If a row has another width or a cell is no number, with line and column.
    """
    missing_numbers = {float(m.replace(",", ".")) for m in rows.missing if is_number(m)}
    values: list[list[float]] = []
    texts: dict[int, list[str]] = {i: [] for i in text_columns}
    for number, row in enumerate(text.split(b"\n")[:-1], start=line):
        if rows.comment and is_comment(row, rows.comment):
            continue
        cells = [cell.strip() for cell in row.decode(rows.encoding, errors="replace").split(rows.separator)]
        if len(cells) != rows.width:
            raise rows.wrong_width(number, len(cells))
        numbers = []
        for i, cell in enumerate(cells):
            if i in texts:
                texts[i].append(cell)
                numbers.append(np.nan)
            elif is_lost(cell) or cell in rows.missing:
                numbers.append(np.nan)
            elif is_number(cell) and ("." if rows.decimal_comma else ",") not in cell and cell.isascii():
                value = float(cell.replace(",", "."))
                numbers.append(np.nan if value in missing_numbers else value)
            else:
                name = rows.columns[i] if i < len(rows.columns) else "behind the last"
                raise CorruptFileError(
                    "a cell is not a number",
                    path=rows.path,
                    place=f"line {number}, column {name!r}",
                    expected="a number or an empty cell",
                    found=repr(cell[:40]),
                )
        values.append(numbers)
    table = np.array(values, dtype=np.float64).reshape(-1, rows.width)
    table[~np.isfinite(table)] = np.nan
    return table, list(texts.values())
