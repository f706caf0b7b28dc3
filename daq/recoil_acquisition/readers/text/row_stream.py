"""Rows of numbers read by pandas' parser, one piece of text after another.

Parsing is most of the time that a long text takes, so the parser is kept from piece to piece with
the memory that it has allocated, and reads the pieces' bytes as they are. Whatever it will not read
as numbers, or counts differently, is left to the strict parser, which says what is wrong and where.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.text.row_format import RowFormat

if TYPE_CHECKING:
    from pandas.io.parsers import TextFileReader

Parsed = tuple[NDArray[np.float64], list[list[str]]]
"""Numbers, shape (n_rows, width), and the cells of each column of text."""

COMPARED_BYTES = 1 << 16
"""Bytes that are compared at once, few enough to stay near the processor."""

_LOST_SPELLINGS = ("", "nan", "NaN", "NAN", "-nan", "-NaN")


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
            Complete rows in parts, each row ended by ``\n``; a ``\r`` before it belongs to its last cell, as space.
        count
            How many rows there are.
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
    """Count a byte, some times faster than `bytes.count` does."""
    values, code = np.frombuffer(text, np.uint8), ord(byte)
    return sum(
        int(np.count_nonzero(values[at : at + COMPARED_BYTES] == code)) for at in range(0, values.size, COMPARED_BYTES)
    )


def _by_default_exact(version: str) -> bool:
    """Return whether pandas reads numbers to the last bit without being told to."""
    major, _, rest = version.partition(".")
    return (int(major), int(rest.partition(".")[0])) >= (3, 1)
