"""The block of numbers of a text table, read strictly and in pieces.

A cell that is no number, or a row of another width, is an error with its line, never a value. Numbers
are what `float` makes of their text, to the last bit: pandas' parser does that since 3.1 and by
``round_trip`` before, and what it will not read is read again cell by cell, which finds the place.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.errors import CorruptFileError
from daq.readers.text_cells import (
    LOST_WORDS,
    SEPARATORS,
    has_decimal_comma,
    is_lost,
    is_number,
    split_cells,
    split_unit,
    unique_names,
)
from daq.readers.text_file import Text, one_line_end

__all__ = [
    "LOST_WORDS",
    "SEPARATORS",
    "Block",
    "find_block",
    "has_decimal_comma",
    "is_lost",
    "is_number",
    "parse_piece",
    "printed_decimals",
    "read_block",
    "split_cells",
    "split_unit",
    "unique_names",
]

PIECE_BYTES = 1 << 21
"""Text that is parsed at once; no row is longer."""

COUNTED_BYTES = 1 << 16
"""Bytes that are compared at once, few enough to stay near the processor."""

MOST_LINE_BYTES = 1 << 16
"""Of a line by which the number of cells is found."""

_LOST_SPELLINGS = ("", "nan", "NaN", "NAN", "-nan", "-NaN")


@dataclass(frozen=True)
class Piece:
    """Some rows of a block.

    Attributes
    ----------
    start, stop : int
        Bytes of the file.
    line : int
        Number of the first row's line, from 1.
    rows : int
    """

    start: int
    stop: int
    line: int
    rows: int


@dataclass(frozen=True)
class Block:
    """Where the numbers of a text file are, and how they are written.

    Attributes
    ----------
    file : Text
    start, stop : int
        Bytes of the complete rows; ``stop`` lies before the last row's line end.
    first_line : int
        Number of the first row's line in the file, from 1.
    separator : str
    columns : tuple of str
        Names of the columns, for messages.
    decimal_comma : bool
    dropped : str
        Why a last row was left out; empty if none was.
    missing : tuple of str
        Further texts, or numbers, that stand for a lost sample.
    comment : str
        What begins a line that is no row; empty if there are none.
    """

    file: Text
    start: int
    stop: int
    first_line: int
    separator: str
    columns: tuple[str, ...]
    decimal_comma: bool
    dropped: str
    missing: tuple[str, ...] = ()
    comment: str = ""

    @property
    def row_count(self) -> int:
        """Number of complete rows."""
        return sum(piece.rows for piece in self.pieces)

    @cached_property
    def width(self) -> int:
        """Number of cells per row: one more than there are columns where rows end with a separator."""
        at = self.start
        while at < self.stop:
            line = self.file.read(at, min(at + MOST_LINE_BYTES, self.stop)).split(self.file.line_end, 1)[0]
            if not (self.comment and _is_comment(line, self.comment)):
                break
            at += len(line) + 1
        first = line
        cells = first.count(self.separator.encode()) + 1
        return len(self.columns) + (cells == len(self.columns) + 1)

    def place(self, row: int, column: str) -> str:
        """Return the place of a cell for messages."""
        return f"line {self.first_line + row}, column {column!r}"

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """Parts of the rows that are parsed at once, in the file's order.

        Raises
        ------
        CorruptFileError
            If a line is longer than a table's rows are.
        """
        end, at, line, pieces = self.file.line_end, self.start, self.first_line, []
        while at < self.stop:
            raw = self.file.read(at, min(at + PIECE_BYTES, self.stop))
            length = len(raw)
            if at + length < self.stop:
                length = raw.rfind(end) + 1
                if not length:
                    raise CorruptFileError(
                        f"a line is longer than {PIECE_BYTES} bytes", path=self.file.path, place=f"line {line}",
                        expected="a row of numbers", remedy="export it again",
                    )  # fmt: skip
            lines = _count(raw, end) + (at + length == self.stop)  # the last row's line end lies behind the block
            piece = Piece(at, at + length, line, lines)
            if self.comment:
                piece = Piece(at, at + length, line, _count_rows(self, self.text(piece)))
            pieces.append(piece)
            at, line = at + length, line + lines
        return tuple(pieces)

    def text(self, piece: Piece) -> bytes:
        r"""Read a piece, its last row ended and ``\r`` for ``\n`` where that alone ends lines."""
        raw = self.file.read(piece.start, piece.stop)
        if not raw.endswith(self.file.line_end):
            raw += self.file.line_end
        return raw if self.file.line_end == b"\n" else one_line_end(raw)


def find_block(
    file: Text,
    start: int,
    separator: str,
    columns: Sequence[str],
    *,
    decimal_comma: bool,
    missing: Sequence[str] = (),
    comment: str = "",
) -> Block:
    """Delimit the rows of numbers that begin at a byte of a text file.

    A last row that may be cut is left out: one without a line end, whose last number cannot be
    trusted, or one with too few cells.

    Raises
    ------
    CorruptFileError
        If there is no complete row.
    """
    first_line = file.read(0, start).count(file.line_end) + 1
    base = max(start, file.size - PIECE_BYTES)
    tail = file.read(base, file.size)
    end = tail.rfind(file.line_end) + 1
    dropped = ""
    if tail[end:].strip():
        dropped = "the last row has no line end and may be cut: it was left out"
    rows = tail[:end].rstrip(b" \r\n")
    last = rows[rows.rfind(file.line_end) + 1 :]
    if rows and last.count(separator.encode()) < len(columns) - 1 and not (comment and _is_comment(last, comment)):
        rows = rows[: len(rows) - len(last)].rstrip(b" \r\n")
        dropped = f"the last row has fewer than {len(columns)} cells: it was left out"
    if not rows.strip():
        raise CorruptFileError(
            "there is no complete row of numbers", path=file.path, place=f"line {first_line}", remedy="export it again"
        )
    return Block(
        file, start, base + len(rows), first_line, separator, tuple(columns), decimal_comma, dropped,
        tuple(missing), comment,
    )  # fmt: skip


def read_block(block: Block, *, text_first_column: bool = False) -> tuple[NDArray[np.float64], list[str]]:
    """Read all numbers of a block.

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
    parsed = [parse_piece(block, piece, (0,) if text_first_column else ()) for piece in block.pieces]
    texts = [text for _, found in parsed for text in (found[0] if found else ())]
    return np.concatenate([values for values, _ in parsed]), texts


def parse_piece(
    block: Block, piece: Piece, text_columns: Sequence[int] = (), *, gaps: bool = True
) -> tuple[NDArray[np.float64], list[list[str]]]:
    """Read the numbers of some rows of a block.

    Parameters
    ----------
    block : Block
    piece : Piece
    text_columns : sequence of int
        Columns that are text; their numbers are NaN.
    gaps : bool
        Whether lost samples are expected. The result is the same; with the right guess it comes sooner.

    Returns
    -------
    values : ndarray of float64, shape (n_rows, n_columns)
    texts : list of list of str
        The cells of each column of text.

    Raises
    ------
    CorruptFileError
        If a row has another width or a cell is no number, with line and column.
    """
    text = block.text(piece)
    parsed = None
    if not block.comment or block.comment.encode("ascii") not in text:
        # Without lost samples the parser need not look up each cell among the spellings of one
        for lost in (True,) if gaps or block.missing or block.width > len(block.columns) else (False, True):
            parsed = parsed or _parse_fast(block, text, piece.rows, text_columns, lost=lost)
    values, texts = parsed if parsed is not None else _parse_strictly(block, text, piece.line, text_columns)
    if block.width > len(block.columns):
        extra = np.flatnonzero(~np.isnan(values[:, -1]))
        if extra.size:
            raise _wrong_width(block, piece.line + int(extra[0]), block.width)
        values = values[:, :-1]
    return values, texts


class _Bytes:
    """A piece for the parser to read at once.

    What has only `read` is not wrapped for decoding, so its bytes reach the parser as they are, as
    UTF-8. A stream of bytes would be decoded and encoded again, and cut into small parts.
    """

    def __init__(self, piece: bytes) -> None:
        self._piece = piece

    def read(self, _count: int = -1) -> bytes:
        """Return the piece, however few bytes are asked for; then nothing."""
        piece, self._piece = self._piece, b""
        return piece

    def __iter__(self) -> Iterator[bytes]:
        """Go through lines: pandas asks for a stream that could, and its C parser never does."""
        return iter(self._piece.splitlines(keepends=True))


def _parse_fast(
    block: Block, piece: bytes, rows: int, text_columns: Sequence[int], *, lost: bool
) -> tuple[NDArray[np.float64], list[list[str]]] | None:
    """Read rows by pandas' parser; None if they are not plainly numbers, or not all of one width."""
    import pandas as pd

    separator = block.separator.encode()
    if piece[: piece.find(b"\n")].count(separator) != block.width - 1:
        return None
    options: dict[str, Any] = {} if _by_default_exact(pd.__version__) else {"float_precision": "round_trip"}
    if lost:
        options |= {"keep_default_na": False, "na_values": [*_LOST_SPELLINGS, *block.missing]}
    dtypes: Any = np.float64
    if text_columns:
        dtypes = {i: str if i in text_columns else np.float64 for i in range(block.width)}
    source: Any = _Bytes(piece) if piece.isascii() else io.BytesIO(piece)
    try:
        table = pd.read_csv(
            source, sep=block.separator, header=None, dtype=dtypes, engine="c", quoting=3,
            decimal="," if block.decimal_comma else ".", skip_blank_lines=False, na_filter=lost,
            low_memory=False, encoding=block.file.encoding, **options,
        )  # fmt: skip
    except (ValueError, OverflowError, UnicodeDecodeError):  # its ParserError and EmptyDataError are of ValueError
        return None
    if table.shape != (rows, block.width):
        return None
    texts = []
    for column in text_columns:
        texts.append([cell.strip() if isinstance(cell, str) else "" for cell in table[column].tolist()])
        table[column] = np.nan
    values = table.to_numpy(dtype=np.float64, copy=bool(text_columns))  # else it may be a view that cannot be written
    with np.errstate(all="ignore"):
        whole = np.isfinite(values.sum(axis=0)).all()
    if not whole:
        # Too many cells are an error of the parser; too few are filled up, and cells behind them seem empty
        if _count(piece, separator) != rows * (block.width - 1):
            return None
        values = np.where(np.isfinite(values), values, np.nan)
    return values, texts


def _by_default_exact(version: str) -> bool:
    """Tell whether pandas reads numbers to the last bit without being told to."""
    major, _, rest = version.partition(".")
    return (int(major), int(rest.partition(".")[0])) >= (3, 1)


def _count(text: bytes, byte: bytes) -> int:
    """Count a byte, some times faster than `bytes.count` does."""
    values, code = np.frombuffer(text, np.uint8), ord(byte)
    return sum(
        int(np.count_nonzero(values[at : at + COUNTED_BYTES] == code)) for at in range(0, values.size, COUNTED_BYTES)
    )


def _is_comment(row: bytes, comment: str) -> bool:
    return row.lstrip(b" ").startswith(comment.encode("utf-8"))


def _count_rows(block: Block, text: bytes) -> int:
    """Count the rows of a piece, without comments."""
    return sum(not _is_comment(row, block.comment) for row in text.split(b"\n")[:-1])


def _parse_strictly(
    block: Block, piece: bytes, line: int, text_columns: Sequence[int]
) -> tuple[NDArray[np.float64], list[list[str]]]:
    """Read rows cell by cell, and say which is none."""
    missing_numbers = {float(m.replace(",", ".")) for m in block.missing if is_number(m)}
    values: list[list[float]] = []
    texts: dict[int, list[str]] = {i: [] for i in text_columns}
    for number, row in enumerate(piece.split(b"\n")[:-1], start=line):
        if block.comment and _is_comment(row, block.comment):
            continue
        cells = [cell.strip() for cell in row.decode(block.file.encoding, errors="replace").split(block.separator)]
        if len(cells) != block.width:
            raise _wrong_width(block, number, len(cells))
        numbers = []
        for i, text in enumerate(cells):
            if i in texts:
                texts[i].append(text)
                numbers.append(np.nan)
            elif is_lost(text) or text in block.missing:
                numbers.append(np.nan)
            elif is_number(text) and ("." if block.decimal_comma else ",") not in text and text.isascii():
                value = float(text.replace(",", "."))
                numbers.append(np.nan if value in missing_numbers else value)
            else:
                name = block.columns[i] if i < len(block.columns) else "behind the last"
                raise CorruptFileError(
                    "a cell is not a number",
                    path=block.file.path,
                    place=f"line {number}, column {name!r}",
                    expected="a number or an empty cell",
                    found=repr(text[:40]),
                )
        values.append(numbers)
    table = np.array(values, dtype=np.float64).reshape(-1, block.width)
    table[~np.isfinite(table)] = np.nan
    return table, list(texts.values())


def _wrong_width(block: Block, line: int, width: int) -> CorruptFileError:
    comma = block.separator == "," and width > len(block.columns)
    return CorruptFileError(
        "a row does not fit the header",
        path=block.file.path,
        place=f"line {line}",
        expected=f"{len(block.columns)} cells",
        found=f"{width}",
        remedy="export with a decimal point or with ; between cells" if comma else "export it again",
    )


def printed_decimals(block: Block, column: int) -> int:
    """Return the place of a column's last printed digit: 6 for ``0.000020``, 9 for ``1.5E-008``.

    Cells whose trailing zeros were left out say too little, so the finest of some cells counts; a
    fixed number of digits says less at the end of the file, so its beginning and end are compared.
    """
    separator = block.separator.encode()
    head = one_line_end(block.file.read(block.start, min(block.start + 8192, block.stop)) + b"\n")
    tail = one_line_end(block.file.read(max(block.start, block.stop - 8192), block.stop))
    ends = (head.split(b"\n")[:50], tail.split(b"\n")[-49:])
    if len(ends[0]) > 2 and block.stop - block.start > 8192:
        ends = (ends[0][:-2] or ends[0], ends[1][1:] or ends[1])
    return min(
        max(
            (
                _decimals(cells[column].decode("ascii", errors="replace"))
                for cells in (row.split(separator) for row in rows)
                if len(cells) > column
            ),
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
