"""Rows of numbers of a text table, read fast where they are plainly numbers and strictly where not.

pandas reads a piece. Whatever it will not read as numbers, or counts differently, is read cell by cell: slow, and able
to say what is wrong and where.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import Any

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
from recoil_acquisition.readers.text.plain_rows import plain_rows
from recoil_acquisition.readers.text.row_format import RowFormat, is_comment
from recoil_acquisition.readers.text.thousands import Grouping
from recoil_acquisition.readers.text_file import HEADER_LINES

Parsed = tuple[NDArray[np.float64], list[list[str]]]
"""Numbers, shape (n_rows, width), and the cells of each column of text."""
COMPARED_BYTES = 1 << 16
"""Bytes that are compared at once, few enough to stay near the processor."""
_LOST_SPELLINGS = ("", "nan", "NaN", "NAN", "-nan", "-NaN")


def parse_strictly(
    rows: RowFormat, text: bytes, line: int, text_columns: Sequence[int]
) -> tuple[NDArray[np.float64], list[list[str]]]:
    r"""Read rows cell by cell.

    Parameters
    ----------
    text
        Rows that are complete, each ended by ``\n``.
    line
        Number of the first one's line, from 1.
    text_columns
        Columns that are text; their numbers are NaN.

    Returns
    -------
    values : ndarray of float64, shape (n_rows, width)
        Numbers; NaN where a sample is lost, infinite where it is beyond the instrument's range.
    texts : list of list of str
        Cells of each column of text.

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


def parse_plainly(rows: RowFormat, text: bytes, count: int, text_columns: Sequence[int]) -> Parsed | None:
    r"""Read rows by pandas; None if they are not plainly numbers, or not all of one width.

    Parameters
    ----------
    text
        Rows, each ended by ``\n``; a ``\r`` before it belongs to its last cell, as space.
    count
        Number of the rows.
    text_columns
        Columns that are text; their numbers are NaN.
    """
    import pandas as pd

    separator = rows.separator.encode()
    # Not every version of pandas refuses too many cells in the first row
    if text.count(separator, 0, text.find(b"\n")) != rows.width - 1:
        return None
    # The carriage return of a line end stays with the last cell
    spellings = [s + end for s in (*_LOST_SPELLINGS, *rows.missing) for end in ("", "\r")]
    dtypes: Any = {i: str if i in text_columns else np.float64 for i in range(rows.width)}
    lost: Any = {i: spellings for i in dtypes if i not in text_columns}
    options: dict[str, Any] = {} if _by_default_exact(pd.__version__) else {"float_precision": "round_trip"}
    try:
        table = pd.read_csv(
            BytesIO(text), sep=rows.separator, header=None, dtype=dtypes if text_columns else np.float64, engine="c",
            quoting=3, lineterminator="\n", decimal="," if rows.decimal_comma else ".", skip_blank_lines=False,
            keep_default_na=False, na_values=lost, low_memory=False,
            encoding=rows.encoding, encoding_errors="replace", **options,
        )  # fmt: skip
    except (ValueError, OverflowError):  # ParserError is a ValueError
        return None
    if table.shape != (count, rows.width):
        return None
    texts = []
    for column in text_columns:
        texts.append([_unquoted(cell.strip()) if isinstance(cell, str) else "" for cell in table[column].tolist()])
        table[column] = np.nan
    # Without a copy it may be a view that cannot be written
    values = table.to_numpy(dtype=np.float64, copy=bool(text_columns))
    with np.errstate(all="ignore"):
        whole = bool(np.isfinite(values.sum(axis=0)).all())
    # Too many cells are an error of the parser; too few are filled up, and cells behind them seem empty
    if not whole and count_byte(text, separator) != count * (rows.width - 1):
        return None
    return values, texts


def _unquoted(cell: str) -> str:
    """Take the quotes off a cell of text."""
    if len(cell) > 1 and cell[0] == cell[-1] == '"':
        return cell[1:-1].replace('""', '"').strip()
    return cell


def count_byte(text: bytes, byte: bytes) -> int:
    """Count a byte, some times faster than ``bytes.count`` does."""
    values, code = np.frombuffer(text, np.uint8), ord(byte)
    return sum(
        int(np.count_nonzero(values[at : at + COMPARED_BYTES] == code)) for at in range(0, values.size, COMPARED_BYTES)
    )


def _by_default_exact(version: str) -> bool:
    """Return whether pandas reads numbers to the last bit without being told to."""
    major, _, rest = version.partition(".")
    return (int(major), int(rest.partition(".")[0])) >= (3, 1)


class RowParser:
    """A parser for the rows of one table, to be used by any number of threads.

    Parameters
    ----------
    text_columns
        Columns that are text; their numbers are NaN.
    grouping
        Search for marks between thousands that is shown all rows; None where none may be set apart.
    """

    def __init__(self, rows: RowFormat, text_columns: Sequence[int] = (), grouping: Grouping | None = None) -> None:
        self._rows, self._text_columns, self._grouping = rows, tuple(text_columns), grouping
        self._rewritten = False

    def parse(self, text: bytes, line: int, count: int) -> Parsed:
        r"""Read some rows.

        Parameters
        ----------
        text
            The rows, each ended by ``\n``.
        line
            Number of the first one's line, from 1.
        count
            Number of the rows.

        Returns
        -------
        values : ndarray of float64, shape (count, n_columns)
            NaN where a sample is lost, infinite where it is beyond the instrument's range.
        texts : list of list of str
            The cells of each column of text.

        Raises
        ------
        CorruptFileError
            If a row has another width or a cell is no number, with line and column.
        """
        rows, parsed = self._rows, None
        if not (rows.comment and rows.comment.encode("utf-8") in text):
            # What the rows before were like is the best guess at what the next ones are
            as_before = self._rewritten
            if not as_before:
                parsed = parse_plainly(rows, text, count, self._text_columns)
            if parsed is None:
                plain = plain_rows(text, rows, words=not self._text_columns)
                self._rewritten = plain != text
                if self._rewritten or as_before:
                    parsed = parse_plainly(rows, plain, count, self._text_columns)
        if parsed is None:
            parsed = parse_strictly(rows, text, line, self._text_columns)
        values, texts = parsed
        # cells behind the columns are there to be empty
        extra = np.flatnonzero(~np.isnan(values[:, len(rows.columns) :]).all(axis=1))
        if extra.size:
            raise rows.wrong_width(line + int(extra[0]), rows.width)
        values = values[:, : len(rows.columns)]
        if self._grouping is not None:
            self._grouping.look(values, text, line)
        return values, texts
