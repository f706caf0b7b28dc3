"""Rows of numbers of a text table, read fast where they are plainly numbers and strictly where not.

Parsing is most of the time that a long text takes, so pandas' parser is kept from piece to piece with the memory that
it has allocated, and reads the pieces' bytes as they are. Whatever it will not read as numbers, or counts differently,
is read cell by cell: slow, and able to say what is wrong and where.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    from pandas.io.parsers import TextFileReader

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


class RowStream:
    """A parser for the rows of one table, to be used by one thread at a time.

    Parameters
    ----------
    text_columns
        Columns that are text; their numbers are NaN.
    lost
        Whether cells may stand for lost samples. Without, such rows are refused, and others are read
        sooner because no cell is looked up among the spellings of a lost one.
    """

    def __init__(self, rows: RowFormat, text_columns: Sequence[int], *, lost: bool) -> None:
        self._rows, self._text_columns, self._lost = rows, tuple(text_columns), lost
        self._source = _Source()
        self._reader: TextFileReader | None = None

    def parse(self, parts: Iterator[bytes], count: int) -> Parsed | None:
        r"""Read some rows; None if they are not plainly numbers, or not all of one width.

        Parameters
        ----------
        parts
            Rows in parts, each row ended by ``\n``; a ``\r`` before it belongs to its last cell, as space.
        count
            Number of the rows.
        """
        every_row = self._lost or bool(self._text_columns)
        self._source.give(parts, self._rows.encoding, self._rows.separator, every_row=every_row)
        try:
            self._reader = self._reader or self._opened()
            table = self._reader.get_chunk(count)
        except (ValueError, OverflowError, UnicodeDecodeError, StopIteration):  # ParserError is a ValueError
            self.close()
            return None
        # Rows that are more than they were counted would wait in the parser for the next piece
        read_all = not self._source.read() and self._source.lines == count
        # Not every version of pandas refuses too many cells in the first row of a piece
        if table.shape != (count, self._rows.width) or not read_all or self._source.in_first != self._rows.width - 1:
            self.close()
            return None
        texts = []
        for column in self._text_columns:
            texts.append([_unquoted(cell.strip()) if isinstance(cell, str) else "" for cell in table[column].tolist()])
            table[column] = np.nan
        # Without a copy it may be a view that cannot be written
        values = table.to_numpy(dtype=np.float64, copy=bool(self._text_columns))
        with np.errstate(all="ignore"):
            whole = bool(np.isfinite(values.sum(axis=0)).all())
        # Too many cells are an error of the parser; too few are filled up, and cells behind them seem empty
        if not whole and (not every_row or self._source.separators != count * (self._rows.width - 1)):
            return None
        return values, texts

    def close(self) -> None:
        """Let the parser go; another is opened for the next rows."""
        if self._reader is not None:
            self._reader.close()
        self._reader = None
        self._source.give(iter(()))

    def _opened(self) -> TextFileReader:
        import pandas as pd

        options: dict[str, Any] = {} if _by_default_exact(pd.__version__) else {"float_precision": "round_trip"}
        if self._lost:
            # The carriage return of a line end stays with the last cell
            spellings = [s + end for s in (*_LOST_SPELLINGS, *self._rows.missing) for end in ("", "\r")]
            numbers = [i for i in range(self._rows.width) if i not in self._text_columns]
            options |= {"keep_default_na": False, "na_values": dict.fromkeys(numbers, spellings)}
        dtypes: Any = np.float64
        if self._text_columns:
            dtypes = {i: str if i in self._text_columns else np.float64 for i in range(self._rows.width)}
        source: Any = self._source
        reader: TextFileReader = pd.read_csv(
            source, sep=self._rows.separator, header=None, dtype=dtypes, engine="c", quoting=3,
            lineterminator="\n", decimal="," if self._rows.decimal_comma else ".", skip_blank_lines=False,
            na_filter=self._lost, low_memory=False, encoding="utf-8", iterator=True, **options,
        )  # fmt: skip
        # Where pandas has this switch it need not allocate for every piece anew; the result is the same without
        inner: Any = getattr(getattr(reader, "_engine", None), "_reader", None)
        if hasattr(inner, "trim_after_read"):
            inner.trim_after_read = False
        return reader


def _unquoted(cell: str) -> str:
    """Take the quotes off a cell of text."""
    if len(cell) > 1 and cell[0] == cell[-1] == '"':
        return cell[1:-1].replace('""', '"').strip()
    return cell


class _Source:
    """Source that the parser reads from: the bytes of one piece, then of the next.

    pandas takes what has only `read` as decoded already, so its bytes reach the parser as they are,
    as UTF-8. A stream of bytes would be decoded and encoded again.
    """

    def __init__(self) -> None:
        self.give(iter(()))

    def give(
        self, parts: Iterator[bytes], encoding: str = "utf-8", separator: str = "", *, every_row: bool = False
    ) -> None:
        """Give what is to be read next, its encoding, and what is to be counted in the first or every row."""
        self._parts, self._separator, self._every_row = parts, separator.encode(), every_row
        self.lines = self.separators = self.in_first = 0
        utf_8 = codecs.lookup(encoding).name == "utf-8"
        self._decoder = None if utf_8 else codecs.getincrementaldecoder(encoding)("replace")

    def read(self, _count: int = -1) -> bytes:
        """Return the next part, however many bytes are asked for; nothing at the end of the piece."""
        part = next(self._parts, b"")
        if not self.lines:
            self.in_first += part[: part.find(b"\n") if b"\n" in part else None].count(self._separator)
        self.lines += count_byte(part, b"\n")
        if self._every_row:
            self.separators += count_byte(part, self._separator)
        if self._decoder is not None and not part.isascii():
            return self._decoder.decode(part).encode("utf-8")
        return part

    def __iter__(self) -> Iterator[bytes]:
        """Go through what is left: pandas asks for what can, and its C parser never does."""
        return self._parts


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
    """A parser for the rows of one table, to be used by one thread at a time.

    Parameters
    ----------
    text_columns
        Columns that are text; their numbers are NaN.
    grouping
        Search for marks between thousands that is shown all rows; None where none may be set apart.
    """

    def __init__(self, rows: RowFormat, text_columns: Sequence[int] = (), grouping: Grouping | None = None) -> None:
        self._rows, self._text_columns, self._grouping = rows, tuple(text_columns), grouping
        self._plain = RowStream(rows, text_columns, lost=False)
        self._gappy = RowStream(rows, text_columns, lost=True)
        self._always_gappy = bool(rows.missing) or rows.ends_with_separator
        self._gaps = self._rewritten = False

    def parse(
        self, parts: Callable[[], Iterator[bytes]], line: int, count: int
    ) -> tuple[NDArray[np.float64], list[list[str]]]:
        r"""Read some rows.

        Parameters
        ----------
        parts
            Function that returns the rows in parts, each row ended by ``\n``; called again for another attempt.
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
        parsed = None
        if not self._has_comments(parts):
            if not (self._gaps or self._always_gappy or self._rewritten):
                parsed = self._plain.parse(parts(), count)
            # What the rows before were like is the best guess at what the next ones are
            self._gaps = parsed is None
            if parsed is None and not self._rewritten:
                parsed = self._gappy.parse(parts(), count)
            if parsed is None:
                text, as_before = b"".join(parts()), self._rewritten
                plain = plain_rows(text, self._rows, words=not self._text_columns)
                self._rewritten = plain != text
                if self._rewritten or as_before:
                    parsed = self._gappy.parse(iter((plain,)), count)
            if parsed is not None:
                self._gaps = _has_gaps(parsed[0], self._text_columns)
        if parsed is None:
            parsed = parse_strictly(self._rows, b"".join(parts()), line, self._text_columns)
        values, texts = parsed
        if self._rows.ends_with_separator:
            extra = np.flatnonzero(~np.isnan(values[:, -1]))
            if extra.size:
                raise self._rows.wrong_width(line + int(extra[0]), self._rows.width)
            values = values[:, :-1]
        if self._grouping is not None:
            self._grouping.look(values, lambda: b"".join(parts()), line)
        return values, texts

    def _has_comments(self, parts: Callable[[], Iterator[bytes]]) -> bool:
        comment = self._rows.comment
        return bool(comment) and comment.encode("utf-8") in b"".join(parts())

    def close(self) -> None:
        """Let go of what is kept for the next rows."""
        self._plain.close()
        self._gappy.close()


def _has_gaps(values: NDArray[np.float64], text_columns: Sequence[int]) -> bool:
    """Return whether numbers are lost; a column of text has none to lose."""
    with np.errstate(all="ignore"):
        lost = np.isnan(values.sum(axis=0))
    lost[list(text_columns)] = False
    return bool(lost.any())
