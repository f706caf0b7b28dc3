"""Rows of numbers of a text table, read fast where they are plainly numbers and strictly where not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.text.plain_rows import plain_rows
from recoil_acquisition.readers.text.row_format import RowFormat
from recoil_acquisition.readers.text.row_stream import RowStream
from recoil_acquisition.readers.text.strict_rows import parse_strictly
from recoil_acquisition.readers.text.thousands import Grouping


class RowParser:
    """A parser for the rows of one table, to be used by one thread at a time.

    Parameters
    ----------
    text_columns
        Columns that are text; their numbers are NaN.
    grouping
        Is shown all rows, if thousands may be set apart in them.
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
            Gives complete rows in parts, each row ended by ``\n``; called again for another attempt.
        line
            Number of the first one's line, from 1.
        count
            How many there are.

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
