"""The columns of a block of numbers, parsed once and kept outside memory where they are many.

A long table is parsed piece by piece, some pieces at a time in parallel. Its numbers go to a temporary
file, column beside column within each piece, so that any one column is read without the others; a
short table stays in memory.
"""

from __future__ import annotations

import tempfile
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import IO

import numpy as np
from numpy.typing import NDArray

from daq.errors import CorruptFileError, ReadError
from daq.readers.text.text_table import Block, Piece, parse_piece

MEMORY_BYTES = 1 << 26
"""Numbers up to which a table is kept in memory."""

THREADS = 2
"""Pieces that are parsed at a time."""

Seconds = Callable[[Sequence[str]], NDArray[np.float64]]
Parsed = tuple[NDArray[np.float64], list[list[str]]]


class ColumnStore:
    """The columns of a block, parsed when the first of them is asked for.

    Parameters
    ----------
    block : Block
    seconds : callable, optional
        Turns the cells of the column of stamps into numbers; ValueError with the row as ``args[1]``.
    stamp_column : int, optional
        The column of stamps.
    text_columns : sequence of int
        Further columns that hold no numbers; they are NaN.
    remedy : str, optional
        What the user can do where a stamp cannot be read.
    """

    def __init__(
        self,
        block: Block,
        seconds: Seconds | None = None,
        stamp_column: int | None = None,
        text_columns: Sequence[int] = (),
        remedy: str | None = None,
    ) -> None:
        self.block = block
        self._seconds, self._stamp_column, self._remedy = seconds, stamp_column, remedy
        self._text_columns = (*([] if stamp_column is None else [stamp_column]), *text_columns)
        self._pieces: list[NDArray[np.float64]] = []
        self._ends: NDArray[np.int64] | None = None
        self._spill: IO[bytes] | None = None
        self._lost = np.zeros(len(block.columns), dtype=np.int64)

    @property
    def lost(self) -> NDArray[np.int64]:
        """Number of lost samples of each column, shape (n_columns,)."""
        self._ensure_parsed()
        return self._lost

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
            begin = int(ends[piece - 1]) if piece else 0
            span = (begin, int(ends[piece]))
            low, high = max(first, begin), min(last, span[1])
            if low >= high:
                break
            result[low - first : high - first] = self._part(piece, index, low - begin, high - begin, span)
        return result

    def _part(self, piece: int, index: int, low: int, high: int, span: tuple[int, int]) -> NDArray[np.float64]:
        """Return rows of one column of one piece, which spans some rows of the block."""
        if self._spill is None:
            return self._pieces[piece][index, low:high]
        self._spill.seek(8 * (span[0] * len(self.block.columns) + index * (span[1] - span[0]) + low))
        return np.frombuffer(self._spill.read(8 * (high - low)))

    def _ensure_parsed(self) -> NDArray[np.int64]:
        if self._ends is None:
            self._ends = self._parse()
        return self._ends

    def _parse(self) -> NDArray[np.int64]:
        """Parse all pieces; return the number of rows at the end of each."""
        spill = 8 * self.block.row_count * len(self.block.columns) > MEMORY_BYTES
        pieces: list[NDArray[np.float64]] = []
        ends: list[int] = []
        self._lost[:] = 0
        try:
            if spill:
                self._spill = tempfile.TemporaryFile()  # noqa: SIM115 - closed when this object goes
                weakref.finalize(self, self._spill.close)
            for piece, (values, texts) in self._parsed():
                if self._seconds is not None and self._stamp_column is not None:
                    values[:, self._stamp_column] = self._stamps(self._seconds, texts[0], piece.line)
                with np.errstate(all="ignore"):
                    doubtful = np.isnan(values.sum(axis=0))
                self._lost[doubtful] += np.isnan(values[:, doubtful]).sum(axis=0)
                ends.append((ends[-1] if ends else 0) + len(values))
                columns = np.ascontiguousarray(values.T)
                if self._spill is not None:
                    self._spill.write(columns.data)
                else:
                    pieces.append(columns)
        except OSError as error:
            raise ReadError(
                f"its numbers cannot be kept in a temporary file: {error.strerror}", path=self.block.file.path,
                remedy="make room in the folder of temporary files, or name another in TMPDIR",
            ) from error  # fmt: skip
        if not ends or ends[-1] != self.block.row_count:
            raise CorruptFileError(
                "rows cannot be told apart", path=self.block.file.path,
                expected=f"{self.block.row_count} rows", found=f"{ends[-1] if ends else 0}",
            )  # fmt: skip
        self._pieces = pieces
        return np.array(ends, dtype=np.int64)

    def _parsed(self) -> Iterator[tuple[Piece, Parsed]]:
        """Parse pieces in their order, some at a time."""
        waiting: deque[tuple[Piece, Future[Parsed]]] = deque()
        _ = self.block.width  # found once, before the threads ask for it
        with ThreadPoolExecutor(THREADS) as pool:
            try:
                for piece in self.block.pieces:
                    waiting.append((piece, pool.submit(parse_piece, self.block, piece, self._text_columns)))
                    if len(waiting) > THREADS:
                        first, future = waiting.popleft()
                        yield first, future.result()
                while waiting:
                    first, future = waiting.popleft()
                    yield first, future.result()
            finally:
                for _, future in waiting:
                    future.cancel()

    def _stamps(self, seconds: Seconds, cells: Sequence[str], line: int) -> NDArray[np.float64]:
        try:
            return seconds(cells)
        except ValueError as error:
            row = error.args[1] if len(error.args) > 1 else 0
            raise CorruptFileError(
                str(error.args[0]), path=self.block.file.path, place=f"line {line + row}, time column",
                remedy=self._remedy,
            ) from error  # fmt: skip
