"""Lines of a text log that look alike, read all at once.

Most lines of a log of CAN frames differ in digits only. A line is read once, carefully, to learn where its digits
stand (`LineShape`); all lines of the same length that have the same characters everywhere else, and digits where
it has digits, are then read by array operations. Every line that no shape fits is left to the careful reading, so
that what a line means is decided in one place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.can.frames import BASE_ID_MASK, EXTENDED, ID_MASK, LATEST_NS, FrameBlock, FrameList

CUT = "the last line has no line end and may be cut: it was left out"

_ROWS = 16384
"""Lines that are worked on at once: they stay in the processor's cache."""

_LARGEST_SHAPES = 200
_FRUITLESS = 20
"""Lines of one length of which nothing was learnt, after which the others of that length are not tried."""

_HEX = np.full(256, 255, dtype=np.uint8)
for _digits in (b"0123456789abcdef", b"0123456789ABCDEF"):
    _HEX[np.frombuffer(_digits, dtype=np.uint8)] = np.arange(16)


@dataclass(frozen=True)
class LineShape:
    """Places of the digits of a frame in its line.

    Attributes
    ----------
    whole, fraction
        Spans of the decimal digits of the seconds before and behind the point, from and up to a character; up to nine
        digits each, ten before the point.
    identifier
        Span of the identifier's hexadecimal digits.
    extended
        Whether the identifier has 29 bits.
    data
        Characters at which the two hexadecimal digits of each byte begin.
    end
        Character from which on a line may be anything.
    """

    whole: tuple[int, int]
    fraction: tuple[int, int]
    negative: bool
    identifier: tuple[int, int]
    extended: bool
    data: tuple[int, ...]
    channel: int
    end: int


@dataclass(frozen=True, eq=False)
class TextLines:
    """The lines of a text that have a line end.

    Attributes
    ----------
    start, length : ndarray of int64, shape (n_lines,)
        Byte at which each line begins, and number of its bytes without the line end.
    cut
        Bytes behind the last line end.
    """

    text: bytes
    start: NDArray[np.int64]
    length: NDArray[np.int64]
    cut: bytes

    def line(self, at: int) -> bytes:
        """Return one line without its line end."""
        start = int(self.start[at])
        return self.text[start : start + int(self.length[at])]


def split_lines(text: bytes) -> TextLines:
    r"""Find the lines of a text with ``\n`` line ends."""
    ends = np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n"))
    start = np.r_[0, ends[:-1] + 1] if ends.size else ends
    return TextLines(text, start, ends - start, text[int(ends[-1]) + 1 :] if ends.size else text)


def read_uniform_lines(
    lines: TextLines, learn: Callable[[bytes], LineShape | None], found: FrameList
) -> NDArray[np.int64]:
    """Read the frames of lines that look alike.

    Parameters
    ----------
    learn
        Function that returns the shape of a line, None if it is no plain frame.
    found
        List that the frames are added to, each one's place being its line.

    Returns
    -------
    ndarray of int64, shape (n_left,)
        Lines that were not read, in their order.
    """
    order = np.argsort(lines.length, kind="stable")
    bounds = np.flatnonzero(np.diff(lines.length[order])) + 1
    left = []
    for same_length in np.split(order, bounds):
        remaining, fruitless = same_length, 0
        for _ in range(_LARGEST_SHAPES):
            if not remaining.size or fruitless == _FRUITLESS:
                break
            line = lines.line(int(remaining[0]))
            shape = learn(line)
            if shape is None:
                left.append(remaining[:1])
                remaining, fruitless = remaining[1:], fruitless + 1
                continue
            others = [
                _take(lines, remaining[at : at + _ROWS], line, shape, found) for at in range(0, remaining.size, _ROWS)
            ]
            rest = np.concatenate(others)
            if rest.size and rest[0] == remaining[0]:
                left.append(rest[:1])
                rest, fruitless = rest[1:], fruitless + 1
            remaining = rest
        left.append(remaining)
    return np.sort(np.concatenate(left)) if left else order


def _take(
    lines: TextLines, rows: NDArray[np.int64], line: bytes, shape: LineShape, found: FrameList
) -> NDArray[np.int64]:
    """Add the frames of the lines that have a shape; return the other lines."""
    windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(lines.text, dtype=np.uint8), max(shape.end, 1))
    columns = np.ascontiguousarray(windows[lines.start[rows]].T)
    decimal = [*range(*shape.whole), *range(*shape.fraction)]
    hexadecimal = [*range(*shape.identifier), *(at + k for at in shape.data for k in (0, 1))]
    fits = np.ones(rows.size, dtype=bool)
    for at in set(range(shape.end)) - set(decimal) - set(hexadecimal):
        fits &= columns[at] == line[at]
    for at in decimal:
        columns[at] -= np.uint8(ord("0"))
        fits &= columns[at] <= 9
    for at in hexadecimal:
        columns[at] = _HEX[columns[at]]
        fits &= columns[at] <= 15
    whole, fraction = (_number(columns, span, 10) for span in (shape.whole, shape.fraction))
    identifier = _number(columns, shape.identifier, 16)
    fits &= (whole < LATEST_NS // 1_000_000_000) & (identifier <= (ID_MASK if shape.extended else BASE_ID_MASK))
    time_ns = whole * 1_000_000_000 + fraction * 10 ** (9 - (shape.fraction[1] - shape.fraction[0]))
    data = np.zeros((rows.size, max(8, len(shape.data))), dtype=np.uint8)
    for k, at in enumerate(shape.data):
        data[:, k] = columns[at] << np.uint8(4) | columns[at + 1]
    count = int(fits.sum())
    every = slice(None) if count == rows.size else fits
    found.add_block(
        FrameBlock(
            place=rows[every],
            time_ns=-time_ns[every] if shape.negative else time_ns[every],
            key=(identifier[every] | (EXTENDED if shape.extended else 0)).astype(np.uint32),
            channel=np.full(count, shape.channel, dtype=np.int64),
            length=np.full(count, len(shape.data), dtype=np.int64),
            data=data[every],
        )
    )
    return rows[~fits]


def _number(columns: NDArray[np.uint8], span: tuple[int, int], base: int) -> NDArray[np.int64]:
    """Put digits together; where they are no digits, the number is without meaning."""
    number = np.zeros(columns.shape[1], dtype=np.int64)
    for at in range(*span):
        number *= base
        number += columns[at]
    return number
