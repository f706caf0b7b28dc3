"""Rows of numbers read cell by cell: slow, and able to say what is wrong and where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.text.cells import (
    groups_thousands,
    is_number,
    lost_value,
    plain_number,
    split_cells,
)
from recoil_acquisition.readers.text.row_format import RowFormat, is_comment
from recoil_acquisition.readers.text_file import HEADER_LINES


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
        NaN where a sample is lost, infinite where it is beyond the instrument's range.
    texts : list of list of str
        The cells of each column of text.

    Raises
    ------
    CorruptFileError
        If a row has another width or a cell is no number, with line and column.
    """
    decimal = "," if rows.decimal_comma else "."
    missing_numbers = {float(m.replace(",", ".")) for m in rows.missing if is_number(m)}
    values: list[list[float]] = []
    texts: dict[int, list[str]] = {i: [] for i in text_columns}
    lines = text.split(b"\n")[:-1]
    for number, row in enumerate(lines, start=line):
        if rows.comment and is_comment(row, rows.comment):
            continue
        cells = split_cells(row.decode(rows.encoding, errors="replace"), rows.separator)
        if len(cells) != rows.width:
            raise _second_table(rows, lines[number - line :], number) or rows.wrong_width(number, len(cells))
        numbers = []
        for i, cell in enumerate(cells):
            if i in texts:
                texts[i].append(cell)
                numbers.append(np.nan)
            elif cell in rows.missing:
                numbers.append(np.nan)
            elif (lost := lost_value(cell)) is not None:
                numbers.append(lost)
            elif (number_text := plain_number(cell, decimal=decimal, thousands=rows.thousands or "")) is not None:
                value = float(number_text)
                numbers.append(np.nan if value in missing_numbers else value)
            else:
                raise _second_table(rows, lines[number - line :], number) or _no_number(cell, rows, number, i)
        values.append(numbers)
    table = np.array(values, dtype=np.float64).reshape(-1, rows.width)
    return table, list(texts.values())


def _second_table(rows: RowFormat, lines: Sequence[bytes], number: int) -> CorruptFileError | None:
    """Return that another recording was put behind the first one, if the same headings follow within some lines."""
    below = next(
        (i for i, row in enumerate(lines[:HEADER_LINES]) if rows.heading and row.strip() == rows.heading), None
    )
    if below is None:
        return None
    return CorruptFileError(
        f"a second recording begins: its headings stand in line {number + below}",
        path=rows.path, place=f"line {number}", expected="one recording per file",
        remedy="take the recordings apart there, and give the one that is meant",
    )  # fmt: skip


def _no_number(cell: str, rows: RowFormat, line: int, column: int) -> CorruptFileError:
    name = rows.columns[column] if column < len(rows.columns) else "behind the last"
    remedy = "if it means a lost sample, declare `missing` in `[source.layout]` of the rig; else export it again"
    if groups_thousands(cell):
        remedy = "export numbers without marks between thousands, or declare `thousands` in `[source.layout]`"
    return CorruptFileError(
        "a cell is not a number",
        path=rows.path,
        place=f"line {line}, column {name!r}",
        expected="a number or an empty cell",
        found=repr(cell[:40]),
        remedy=remedy,
    )
