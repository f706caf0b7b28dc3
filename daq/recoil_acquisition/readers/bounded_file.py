"""A file that never gives, nor makes room for, more than it has; and how much a packed one may unpack to."""

from __future__ import annotations

import io
from pathlib import Path

LARGEST_RATIO = 20
"""Ratio of the unpacked to the packed bytes of a file at most: frames of a bus shrink to a fifth or a tenth, measured
channels to a third; what does not change shrinks further."""
SPARE_BYTES = 1 << 26
"""Bytes that a file may unpack to beside that: a short recording may consist of channels that do not change."""
DEFLATE_RATIO = 1032
"""Bytes that deflate makes out of one at most: 258 of two bits (RFC 1951)."""


def most_unpacked(stored: int) -> int:
    """Return how many bytes a file may unpack to by what deflate and its like make of them.

    Deflate can make a thousand bytes out of one: without a bound, a file of 10 MB takes the memory of a machine.

    Parameters
    ----------
    stored
        Bytes of the file.
    """
    return LARGEST_RATIO * stored + SPARE_BYTES


class BoundedFile(io.BufferedReader):
    """A file opened to be read by a library that trusts the lengths in it.

    Python makes room for as many bytes as are asked for before it reads; a damaged length of 64 bits would
    take all memory.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self.length = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Read up to `size` bytes, all that are left if it is negative or None."""
        left = max(0, self.length - self.tell())
        return super().read(left if size is None or size < 0 else min(size, left))
