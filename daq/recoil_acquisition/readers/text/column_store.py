"""The columns of a block of numbers, parsed once and kept outside memory where they are many.

A long table is parsed piece by piece, some pieces at a time in parallel. Its numbers go to a temporary
file, written and read anywhere in it by several threads, column beside column within each piece, so that any one column
is read without the others; a short table stays in memory.
"""

from __future__ import annotations

import tempfile
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.text.row_parser import RowParser
from recoil_acquisition.readers.text.rows import take_marks_out
from recoil_acquisition.readers.text.text_table import THREADS, RowRange, TextBlock
from recoil_acquisition.readers.text.thousands import Grouping

MEMORY_BYTES = 1 << 26
"""Numbers up to which a table is kept in memory."""
Seconds = Callable[[Sequence[str]], NDArray[np.float64]]
Kept = tuple[NDArray[np.int64], NDArray[np.int64], list[str]]


class NumberFile:
    """A temporary file of float64 that vanishes with this object.

    Parameters
    ----------
    path
        File whose numbers are kept, for messages.

    Raises
    ------
    ReadError
        If there is no room for it.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        try:
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed when this object goes
        except OSError as error:
            raise self._full(error) from error
        weakref.finalize(self, self._file.close)

    def write(self, start: int, numbers: NDArray[np.float64]) -> None:
        """Write numbers, C-contiguous, from the one at ``start`` on.

        Raises
        ------
        ReadError
            If there is no room for them.
        """
        left = numbers.data.cast("B") if numbers.size else memoryview(b"")
        try:
            with self._lock:
                self._file.seek(8 * start)
                while left:
                    left = left[self._file.write(left) :]
        except OSError as error:
            raise self._full(error) from error

    def read(self, start: int, numbers: NDArray[np.float64]) -> None:
        """Fill an array, C-contiguous, with the numbers from the one at ``start`` on.

        Raises
        ------
        ReadError
            If they cannot be read back.
        """
        left = numbers.data.cast("B") if numbers.size else memoryview(b"")
        try:
            with self._lock:
                self._file.seek(8 * start)
                while left:
                    count = self._file.readinto(left)
                    if not count:
                        raise OSError(0, "it became shorter")
                    left = left[count:]
        except OSError as error:
            raise self._full(error) from error

    def _full(self, error: OSError) -> ReadError:
        return ReadError(
            f"its numbers cannot be kept in a temporary file: {error.strerror}", path=self._path,
            remedy="make room in the folder of temporary files, or name another in TMPDIR",
        )  # fmt: skip


class ColumnStore:
    """The columns of a block, parsed when the first of them is asked for.

    Parameters
    ----------
    seconds
        Function that turns the cells of the column of stamps into numbers; ValueError with the row as ``args[1]``.
    stamp_column
        Index of the column of stamps; None if there is none.
    text_columns
        Further columns that hold no numbers; they are NaN.
    remedy
        Advice to the user where a stamp cannot be read.
    """

    def __init__(
        self,
        block: TextBlock,
        seconds: Seconds | None = None,
        stamp_column: int | None = None,
        text_columns: Sequence[int] = (),
        remedy: str | None = None,
    ) -> None:
        self.block = block
        self._seconds, self._stamp_column, self._remedy = seconds, stamp_column, remedy
        self._text_columns = (*([] if stamp_column is None else [stamp_column]), *text_columns)
        self._kept: dict[int, NDArray[np.float64]] = {}
        self._spill: NumberFile | None = None
        self._ends: NDArray[np.int64] | None = None
        self._lost = np.zeros(len(block.format.columns), dtype=np.int64)
        self._overloads = np.zeros_like(self._lost)

    @property
    def lost(self) -> NDArray[np.int64]:
        """Number of lost samples of each column, overloads among them, shape (n_columns,)."""
        self._ensure_parsed()
        return self._lost

    @property
    def overloads(self) -> NDArray[np.int64]:
        """Number of samples of each column that are marked as an overload, shape (n_columns,)."""
        self._ensure_parsed()
        return self._overloads

    def column(self, index: int, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Return some of a column's numbers, the caller's own, shape (stop - start,).

        Raises
        ------
        CorruptFileError
            If a row has another width or a cell is no number, with line and column.
        """
        ends = self._ensure_parsed()
        first, last, _ = slice(start, stop).indices(int(ends[-1]))
        result = np.empty(max(last - first, 0))
        for piece in range(int(np.searchsorted(ends, first, side="right")), len(ends)):
            begin, end = int(ends[piece - 1]) if piece else 0, int(ends[piece])
            low, high = max(first, begin), min(last, end)
            if low >= high:
                break
            part = result[low - first : high - first]
            if self._spill is None:
                part[:] = self._kept[piece][index, low - begin : high - begin]
            else:
                self._spill.read(self._offset(piece, ends, index) + low - begin, part)
        return result

    def _offset(self, piece: int, ends: NDArray[np.int64], index: int) -> int:
        """Return where a column of a piece begins among the spilled numbers."""
        begin = int(ends[piece - 1]) if piece else 0
        return begin * len(self.block.format.columns) + index * (int(ends[piece]) - begin)

    def _ensure_parsed(self) -> NDArray[np.int64]:
        if self._ends is None:
            self._ends = self._parse()
        return self._ends

    def _parse(self) -> NDArray[np.int64]:
        """Parse all pieces; return the number of rows at the end of each."""
        pieces = self.block.pieces
        ends = np.cumsum([piece.rows for piece in pieces], dtype=np.int64)
        self._lost[:] = 0
        self._overloads[:] = 0
        self._kept = {}
        spill = 8 * self.block.row_count * len(self.block.format.columns) > MEMORY_BYTES
        self._spill = NumberFile(self.block.file.path) if spill else None
        grouping = Grouping(self.block.format, self.block.markers)
        for at, (lost, overloads, cells) in enumerate(self._parsed(pieces, ends, grouping)):
            self._lost += lost
            self._overloads += overloads
            if self._seconds is not None and self._stamp_column is not None:
                self._keep_stamps(self._stamps(self._seconds, cells, pieces[at].line), at, ends)
        grouping.check()
        return ends

    def _keep_stamps(self, seconds: NDArray[np.float64], piece: int, ends: NDArray[np.int64]) -> None:
        """Put the seconds of a piece's stamps in their column, which are found in the file's order."""
        index = self._stamp_column or 0
        self._lost[index] += np.isnan(seconds).sum()
        if self._spill is None:
            self._kept[piece][index] = seconds
        else:
            self._spill.write(self._offset(piece, ends, index), np.ascontiguousarray(seconds))

    def _parsed(self, pieces: Sequence[RowRange], ends: NDArray[np.int64], grouping: Grouping) -> Iterator[Kept]:
        """Parse and keep pieces in their order, some at a time."""
        parser = RowParser(self.block.format, self._text_columns, grouping)
        if len(pieces) == 1:
            yield self._keep(parser, 0, pieces[0], ends)
            return
        waiting: deque[Future[Kept]] = deque()
        with ThreadPoolExecutor(THREADS) as pool:
            try:
                for at in range(len(pieces)):
                    waiting.append(pool.submit(self._keep, parser, at, pieces[at], ends))
                    if len(waiting) > THREADS:
                        yield waiting.popleft().result()
                while waiting:
                    yield waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()

    def _keep(self, parser: RowParser, at: int, piece: RowRange, ends: NDArray[np.int64]) -> Kept:
        """Parse one piece and keep its numbers; return its lost samples and overloads, and its stamps' cells."""
        values, texts = parser.parse(self.block.text(piece), piece.line, piece.rows)
        if len(values) != piece.rows:
            raise CorruptFileError(
                "rows cannot be separated", path=self.block.file.path, place=f"from line {piece.line} on",
                expected=f"{piece.rows} rows", found=f"{len(values)}",
            )  # fmt: skip
        lost, overloads = take_marks_out(values)
        if self._stamp_column is not None:
            lost[self._stamp_column] = 0  # taken from its seconds, later
        columns = np.ascontiguousarray(values.T)
        if self._spill is None:
            self._kept[at] = columns
        else:
            self._spill.write(self._offset(at, ends, 0), columns)
        return lost, overloads, texts[0] if self._stamp_column is not None else []

    def _stamps(self, seconds: Seconds, cells: Sequence[str], line: int) -> NDArray[np.float64]:
        try:
            return seconds(cells)
        except ValueError as error:
            row = error.args[1] if len(error.args) > 1 else 0
            raise CorruptFileError(
                str(error.args[0]), path=self.block.file.path, place=f"line {line + row}, time column",
                remedy=self._remedy,
            ) from error  # fmt: skip
